"""Users' objects are told apart by identity, and marked apart from their own attributes."""

import gc

import hostile
import pytest
from machines import Scripted, Watched, chain_of

import smach
from smach_oracle.oracle import OperatorHand, OracleContainer, oracle_of, unwrap
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.identity import WeakIdentityMap, is_same, truth_of
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.testing import Bench, fail

KINDS = [hostile.Hostile, hostile.RefusesNames, hostile.AnswersAll, hostile.RefusesMarks]


@pytest.fixture(autouse=True)
def disarmed():
    yield
    hostile.disarm()


@pytest.fixture(params=KINDS, ids=lambda kind: kind.__name__)
def classes(request):
    return hostile.Classes(request.param)


def wrapped(classes, machine, **settings):
    hostile.arm()
    function = classes.function
    OracleContainer.wrap(
        machine,
        {'A': [function(), classes.state('AHEAD'), 'SPARE'], 'B': [function()]},
        {
            'states': {'E': {'time_limit_s': 30.0}},
            'healthy': [{'function': function()}],
            'health_settle_s': 0.0,
            **settings,
        },
        name='TOP',
        health=function(),
    )
    seen = []
    oracle_of(machine).events.observers.append(seen.append)
    return seen


def told(seen, kind):
    return [event.state for event in seen if event.kind is kind]


def test_machines_states_and_functions_that_raise_when_compared_run_and_recover(classes):
    machine = classes.tree()
    seen = wrapped(classes, machine)
    assert [machine.execute(), machine.execute()] == ['succeeded', 'succeeded']
    assert sorted(told(seen, EventKind.FAILURE)) == ['A', 'B', 'B', 'C', 'E', 'F']
    assert 'function' in classes.log
    assert 'AHEAD' in classes.log
    assert told(seen, EventKind.WARNING) == []


def test_such_a_machine_is_held_by_an_operator_and_unwrapped(classes):
    machine, before = classes.tree(), classes.machine
    wrapped(classes, machine)
    hand = OperatorHand(machine)
    assert 'TOP' in hand.pause('Ann')
    hand.resume('Ann')
    assert hand.status().path == 'TOP'
    assert unwrap(machine) is machine
    assert type(machine) is before
    assert '_oracle' not in vars(machine)
    assert machine.execute() == 'aborted'  # of A, as bare


def test_such_a_machine_is_stored_and_goes_on_where_its_program_was_stopped(classes, tmp_path):
    store = {'checkpoint': str(tmp_path / 'store.db'), 'on_resume': 'recover'}
    first = classes.tree(last=[KeyboardInterrupt()])
    wrapped(classes, first, **store)
    with pytest.raises(KeyboardInterrupt):
        first.execute()
    hostile.disarm()  # SMACH compares machines while they are built
    classes.log.clear()
    second = classes.tree()
    seen = wrapped(classes, second, **store)
    assert second.execute() == 'succeeded'
    assert told(seen, EventKind.RESUMED)
    assert classes.log.count('LAST') == 1
    assert {'A', 'B', 'C', 'E', 'F'}.isdisjoint(classes.log)


def test_such_a_machine_runs_on_a_test_bench(classes):
    machine = classes.tree()
    hostile.arm()
    with Bench(machine, settings={'states': {'A': {'prior': 0.0}}}) as bench:
        bench.run([fail('LAST', visit=1)]).assert_recovered('LAST').assert_ended_with('succeeded')


def test_of_two_machines_that_compare_equal_each_is_its_own_key():
    class Equal:
        def __eq__(self, other):
            return True

        __hash__ = None

    one, other = Equal(), Equal()
    kept = WeakIdentityMap()
    kept[one], kept[other] = 'one', 'other'
    assert (kept.get(one), kept.get(other)) == ('one', 'other')
    assert {id(each) for each in kept} == {id(one), id(other)}
    kept.forget(other)
    assert other not in kept
    del one
    gc.collect()
    assert list(kept) == []


def test_a_class_of_machines_may_compare_by_its_own_rules():
    class Alike(type):
        def __eq__(cls, other):
            return True

        __hash__ = None

    class Own(smach.StateMachine, metaclass=Alike):
        pass

    outcomes = ['done', 'aborted', 'preempted']
    inner, machine = Own(outcomes), Own(outcomes)
    with inner:
        smach.StateMachine.add('A', Scripted(), {'ok': 'done'})
    with machine:
        smach.StateMachine.add('INNER', inner)
    assert OracleContainer.wrap(machine).execute() == 'done'


