"""The wrapped machine is the script's own object, and stays usable as any state machine is."""

import copy
import pickle

import pytest
from machines import (
    OUTCOMES,
    FakeExpert,
    Scripted,
    Watched,
    chain_of,
    give_up,
    goto,
    supersede,
    watched,
)

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.errors import OracleError, SettingsError, TrialError
from smach_oracle.oracle.records.events import EventKind


class PlainState(smach.State):
    """Picklable; fails at its first visit."""

    def __init__(self):
        smach.State.__init__(self, outcomes=list(OUTCOMES))
        self.runs = 0

    def execute(self, ud):
        self.runs += 1
        return 'aborted' if self.runs == 1 else 'ok'


class OwnMachine(smach.StateMachine):
    """A subclass that overrides what people override."""

    def __init__(self):
        smach.StateMachine.__init__(self, outcomes=['done', 'aborted', 'preempted'])
        self.calls = []

    def execute(self, parent_ud=None):
        self.calls.append('execute')
        return smach.StateMachine.execute(self, parent_ud)

    def request_preempt(self):
        self.calls.append('request_preempt')
        smach.StateMachine.request_preempt(self)

    @staticmethod
    def add(label, state, transitions=None, remapping=None):
        state.added_by_own = True
        return smach.StateMachine.add(label, state, transitions, remapping)


def reachable(edges, start):
    found, waiting = set(), [start]
    while waiting:
        state = waiting.pop()
        if state not in found:
            found.add(state)
            waiting += [to for _, origin, to in edges if origin == state]
    return found


def test_the_scripts_handle_is_the_wrapped_machine():
    machine = chain_of(Scripted('aborted'), input_keys=['x'], output_keys=['x'])
    machine.userdata.x = 1
    assert OracleContainer.wrap(machine) is machine
    assert isinstance(machine, smach.StateMachine)
    parent = smach.UserData()
    parent.x = 5
    assert machine.execute(parent) == 'done'
    assert machine.userdata.x == 5


def test_every_state_is_reachable_from_every_other():
    machine = chain_of(Scripted(), Scripted(), Scripted(), Scripted())
    before = machine.get_internal_edges()
    assert 'A' not in reachable(before, 'D')
    OracleContainer.wrap(machine)
    edges = machine.get_internal_edges()
    for label in machine.get_children():
        assert set(machine.get_children()) <= reachable(edges, label)


def test_the_viewer_sees_n_edges_to_the_oracle_and_one_from_it_to_every_state_and_outcome():
    machine = OracleContainer.wrap(chain_of(Scripted(), Scripted(), Scripted()))
    edges = machine.get_internal_edges()
    assert [(edge[0], edge[1]) for edge in edges if edge[2] == 'ORACLE'] == [
        ('failure', 'A'),
        ('failure', 'B'),
        ('failure', 'C'),
    ]
    assert {edge[2] for edge in edges if edge[1] == 'ORACLE'} == {
        'A',
        'B',
        'C',
        'done',
        'aborted',
        'preempted',
    }
    assert list(machine.get_children()) == ['A', 'B', 'C', 'ORACLE']


def test_oracle_is_the_active_state_while_it_works_and_callbacks_see_it():
    seen, active = [], []
    machine = chain_of(Scripted('aborted'), Scripted())
    machine.register_transition_cb(lambda ud, labels: seen.append(labels))
    machine.register_start_cb(lambda ud, labels: seen.append(('start', labels)))
    machine.register_termination_cb(
        lambda ud, labels, outcome: seen.append(('end', labels, outcome))
    )
    OracleContainer.wrap(
        machine,
        preconditions={'A': [lambda ud: active.append(machine.get_active_states()) or True]},
    )
    assert machine.execute() == 'done'
    assert active == [['ORACLE']]
    assert seen == [('start', ['A']), ['ORACLE'], ['A'], ['B'], ('end', ['B'], 'done')]


