"""A machine comes out of its oracle as it went in."""

import pytest
from machines import FakeExpert, Scripted, chain_of, supersede

import smach
from smach_oracle.oracle import OracleContainer, oracle_of, unwrap
from smach_oracle.oracle.errors import TrialError


def machine_in_machine(*inner_script):
    inner = smach.StateMachine(outcomes=['ok', 'aborted', 'preempted'])
    with inner:
        smach.StateMachine.add('A', Scripted(*inner_script))
    return chain_of(inner), inner


def test_classes_and_states_are_those_of_before():
    machine, inner = machine_in_machine()
    states, transitions = list(machine._states), dict(machine._transitions)
    OracleContainer.wrap(machine)
    assert 'ORACLE' in machine.get_children()
    assert unwrap(machine) is machine
    assert type(machine) is smach.StateMachine and type(inner) is smach.StateMachine
    assert list(machine._states) == states and machine._transitions == transitions
    assert not hasattr(machine, '_oracle') and not hasattr(inner, '_oracle')


class OwnWay(smach.Concurrence):
    """Executes by itself, so that it asks no hook of the engine's."""

    def execute(self, *args):
        return smach.Concurrence.execute(self, *args)


def test_so_is_that_of_a_container_that_executes_by_itself():
    branches = OwnWay(outcomes=['done', 'aborted'], default_outcome='done')
    with branches:
        smach.Concurrence.add('A', Scripted())
    machine = smach.StateMachine(outcomes=['done', 'aborted'])
    with machine:
        smach.StateMachine.add('ALL', branches)
    OracleContainer.wrap(machine)
    assert type(branches) is not OwnWay
    assert unwrap(machine).execute() == 'done'
    assert type(branches) is OwnWay


def test_it_ends_as_its_author_wrote_it():
    machine, _ = machine_in_machine('aborted', 'aborted')
    OracleContainer.wrap(machine, expert=FakeExpert(supersede('ok'))).execute()
    unwrap(machine)
    machine['A']['A'].script = ['aborted']
    assert machine.execute() == 'aborted'


def test_it_can_be_wrapped_again_and_learns_anew():
    machine = chain_of(Scripted('aborted'))
    OracleContainer.wrap(machine).execute()
    OracleContainer.wrap(unwrap(machine))
    assert [(row.state, row.failures) for row in oracle_of(machine).rates()] == [('A', 0)]
    assert machine.execute() == 'done'


def test_a_machine_that_was_wrapped_on_its_own_stays_wrapped():
    machine, inner = machine_in_machine('aborted')
    OracleContainer.wrap(inner, name='INNER')
    OracleContainer.wrap(machine)
    unwrap(machine)
    assert type(machine) is smach.StateMachine
    assert oracle_of(inner).is_top and oracle_of(inner).path == 'INNER'
    assert inner.execute() == 'ok'


def test_such_a_machine_tells_the_observers_of_the_former_tree_nothing_more():
    machine, inner = machine_in_machine()
    OracleContainer.wrap(inner)
    told = []
    OracleContainer.wrap(machine).events.observers.append(told.append)
    unwrap(machine)
    assert inner.execute() == 'ok' and told == []


def test_what_was_not_wrapped_is_refused():
    machine, inner = machine_in_machine()
    with pytest.raises(TrialError, match='was not wrapped'):
        unwrap(machine)
    with pytest.raises(TrialError, match='was not wrapped'):
        unwrap(OracleContainer(['done']))
    OracleContainer.wrap(machine)
    with pytest.raises(TrialError, match='wrapped with SM_ROOT'):
        unwrap(inner)


def test_a_machine_that_runs_is_refused():
    refused = []

    def from_inside(state, ud):
        with pytest.raises(TrialError, match='SM_ROOT runs'):
            unwrap(machine)
        refused.append(True)
        return 'ok'

    machine = chain_of(Scripted(from_inside))
    assert OracleContainer.wrap(machine).execute() == 'done' and refused