def test_a_method_is_the_same_at_each_access_and_an_equal_object_is_not():
    class Robot:
        def __eq__(self, other):
            return True

        def is_well(self):
            return True

        def is_near(self):
            return True

    robot = Robot()
    assert is_same(('a', [1, robot.is_well]), ('a', [1, robot.is_well]))
    assert not is_same(robot.is_well, Robot().is_well)
    assert not is_same(robot.is_well, robot.is_near)
    assert not is_same(robot, Robot())


class Array:
    """Compares and counts as numpy's arrays do."""

    def __eq__(self, other):
        return self

    __hash__ = None

    def __bool__(self):
        raise ValueError('The truth value of an array is ambiguous')


def test_an_array_in_place_of_an_outcome_is_an_outcome_that_is_not_registered():
    machine = chain_of(Scripted(Array(), 'ok'))
    OracleContainer.wrap(machine)
    assert machine.execute() == 'done'


def test_a_precondition_that_returns_an_array_is_not_met():
    machine = chain_of(Scripted('aborted', 'aborted'))
    OracleContainer.wrap(machine, {'A': [lambda userdata: Array()]})
    seen = []
    oracle_of(machine).events.observers.append(seen.append)
    machine.execute()
    ended = [event for event in seen if event.kind is EventKind.PRECONDITION_END]
    assert ended and all('returned' in event.text for event in ended)
    assert truth_of(Array()) is None


def test_a_precondition_that_has_every_attribute_is_a_function(classes):
    machine = chain_of(Scripted('aborted', 'ok'))
    function = classes.function()
    OracleContainer.wrap(machine, {'A': [function]})
    assert machine.execute() == 'done'
    assert classes.log == ['function']


def test_a_state_whose_class_uses_the_names_of_our_marks_runs():
    class Marked(smach.State):
        """Its author has used our name for something else."""

        _oracle = _oracle_wrapper = 'mine'

        def __init__(self):
            smach.State.__init__(self, ['ok', 'aborted'])

        def execute(self, userdata):
            return 'ok'

    machine = chain_of(Marked())
    OracleContainer.wrap(machine)
    assert machine.execute() == 'done'


class Final(smach.Concurrence):
    """Executes by itself, and lets nobody extend it."""

    def __init_subclass__(cls, **more):
        raise TypeError('Final is final')

    def execute(self, *args):
        return smach.Concurrence.execute(self, *args)


class FinalMachine(smach.StateMachine):
    """A machine that lets nobody extend it."""

    def __init_subclass__(cls, **more):
        raise TypeError('it is final')


def test_a_machine_whose_class_cannot_be_extended_is_refused():
    machine = chain_of(Scripted(), machine_class=FinalMachine)
    with pytest.raises(SettingsError, match=r'machine: .*can be extended \(it is final\)'):
        OracleContainer.wrap(machine)
    assert machine.execute() == 'done'


def test_states_in_a_container_that_cannot_be_extended_get_no_oracle_and_a_warning_says_so(log):
    branches = Final(outcomes=['done'], default_outcome='done')
    with branches:
        smach.Concurrence.add('A', Scripted('aborted'))
    machine = smach.StateMachine(outcomes=['done'])
    with machine:
        smach.StateMachine.add('ALL', branches)
    OracleContainer.wrap(machine, name='TOP')
    assert machine.execute() == 'done'
    text = 'TOP/ALL: its states get no oracle, since its class cannot be extended (Final is final)'
    assert ('warn', text) in log


def test_an_attribute_of_our_name_on_a_machine_without_an_oracle_is_its_own():
    inner = chain_of(Scripted('aborted'))
    inner._oracle = 'mine'
    machine = smach.StateMachine(['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('INNER', inner)
    watched = Watched(machine, settings={'nested': False})
    assert watched.run() == 'done' and inner._oracle == 'mine'


def test_a_step_of_a_users_own_does_not_run_and_one_warning_for_its_class_says_so(log):
    class Guarded(smach.StateMachine):
        def _update_once(self):
            raise AssertionError('an oracle makes each step')

    for _ in range(2):
        machine = OracleContainer.wrap(chain_of(Scripted('aborted'), machine_class=Guarded))
        assert machine.execute() == 'done'
    OracleContainer.wrap(smach.Sequence(['done'], 'done'))
    warned = [text for level, text in log if level == 'warn' and '_update_once' in text]
    assert warned == [
        'Guarded._update_once does not run: under an oracle, the oracle makes each step'
    ]