def test_termination_callbacks_see_the_state_that_failed_where_the_oracle_ends_the_machine():
    seen = []
    machine = watched(Scripted('aborted'), settings={'max_recoveries': 0}).machine
    machine.register_termination_cb(lambda ud, labels, outcome: seen.append((labels, outcome)))
    assert machine.execute() == 'aborted'
    assert seen == [(['A'], 'aborted')]


def test_a_state_added_after_wrapping_is_under_the_oracle():
    machine = watched(Scripted())
    with machine.machine:
        smach.StateMachine.add('NEW', Scripted('aborted'), {'ok': 'done'})
    machine.machine.set_initial_state(['NEW'])
    assert ('failure', 'NEW', 'ORACLE') in machine.machine.get_internal_edges()
    assert 'NEW' in {
        edge[2] for edge in machine.machine.get_internal_edges() if edge[1] == 'ORACLE'
    }
    assert machine.run() == 'done'
    assert machine.decisions() == [('revisit', 'NEW')]


def test_an_outcome_registered_after_wrapping_is_among_the_oracles():
    machine = watched(Scripted()).machine
    machine.register_outcomes(['late'])
    assert 'late' in {edge[2] for edge in machine.get_internal_edges() if edge[1] == 'ORACLE'}


def test_a_state_exchanged_for_another_is_exchanged_among_the_oracles():
    machine = watched(Scripted(), Scripted())
    for table in (machine.machine._states, machine.machine._transitions):
        del table['B']
    with machine.machine:
        smach.StateMachine.add('NEW', Scripted('aborted'), {'ok': 'done'})
    machine.machine._transitions['A']['ok'] = 'NEW'
    assert machine.run() == 'done'
    assert {edge[2] for edge in machine.machine.get_internal_edges() if edge[1] == 'ORACLE'} >= {
        'A',
        'NEW',
        'done',
    }


def test_a_machine_filled_after_wrapping_begins_where_it_should():
    machine = OracleContainer.wrap(smach.StateMachine(outcomes=['done', 'aborted']))
    with machine:
        smach.StateMachine.add('FIRST', Scripted(outcomes=('ok',)), {'ok': 'done'})
    assert machine.get_initial_states() == ['FIRST']
    assert machine.execute() == 'done'


def test_a_state_of_the_scripts_named_oracle_is_refused_with_the_way_out():
    machine = smach.StateMachine(outcomes=['done'])
    with machine:
        smach.StateMachine.add('ORACLE', Scripted(outcomes=('ok',)), {'ok': 'done'})
    with pytest.raises(SettingsError, match='oracle_label'):
        OracleContainer.wrap(machine)
    assert OracleContainer.wrap(machine, settings={'oracle_label': 'RECOVERY'}).execute() == 'done'


def test_a_container_outcome_named_oracle_is_refused():
    machine = chain_of(Scripted(), outcomes=('done', 'aborted', 'preempted', 'ORACLE'))
    with pytest.raises(SettingsError, match='oracle_label'):
        OracleContainer.wrap(machine)


def test_a_state_named_as_an_outcome_of_the_container_is_a_state():
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', Scripted('aborted'), {'ok': 'done'})
        smach.StateMachine.add('done', Scripted(outcomes=('ok',)), {'ok': 'aborted'})
    OracleContainer.wrap(machine)
    from_oracle = [edge[2] for edge in machine.get_internal_edges() if edge[1] == 'ORACLE']
    assert sorted(from_oracle) == ['A', 'aborted', 'done', 'preempted']


@pytest.mark.parametrize('initial', [['ORACLE'], 'ORACLE', ['B', 'ORACLE']])
def test_the_oracle_is_refused_as_where_a_machine_begins(initial):
    machine = watched(Scripted(), Scripted()).machine
    given = smach.UserData()
    given.x = 1
    with pytest.raises(smach.InvalidStateError, match='ORACLE'):
        machine.set_initial_state(initial, given)
    assert machine.get_initial_states() == ['A']
    assert 'x' not in machine.userdata
    assert machine.execute() == 'done'


