"""What a command on the init topic may set."""

import pytest

import smach
from smach_oracle.oracle import OracleContainer

pytest.importorskip('rospy')
from smach_common.introspection.container_watch import ContainerWatch
from smach_common.introspection.introspection_server import set_initial_states


def wrapped_machine():
    machine = smach.StateMachine(outcomes=['done', 'aborted'])
    with machine:
        smach.StateMachine.add('A', smach.CBState(lambda ud: 'ok', outcomes=['ok']), {'ok': 'B'})
        smach.StateMachine.add('B', smach.CBState(lambda ud: 'ok', outcomes=['ok']), {'ok': 'done'})
    return OracleContainer.wrap(machine)


def test_oracle_is_refused_and_the_log_says_why(monkeypatch):
    told = []
    monkeypatch.setattr(smach, 'logerr', told.append)
    machine = wrapped_machine()
    machine.get_children()  # ORACLE is among them
    watch = ContainerWatch(machine, lambda *args: None, lambda: False)
    assert set_initial_states(watch, ['ORACLE'], {'x': 1}) is False
    assert watch.jump_to is None
    assert any('ORACLE' in text for text in told)
    assert 'x' not in machine.userdata
    assert machine.execute() == 'done'


def test_another_state_is_where_the_machine_begins():
    machine = wrapped_machine()
    watch = ContainerWatch(machine, lambda *args: None, lambda: False)
    assert set_initial_states(watch, ['B'], {'x': 1}) is True
    assert machine.get_initial_states() == ['B']
    assert machine.userdata.x == 1
