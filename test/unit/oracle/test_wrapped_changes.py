"""Wrapped machines that are changed afterwards, and machines that cannot be wrapped."""

import inspect

import pytest
from guarded_machines import chain
from machines import FakeExpert, Scripted, Watched, chain_of, contents, goto, supersede, watched

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind

needs_constants = pytest.mark.skipif(
    'constants' not in inspect.signature(smach.StateMachine.add).parameters,
    reason='this engine has no constants',
)


def test_a_transition_changed_while_running_is_taken_and_counted():
    machine = watched(Scripted(), Scripted(), Scripted())
    machine.run()
    machine.machine._transitions['A']['ok'] = 'C'
    machine.run()
    assert machine.visits() == ['A', 'B', 'C', 'A', 'C']
    counts = {(row.state, row.to): row.count for row in machine.machine.transition_counts()}
    assert counts['A', 'B'] == 1 and counts['A', 'C'] == 1
    assert machine.rate('A').successes == 2


def test_an_end_changed_while_running_is_taken():
    def ends_otherwise(state, ud):
        machine._transitions['A']['ok'] = 'preempted'
        return 'ok'

    machine = chain_of(Scripted('ok', 'ok', ends_otherwise))
    wrapped = OracleContainer.wrap(machine)
    assert [wrapped.execute() for _ in range(4)] == ['done', 'done', 'preempted', 'preempted']


def test_keys_registered_late_are_seen():
    def write(state, ud):
        ud.late = 1
        return 'ok'

    state = Scripted('ok', write)
    machine = watched(state)
    machine.run()
    state.register_output_keys(['late'])
    machine.run()
    assert machine.machine.userdata.late == 1