def test_a_machine_may_begin_at_any_other_state():
    machine = watched(Scripted(), Scripted())
    machine.machine.set_initial_state(['B'])
    assert machine.run() == 'done'
    assert machine.visits() == ['B']


@pytest.mark.parametrize(
    'end, answer, to',
    [
        ('aborted', supersede('ok'), 'ok'),
        ('aborted', goto('B'), 'B'),
        ('aborted', give_up('done'), 'done'),
        ('aborted', give_up(), 'aborted'),
        ('odd', give_up(), 'B'),
        ('aborted', give_up('done', container='SM_ROOT'), ''),
        ('aborted', goto('IN', container='SM_ROOT'), ''),
    ],
)
def test_a_tool_that_hooks_the_execution_of_states_sees_that_of_the_meta_state(end, answer, to):
    inner = smach.StateMachine(['done', 'aborted'])
    with inner:
        a = Scripted(end, outcomes=('ok', 'aborted', 'odd'))
        smach.StateMachine.add('A', a, {'ok': 'done', 'odd': 'B'})
        smach.StateMachine.add('B', Scripted(outcomes=('ok',)), {'ok': 'done'})
    outer = smach.StateMachine(['done', 'aborted'])
    with outer:
        smach.StateMachine.add('IN', inner)
    settings = {'author_recoveries': 'override', 'prior': 1.0, 'failure_outcomes': ['odd']}
    machine = Watched(outer, expert=FakeExpert(answer), settings=settings)
    meta, seen = inner.get_children()['ORACLE'], []
    execute = meta.execute

    def hooked(ud):
        outcome = execute(ud)
        seen.append((ud is inner.userdata, outcome))
        return outcome

    meta.execute = hooked
    machine.run()
    assert seen == [(True, to)]


def test_the_meta_state_executes_for_a_failure_alone():
    machine = watched(Scripted('aborted'), settings={'states': {'A': {'prior': 1.0}}})
    meta = machine.machine.get_children()['ORACLE']
    with pytest.raises(TrialError, match='by failures alone'):
        meta.execute(smach.UserData())
    meta.execute = lambda ud: 'ok'
    with pytest.raises(TrialError, match='without a recovery'):
        machine.run()


def test_a_subclass_keeps_its_own_methods():
    machine = OwnMachine()
    with machine:
        machine.add('A', Scripted('aborted'), {'ok': 'done'})
    wrapped = Watched(machine)
    assert isinstance(machine, OwnMachine) and isinstance(machine, OracleContainer)
    with machine:
        machine.add('B', Scripted(), {'ok': 'done'})
    assert machine['B'].added_by_own
    assert wrapped.run() == 'done'
    machine.request_preempt()
    assert machine.calls == ['execute', 'request_preempt']
    assert len(wrapped.of(EventKind.FAILURE)) == 1


def test_a_subclass_that_runs_its_machine_twice_in_one_execute():
    class Twice(smach.StateMachine):
        def execute(self, parent_ud=None):
            smach.StateMachine.execute(self, parent_ud)
            return smach.StateMachine.execute(self, parent_ud)

    machine = Watched(chain_of(Scripted('aborted', 'ok', 'aborted', 'ok'), machine_class=Twice))
    assert machine.run() == 'done'
    assert machine.visits() == ['A'] * 4


@pytest.mark.parametrize(
    'name', ['execute', 'request_preempt', 'check_consistency', 'get_children']
)
def test_patched_class_attributes_are_respected(monkeypatch, name):
    calls = []
    real = getattr(smach.StateMachine, name)

    def patched(self, *args, **kwargs):
        calls.append(name)
        return real(self, *args, **kwargs)

    machine = watched(Scripted('aborted')).machine
    monkeypatch.setattr(smach.StateMachine, name, patched)
    machine.execute()
    machine.request_preempt()
    machine.get_children()
    assert calls


