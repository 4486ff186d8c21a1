"""What adapters and operators ask of a machine, and tell it, from outside."""

import copy
import inspect

import pytest
from forked import in_a_fork
from guarded_machines import chain
from held_machines import Gate, Held
from machines import FakeExpert, Scripted, Watched, chain_of, give_up, goto, supersede, watched
from reporting_machines import reporting

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.errors import SettingsError, TrialError
from smach_oracle.oracle.machine.tree_node import marked_node
from smach_oracle.oracle.operator_hand import OperatorHand
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.facts import told_in_words
from smach_oracle.oracle.scope.clock import Clock, PausableClock
from smach_oracle.oracle.scope.scope import Reason, Scope


def warnings_in(log):
    return [text for level, text in log if level == 'warn']


def test_tools_can_look_at_all_members_of_the_class():
    assert dict(inspect.getmembers(OracleContainer))['settings'] is OracleContainer.settings


def test_a_bare_machine_has_no_oracle_and_no_hand():
    for make in (oracle_of, OperatorHand):
        with pytest.raises(TrialError, match='is not under an oracle'):
            make(chain_of(Scripted()))


def test_a_machine_without_a_name_may_take_one():
    machine = watched(Scripted('aborted'))
    oracle = oracle_of(machine.machine)
    assert (oracle.is_named, oracle.name) == (False, 'SM_ROOT')
    oracle.take_name('task')
    assert oracle.is_named
    machine.run()
    assert {event.path for event in machine.events} == {'task'}
    assert oracle_of(OracleContainer.wrap(chain_of(Scripted()), name='other')).is_named
    assert not oracle.is_parents


def test_health_may_be_set_between_two_trials():
    oracle = oracle_of(watched(Scripted()).machine)
    assert oracle.health is None
    oracle.health = print
    assert oracle.health is print


def test_a_state_is_asked_what_it_knows_of_its_failure():
    state = Scripted('aborted', 'aborted')
    machine = watched(state)
    oracle = oracle_of(machine.machine)
    assert oracle.describe_failure(state) == ''
    oracle.describe_failure = lambda failed: 'the gripper is empty' if failed is state else ''
    machine.run()
    assert machine.of(EventKind.FAILURE)[0].text == 'the gripper is empty'


class Deaf(smach.StateMachine):
    """A user's machine that cannot be preempted."""

    def request_preempt(self):
        raise OSError('the line is dead')


def test_a_machine_whose_own_preempt_fails_says_so_to_the_operator():
    gate = Gate()
    with Held(chain_of(Scripted(gate), machine_class=Deaf)).begin() as held:
        assert gate.entered.wait(20)
        assert held.hand.preempt('eva') == (
            "SM_ROOT is asked to stop, and its request_preempt failed: OSError('the line is dead')"
        )
        gate.opened.set()
        assert held.end() == 'done'


def test_a_viewer_that_hears_no_answer_is_refused_in_the_log(log):
    gate, last = Gate(), Scripted()
    with Held(chain_of(Scripted(gate), last)).begin() as held:
        assert gate.entered.wait(20)
        assert not held.hand.send('NOWHERE', '')
        assert held.hand.send('B', 'viewer')
        gate.opened.set()
        assert held.end() == 'done'
    (refused,) = warnings_in(log)
    assert 'is not sent to NOWHERE as a viewer wants: ' in refused


def test_a_state_in_which_a_viewer_has_a_machine_begin_is_asked_about():
    """Its author leads to INNER again. Between the two, a viewer has it begin in B."""
    pour = Scripted()
    inner = chain_of(Scripted(), pour)

    def viewer(state, ud):
        OperatorHand(inner).begins_in('B')
        inner.set_initial_state(['B'])
        return 'again'

    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'LOOK'})
        look = Scripted(viewer, outcomes=('ok', 'again', 'aborted'))
        smach.StateMachine.add('LOOK', look, {'again': 'INNER', 'ok': 'done'})
    expert = FakeExpert(goto('LOOK', container='SM_ROOT'))
    machine = Watched(
        machine, expert=expert, settings={'states': {'INNER/B': {'on_retry': 'confirm'}}}
    )
    assert machine.run() == 'done'
    assert (pour.runs, [question.failed_state for question in expert.questions]) == (1, ['B'])


def test_the_data_of_an_event_that_is_none_tell_nothing():
    assert told_in_words(None) == {}
    assert told_in_words({'jumped_to': 3, 'decided_by': 'policy', 'other': 'x'}) == {
        'decided_by': 'policy'
    }