@needs_constants
def test_constants_are_handed_to_the_state():
    seen = []
    machine = OracleContainer(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        OracleContainer.add(
            'A',
            Scripted(
                'aborted', lambda self, ud: seen.append((ud.x, ud.y)) or 'ok', input_keys=['x', 'y']
            ),
            {'ok': 'done'},
            constants={'x': 1},
        )
    machine.userdata.y = 2
    events = []
    machine.events.observers.append(events.append)
    assert machine.execute() == 'done'
    assert seen == [(1, 2)]
    assert [event.data['missing_keys'] for event in events if event.kind is EventKind.JUMP] == [[]]


def machine_with(*states):
    """A machine of (label, state, arguments of add) triples."""
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        for label, state, arguments in states:
            smach.StateMachine.add(label, state, **arguments)
    return machine


def remapped_constant(seen):
    """A state A that reads its n, the machine's constant `answer`, and changes it."""

    def read(state, ud):
        seen.append((ud.n, state.parent.userdata.answer))
        ud.n = -1
        return 'ok' if len(seen) > 2 else 'again'

    state = Scripted(
        read, read, read, outcomes=('ok', 'again', 'aborted'), input_keys=['n'], output_keys=['n']
    )
    machine = state.parent = machine_with(
        (
            'A',
            state,
            {
                'transitions': {'ok': 'B', 'again': 'A'},
                'remapping': {'n': 'answer'},
                'constants': {'answer': 42},
            },
        ),
        ('B', Scripted(), {'transitions': {'ok': 'done'}}),
    )
    return machine


@needs_constants
@pytest.mark.parametrize(
    'settings',
    [{}, {'states': {'A': {'time_limit_s': 20}}}, {'deep_copy_keys': ['answer']}],
    ids=str,
)
@pytest.mark.parametrize('recover', [True, False])
def test_constants_are_keys_of_the_machine_bare_and_wrapped(settings, recover):
    seen, wrapped_seen = [], []
    bare, wrapped = remapped_constant(seen), remapped_constant(wrapped_seen)
    OracleContainer.wrap(wrapped, settings=settings, recover=recover)
    assert bare.execute() == wrapped.execute() == 'done'
    assert seen == wrapped_seen == [(42, 42)] * 3
    assert contents(bare.userdata) == contents(wrapped.userdata) == {'answer': -1}


@needs_constants
def test_constants_exchanged_between_visits_count():
    seen = []
    machine = OracleContainer.wrap(
        machine_with(
            (
                'A',
                Scripted(*[lambda state, ud: seen.append(ud.x) or 'ok'] * 2, input_keys=['x']),
                {'transitions': {'ok': 'done'}},
            )
        )
    )
    for value in (1, 2):
        machine._constants['A'] = {'x': value}
        machine.execute()
    assert seen == [1, 2]


def test_machines_of_an_engine_without_constants_run_too():
    machine = chain_of(Scripted('aborted'))
    if '_constants' in machine.__dict__:
        del machine._constants
    OracleContainer.wrap(machine)
    assert machine.execute() == 'done'
    assert not OracleContainer._constants, 'which all machines would share'


@needs_constants
def test_constants_that_cannot_be_written_fail_the_state():
    machine = OracleContainer.wrap(
        machine_with(('A', Scripted(), {'transitions': {'ok': 'done'}, 'constants': ['x']})),
        settings={'max_recoveries': 1},
    )
    with pytest.raises(smach.InvalidUserCodeError, match='items'):
        machine.execute()
    assert machine.rates()[0].failures > 0 and not machine.is_running()


@needs_constants
def test_a_precondition_gets_the_constants_of_its_state():
    seen = []
    look = Scripted('ok', lambda state, ud: seen.append(ud.mode) or 'ok', input_keys=['mode'])
    machine = OracleContainer.wrap(
        machine_with(
            ('LOOK', look, {'transitions': {'ok': 'GRASP'}, 'constants': {'mode': 'far'}}),
            (
                'GRASP',
                Scripted(
                    lambda state, ud: setattr(ud, 'mode', 'near') or 'aborted', output_keys=['mode']
                ),
                {'transitions': {'ok': 'done'}},
            ),
        ),
        settings={'policy': 'prose', 'states': {'GRASP': {'preconditions': ['LOOK']}}},
    )
    assert machine.execute() == 'done'
    assert seen == ['far'] and machine.userdata.mode == 'far'


@needs_constants
def test_constants_of_a_precondition_that_is_not_met_are_taken_back():
    machine = OracleContainer.wrap(
        machine_with(
            (
                'LOOK',
                Scripted('ok', 'aborted'),
                {'transitions': {'ok': 'GRASP'}, 'constants': {'mode': 'far'}},
            ),
            (
                'GRASP',
                Scripted(
                    lambda state, ud: setattr(ud, 'mode', 'near') or 'aborted',
                    lambda state, ud: ud.mode == 'near' and 'ok',
                    input_keys=['mode'],
                    output_keys=['mode'],
                ),
                {'transitions': {'ok': 'done'}},
            ),
        ),
        settings={
            'userdata': 'keep',
            'states': {'GRASP': {'preconditions': ['LOOK'], 'prior': 0.5, 'memory': 100}},
        },
        expert=FakeExpert(goto('GRASP')),
    )
    assert machine.execute() == 'done' and machine.userdata.mode == 'near'


@needs_constants
def test_a_question_shows_constants_by_the_names_of_the_state():
    expert = FakeExpert(supersede('ok'))
    machine = OracleContainer.wrap(
        machine_with(
            (
                'A',
                Scripted('aborted', input_keys=['n']),
                {
                    'transitions': {'ok': 'B'},
                    'remapping': {'n': 'answer'},
                    'constants': {'answer': 42, 'beside': 1},
                },
            ),
            (
                'B',
                Scripted(input_keys=['m']),
                {
                    'transitions': {'ok': 'done'},
                    'remapping': {'m': 'later'},
                    'constants': {'later': 3},
                },
            ),
        ),
        settings={'max_recoveries': 0},
        expert=expert,
    )
    assert machine.execute() == 'done'
    (question,) = expert.questions
    assert question.input_userdata == {'n': 42}
    assert {choice.state: choice.missing_keys for choice in question.choices} == {'A': (), 'B': ()}


def test_a_machine_that_could_not_be_wrapped_is_as_it_was():
    inner = chain_of(Scripted())
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'done'})
    with pytest.raises(SettingsError):
        OracleContainer.wrap(machine, preconditions={'INNER': ['NOWHERE']})
    assert type(machine) is smach.StateMachine and type(inner) is smach.StateMachine
    assert list(machine.get_children()) == ['INNER'] and list(inner.get_children()) == ['A']
    assert not hasattr(machine, '_oracle')
    assert machine.execute() == 'done'