def test_a_patched_transition_callback_caller_is_called(monkeypatch):
    calls = []
    real = smach.Container.call_transition_cbs
    monkeypatch.setattr(
        smach.Container, 'call_transition_cbs', lambda self: calls.append(1) or real(self)
    )
    watched(Scripted(), Scripted(), Scripted()).run()
    assert len(calls) == 2


def test_wrapping_again_gives_new_settings_and_keeps_what_was_learned():
    machine = chain_of(Scripted('aborted'))
    OracleContainer.wrap(machine).execute()
    cls = type(machine)
    again = OracleContainer.wrap(
        machine, settings={'max_recoveries': 3, 'memory': 4, 'oracle_label': 'HELP'}
    )
    assert again is machine and type(machine) is cls
    assert machine.settings.defaults.max_recoveries == 3
    assert (machine.rates()[0].failures, machine.rates()[0].successes) == (1, 1)
    assert list(machine.get_children()) == ['A', 'HELP']


def test_recovery_can_be_switched_off_again():
    machine = OracleContainer.wrap(chain_of(Scripted('aborted', 'aborted')))
    OracleContainer.wrap(machine, recover=False)
    assert 'ORACLE' not in machine.get_children()
    assert machine.execute() == 'aborted'


def test_classes_are_made_once_for_each_pair():
    assert type(watched(Scripted()).machine) is type(watched(Scripted()).machine)


def test_what_is_no_state_machine_is_refused():
    with pytest.raises(SettingsError, match='a smach.StateMachine'):
        OracleContainer.wrap(Scripted())
    with pytest.raises(OracleError):
        OracleContainer.wrap(smach.Concurrence(outcomes=['a'], default_outcome='a'))


def test_a_wrapped_machine_is_executed_again_and_again():
    machine = watched(Scripted('aborted'), Scripted())
    ids = set()
    for _ in range(50):
        assert machine.run() == 'done'
        ids.add(machine.machine.trial_id)
    assert len(ids) == 50
    assert [
        event.seq for event in machine.events if event.trial_id == machine.machine.trial_id
    ] == list(
        range(
            len([event for event in machine.events if event.trial_id == machine.machine.trial_id])
        )
    )
    assert machine.rate('A').successes == 50


@pytest.mark.parametrize(
    'duplicate',
    [copy.deepcopy, lambda machine: pickle.loads(pickle.dumps(machine)), copy.copy],
    ids=['deepcopy', 'pickle', 'copy'],
)
def test_a_copy_of_a_wrapped_machine_is_a_wrapped_machine(duplicate):
    machine = chain_of(PlainState(), PlainState())
    OracleContainer.wrap(
        machine,
        preconditions={'B': ['A']},
        settings={'memory': 7},
        expert=FakeExpert(supersede('ok')),
    )
    try:
        twin = duplicate(machine)
    except TypeError as err:
        if 'lock' in str(err):
            pytest.skip('this engine cannot copy machines: {}'.format(err))
        raise
    assert type(twin) is type(machine) and twin is not machine
    assert twin.settings.defaults.memory == 7
    assert twin.execute() == 'done'
    assert {row.state: row.failures for row in twin.rates()} == {'A': 1, 'B': 1}
    assert {row.state: row.failures for row in machine.rates()} == {'A': 0, 'B': 0}
    assert list(twin.get_children()) == ['A', 'B', 'ORACLE']


def test_a_copy_made_after_a_run_brings_what_was_learned():
    machine = chain_of(PlainState())
    OracleContainer.wrap(machine).execute()
    twin = pickle.loads(pickle.dumps(machine))
    assert twin.rates() == machine.rates()
    assert twin.transition_counts() == machine.transition_counts()