def test_what_cannot_be_wrapped_stays_bare():
    inner, machine = chain_of(Scripted()), chain_of(Scripted())
    with machine:
        smach.StateMachine.add('INNER', inner)
    smach.StateMachine.set_initial_state(machine, ['A'])
    before = type(machine), type(inner), set(vars(machine))
    with pytest.raises(SettingsError, match='nested'):
        OracleContainer.wrap(machine, settings={'nested': ['NO/SUCH']})
    assert (type(machine), type(inner), set(vars(machine))) == before
    assert machine.execute() == 'done'


@pytest.mark.parametrize('nested, has', [(True, True), (False, False), (['OTHER'], False)])
def test_what_is_nested_in_a_machine_that_is_built_has_an_oracle_as_the_setting_says(nested, has):
    built = OracleContainer(['done', 'aborted', 'preempted'], settings={'nested': nested})
    inner, other = chain_of(Scripted()), chain_of(Scripted())
    with built:
        smach.StateMachine.add('INNER', inner)
        smach.StateMachine.add('OTHER', other)
    assert built.execute() == 'done'
    assert ('ORACLE' in inner.get_children()) is has
    assert ('ORACLE' in other.get_children()) is bool(nested)


def test_whether_nested_machines_have_oracles_is_said_best_where_one_is_wrapped():
    inner, machine = chain_of(Scripted()), smach.StateMachine(['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('INNER', inner)
    OracleContainer.wrap(machine, nested=False, settings={'nested': True})
    assert type(inner) is smach.StateMachine
    OracleContainer.wrap(machine, nested=True, settings={'nested': False})
    assert isinstance(inner, OracleContainer)


@pytest.mark.parametrize('strict', [True, False])
def test_a_machine_that_is_built_may_have_names_in_its_settings_that_no_state_has(strict, log):
    built = OracleContainer(
        ['done', 'aborted', 'preempted'], settings={'states': {'NO': {}}}, strict=strict
    )
    with built:
        smach.StateMachine.add('A', Scripted(), {'ok': 'done'})
    if strict:
        with pytest.raises(SettingsError, match='states.NO'):
            built.execute()
    else:
        assert built.execute() == 'done'
        assert any('states.NO' in text for level, text in log if level == 'warn')


def test_a_state_that_is_not_there_is_complained_of_to_a_function():
    complaints = []
    OracleContainer.wrap(
        chain_of(Scripted()),
        settings={'on_no_answer': 'goto:NOWHERE', 'on_resume': 'state:GONE'},
        strict=complaints.append,
    )
    assert [(each.error.key, each.name) for each in complaints] == [
        ('expert.on_no_answer', 'NOWHERE'),
        ('checkpoint.on_resume', 'GONE'),
    ]


def test_an_outcome_that_none_of_the_states_meant_has_is_complained_of():
    complaints = []
    failing = {'A': {'failure_outcomes': ['preempted', 'ok']}, '**': {'intended_outcomes': []}}
    machine = chain_of(Scripted(outcomes=('ok', 'aborted')))
    OracleContainer.wrap(machine, settings={'states': failing}, strict=complaints.append)
    assert [(each.error.key, each.name) for each in complaints] == [
        ('states.A.failure_outcomes', 'preempted')
    ]
    complaints.clear()
    everywhere = {'failure_outcomes': ['preempted', 'nowhere']}  # the machine may be preempted
    OracleContainer.wrap(machine, settings=everywhere, strict=complaints.append)
    assert [each.name for each in complaints] == ['nowhere']


def test_where_nothing_recovers_a_state_may_be_called_as_the_meta_state_would_be():
    state = Scripted()
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('ORACLE', state, {'ok': 'done'})
    machine = Watched(machine, recover=False)
    assert [machine.run(), machine.run()] == ['done', 'done']
    assert len(machine.visits()) == 2 and machine.rate('ORACLE').successes == 2


def test_a_plain_success_is_told_to_who_registered_for_transitions():
    told = []
    machine = watched(Scripted(), Scripted(), Scripted())
    machine.machine.register_transition_cb(lambda userdata, active: told.append([*active]))
    for _ in range(3):  # from the second time on each takes the short way
        assert machine.run() == 'done'
    assert told == [['B'], ['C']] * 3


ASKS = {'policy': 'always_ask', 'author_recoveries': 'override'}


@pytest.mark.parametrize(
    'answer, ended',
    [
        (give_up(), [['B'], ['IN']]),
        (give_up('preempted'), [['B'], ['IN']]),
        (supersede('ok'), [['B'], ['IN']]),
        (goto('A', container='SM_ROOT'), [['B'], ['B'], ['IN']]),  # the container is left
    ],
)
def test_a_termination_callback_is_told_the_state_that_ran_last(answer, ended):
    inner, told = chain(B=Scripted('aborted', 'ok')), []
    machine = chain(A=Scripted(), IN=inner)
    for each in (inner, machine):
        each.register_termination_cb(lambda userdata, states, outcome: told.append([*states]))
    Watched(machine, expert=FakeExpert(answer), settings=ASKS).run()
    assert told == ended


@pytest.mark.parametrize('recover', [True, False])
def test_a_termination_callback_is_told_the_state_that_reports_a_failure(recover):
    told = []
    settings = {'policy': 'always_ask'}
    work = Scripted('failed', outcomes=('ok', 'failed'))
    machine = reporting(work, recover=recover, settings=settings)
    machine.machine.register_termination_cb(lambda userdata, *ended: told.append(ended))
    assert machine.run() == 'failed'
    assert told == [(['REPORT'], 'failed')]


# -- in a child process of the program


def test_in_a_child_process_a_machine_is_what_its_author_wrote(log):
    """Its nested machines, too. One that was built under an oracle is only observed there."""
    built = OracleContainer(['done', 'aborted', 'preempted'], name='built')
    failing = Scripted('aborted')
    with built:
        OracleContainer.add('A', failing, {'ok': 'done'})
    inner = chain_of(Scripted('aborted'))
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'done'})
    asked = FakeExpert()
    OracleContainer.wrap(machine, name='task', expert=asked)

    def in_child():
        assert oracle_of(machine).is_parents, 'it is asked before it runs'
        outcomes = machine.execute(), machine.execute(), built.execute()
        oracle = oracle_of(built)
        kinds = [type(each) is smach.StateMachine for each in (machine, inner)]
        return outcomes, kinds, (oracle.recovers, oracle.name), warnings_in(log)

    outcomes, kinds, told, warned = in_a_fork(in_child)
    assert outcomes == ('aborted', 'done', 'aborted'), 'INNER has succeeded once it was tried again'
    assert (kinds, told) == ([True, True], (False, 'built'))
    without = '{}: runs in a child process of the program, and without an oracle there'
    assert [text for text in warned if 'child process' in text] == [
        without.format('task'),
        without.format('built'),
    ]
    assert not oracle_of(machine).is_parents
    assert machine.execute() == 'done' and oracle_of(machine).recovers
    assert asked.questions == []