def test_new_settings_that_do_not_fit_leave_the_old_ones():
    machine = OracleContainer.wrap(chain_of(Scripted('aborted')), settings={'memory': 7})
    with pytest.raises(SettingsError):
        OracleContainer.wrap(machine, settings={'states': {'GHOST': {'memory': 3}}})
    assert machine.settings.defaults.memory == 7
    assert machine.execute() == 'done'


class OwnLoop(smach.StateMachine):
    """Takes five steps at most."""

    def execute(self, ud=None):
        with self._state_transitioning_lock:
            self._is_running = True
            self._set_current_state(self._initial_state_label)
            for _ in range(5):
                outcome = self._update_once()
                if outcome is not None:
                    break
            self._is_running = False
        return outcome or 'paused'


@pytest.mark.parametrize('wrap', [lambda machine: machine, OracleContainer.wrap])
def test_a_machine_with_a_loop_of_its_own_takes_one_step_at_a_time(wrap):
    state = Scripted(*['again'] * 50, outcomes=['again'])
    machine = OwnLoop(outcomes=['paused'])
    with machine:
        smach.StateMachine.add('A', state, {'again': 'A'})
    assert wrap(machine).execute() == 'paused'
    assert state.runs == 5


def test_what_was_learned_stays_under_other_settings():
    machine = watched(Scripted('aborted'))
    assert machine.run() == 'done'
    OracleContainer.wrap(machine.machine, settings={'memory': 3, 'prior': 0.2})
    row = machine.rate('A')
    assert (row.successes, row.failures) == (1, 1)


def test_what_a_machine_learned_below_one_stays_below_another_that_is_wrapped_again():
    inner, first, other = chain_of(Scripted(*['aborted'] * 9)), chain_of(), chain_of()
    settings = {'memory': 50, 'max_recoveries': 50}
    with first:
        smach.StateMachine.add('INNER', inner, {'done': 'done'})
    assert OracleContainer.wrap(first, settings=settings).execute() == 'done'
    rate = first.rates()[-1].rate
    OracleContainer.wrap(other, settings={'memory': 3})
    with other:
        smach.StateMachine.add('INNER', inner, {'done': 'done'})
    OracleContainer.wrap(other, settings=settings)
    assert other.rates()[-1].rate == rate


def test_a_jump_into_a_machine_arrives_though_it_was_wrapped_again_on_the_way():
    def wrap_again(event):
        if event.kind is EventKind.JUMP:
            OracleContainer.wrap(machine.machine, settings={'memory': 5})

    states = {'PICK': chain(B=Scripted(), C=Scripted()), 'PLACE': Scripted('aborted')}
    expert, settings = FakeExpert(goto('C', container='TOP/PICK')), {'max_recoveries': 0}
    machine = Watched(chain(**states), name='TOP', expert=expert, settings=settings)
    machine.machine.events.observers.append(wrap_again)
    assert machine.run() == 'done'
    assert machine.visits() == ['PICK', 'B', 'C', 'PLACE', 'PICK', 'C', 'PLACE']


@pytest.mark.parametrize('outer_has', [False, True])
def test_a_machine_that_comes_below_another_brings_what_that_one_has_not(outer_has):
    said, inners = [], FakeExpert(supersede('ok'))

    def health(who):
        return lambda: said.append(who) is None

    inner = OracleContainer.wrap(
        chain_of(Scripted('aborted')),
        settings={'policy': 'always_ask', 'healthy': {'settle_s': 0.0}},
        expert=inners,
        health=health('inner'),
    )
    outer = smach.StateMachine(['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add('INNER', inner)
    given = dict(expert=FakeExpert(supersede('ok')), health=health('outer'))
    OracleContainer.wrap(outer, **(given if outer_has else {}))
    assert outer.execute() == 'done'
    assert set(said) == {'outer' if outer_has else 'inner'}
    assert len(outer.expert.questions) == 1
    assert (outer.expert is inners) != outer_has