def test_it_is_built_like_any_machine():
    machine = OracleContainer(
        outcomes=['done', 'aborted', 'preempted'],
        input_keys=['x'],
        output_keys=['y'],
        name='TOP',
        settings={'policy': 'algorithm1'},
    )
    with machine:
        OracleContainer.add('A', Scripted(), {'ok': 'B'})
        OracleContainer.add('B', Scripted('aborted'), {'ok': 'done'}, prior=0.2)
    assert machine.path == 'TOP'
    assert {row.state: row.rate for row in machine.rates()}['B'] == pytest.approx(0.2)
    assert machine.execute() == 'done'


def test_settings_of_a_state_need_an_oracle_container():
    machine = smach.StateMachine(outcomes=['done'])
    with pytest.raises(SettingsError, match='OracleContainer'):
        with machine:
            OracleContainer.add('A', Scripted(outcomes=('ok',)), {'ok': 'done'}, prior=0.2)


def test_settings_of_a_state_that_it_lacks_are_refused_as_of_a_wrapped_machine():
    machine = OracleContainer(['done'], settings={'states': {'NOWHERE': {'prior': 0.2}}})
    with machine:
        smach.StateMachine.add('A', Scripted(outcomes=('ok',)), {'ok': 'done'})
    with pytest.raises(SettingsError, match='NOWHERE'):
        machine.execute()


def test_a_prior_out_of_range_is_refused_where_it_is_given():
    machine = OracleContainer(outcomes=['done'])
    with pytest.raises(SettingsError, match='states.A.prior: 2'):
        with machine:
            OracleContainer.add('A', Scripted(outcomes=('ok',)), {'ok': 'done'}, prior=2)


def test_an_observer_that_raises_stops_nothing(log):
    machine = watched(Scripted(), Scripted()).machine

    def broken(event):
        raise RuntimeError('observer')

    machine.events.observers.append(broken)
    assert machine.execute() == 'done'
    assert any('observer' in text for level, text in log if level == 'err')


def test_transitions_are_counted():
    machine = watched(Scripted('aborted'), Scripted())
    for _ in range(3):
        machine.run()
    counts = {
        (row.state, row.outcome, row.to): row.count for row in machine.machine.transition_counts()
    }
    assert counts == {
        ('A', 'aborted', 'ORACLE'): 1,
        ('ORACLE', 'A', 'A'): 1,
        ('A', 'ok', 'B'): 3,
        ('B', 'ok', 'done'): 3,
    }


def test_it_logs_what_it_logs_without_an_oracle_in_every_trial(log):
    """Also where it has come the same way before."""
    bare, machine = chain_of(Scripted(), Scripted()), chain_of(Scripted(), Scripted())
    OracleContainer.wrap(machine)
    trials = []
    for each in (bare, machine, machine):
        del log[:]
        assert each.execute() == 'done'
        trials.append([line for line in log if line[1].startswith('State machine')])
    assert len(trials[0]) == 3
    assert trials[1:] == [trials[0]] * 2


@pytest.mark.parametrize(
    'argument, value, allowed',
    [
        ('name', None, 'a string'),
        ('name', 5, 'a string'),
        ('expert', 'eva', 'an Expert, or None'),
        ('expert', object, 'an Expert, or None'),
        ('recover', 'no way', 'true or false'),
        ('recover', None, 'true or false'),
        ('strict', 'perhaps', 'true or false'),
        ('health', 'ok', 'a function, or None'),
    ],
)
def test_wrong_arguments_are_refused_before_anything_is_changed(argument, value, allowed):
    machine = chain_of(Scripted())
    with pytest.raises(SettingsError, match='{}: .* allowed: {}'.format(argument, allowed)):
        OracleContainer.wrap(machine, **{argument: value})
    assert type(machine) is smach.StateMachine and 'ORACLE' not in machine.get_children()
    with pytest.raises(SettingsError, match='{}: .* allowed: {}'.format(argument, allowed)):
        OracleContainer(['done'], **{argument: value})
