"""Wrapped machines that are changed afterwards, and machines that cannot be wrapped."""

import pytest
from machines import Scripted, chain_of, watched

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind


def test_a_transition_changed_while_running_is_taken_and_counted():
    machine = watched(Scripted(), Scripted(), Scripted())
    machine.run()
    machine.machine._transitions['A']['ok'] = 'C'
    machine.run()
    assert machine.visits() == ['A', 'B', 'C', 'A', 'C']
    counts = {(row.state, row.to): row.count for row in machine.machine.transition_counts()}
    assert counts['A', 'B'] == 1 and counts['A', 'C'] == 1
    assert machine.rate('A').successes == 2


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


def test_constants_are_handed_to_the_state():
    import inspect
    if 'constants' not in inspect.signature(smach.StateMachine.add).parameters:
        pytest.skip('this engine has no constants')
    seen = []
    machine = OracleContainer(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        OracleContainer.add(
            'A',
            Scripted('aborted', lambda self, ud: seen.append((ud.x, ud.y)) or 'ok',
                     input_keys=['x', 'y']), {'ok': 'done'}, constants={'x': 1})
    machine.userdata.y = 2
    events = []
    machine.events.observers.append(events.append)
    assert machine.execute() == 'done'
    assert seen == [(1, 2)]
    assert [event.data['missing_keys'] for event in events if event.kind is EventKind.JUMP] == [[]]


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