def test_a_machine_whose_state_has_forked_keeps_its_class_in_the_child():
    """It runs there, too: its outer execution is still to come to an end."""
    inside = []

    def fork_once(state, userdata):
        if not inside:
            inside.append(in_a_fork(lambda: (inside.append(None), run_again())[1]))
        return 'ok'

    def run_again():
        return machine.execute(), isinstance(machine, OracleContainer)

    machine = watched(Scripted(fork_once)).machine
    assert machine.execute() == 'done' and inside == [('done', True)]


def test_a_record_is_of_a_state_of_the_machine():
    machine = watched(Scripted()).machine
    node = marked_node(machine)
    with pytest.raises(smach.InvalidStateError, match="'NOWHERE' is no state of SM_ROOT"):
        node.record('NOWHERE')
    with pytest.raises(smach.InvalidStateError, match='ORACLE'):
        node.record('ORACLE')


@pytest.mark.parametrize('copied', [copy.copy, copy.deepcopy])
def test_nothing_that_is_under_way_travels_with_a_copy(copied):
    scope = Scope()
    scope.cancel(Reason.PREEMPTED)
    assert copied(scope).reason is None
    clock = PausableClock(Clock())
    assert type(copied(clock)) is PausableClock and copied(clock).now() > 0.0


@pytest.mark.parametrize(
    'fails, answer, returned',
    [
        ('aborted', goto('B'), 'B'),
        ('aborted', supersede('ok'), 'ok'),
        ('aborted', give_up('preempted'), 'preempted'),
        ('aborted', goto('A', container='SM_ROOT'), ''),  # the container is left
        (ValueError('slipped'), give_up(), ''),  # it raises
    ],
)
def test_the_meta_state_ends_with_what_the_machine_goes_by(fails, answer, returned):
    inner = chain(B=Scripted(fails, 'ok'))
    machine = Watched(
        chain(A=Scripted(), IN=inner), expert=FakeExpert(answer, goto('A')), settings=ASKS
    )
    meta = inner.get_children()['ORACLE']
    execute, ends = meta.execute, []
    meta.execute = lambda ud: ends.append(execute(ud)) or ends[-1]
    try:
        machine.run()
    except smach.InvalidUserCodeError:
        assert isinstance(fails, ValueError)
    assert ends == [returned]
