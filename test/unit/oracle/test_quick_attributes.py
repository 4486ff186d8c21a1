"""What executes in a wrapped tree has its attributes where CPython reads them fast.

An object that was looked at by `vars`, or has changed its class, shares a table of names with all
of its class. Since CPython 3.11 a look at its attributes takes four times as long then.
"""

import copy
import sys

import pytest
from branch_machines import both, iterator_over
from machines import Scripted

import smach
from smach_oracle.oracle import OracleContainer, unwrap
from smach_oracle.oracle.branches.wrapper import wrapper_of


def shares_its_names(thing):
    """Whether the size of its attributes is not that of a table with names of its own."""
    return sys.getsizeof(vars(thing)) != sys.getsizeof(dict(vars(thing)))


def machine_of(container):
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        outcomes = container.get_registered_outcomes()
        smach.StateMachine.add('ALL', container, dict.fromkeys(outcomes, 'done'))
    return machine


CONTAINERS = {
    'an Iterator': lambda: iterator_over(Scripted()),
    'a Concurrence': lambda: both(Scripted(), Scripted()),
}


def test_a_look_at_an_object_makes_it_share_its_names():
    assert shares_its_names(iterator_over(Scripted()))  # else the tests below see nothing


@pytest.mark.parametrize('make', CONTAINERS.values(), ids=CONTAINERS)
def test_a_container_and_its_branches_have_tables_of_their_own(make):
    container = make()
    machine = OracleContainer.wrap(machine_of(container))
    machine.execute()
    wrapper = wrapper_of(container)
    assert wrapper.branches
    for thing in (machine, container, wrapper, *wrapper.branches.values()):
        assert not shares_its_names(thing), thing


@pytest.mark.parametrize('make', CONTAINERS.values(), ids=CONTAINERS)
def test_so_has_what_was_unwrapped(make):
    container = make()
    machine = unwrap(OracleContainer.wrap(machine_of(container)))
    machine.execute()
    for thing in (machine, container):
        assert not shares_its_names(thing), thing


def test_so_has_a_copy():
    machine = OracleContainer.wrap(machine_of(Scripted()))
    assert not shares_its_names(copy.copy(machine))


def visited(state):
    """The views of a state's userdata at its first and at its second visit of a trial."""
    views = []

    def look(outcome):
        return lambda self, ud: views.append(record('A').view) or outcome

    machine = smach.StateMachine(outcomes=['done'])
    with machine:
        smach.StateMachine.add('A', state, dict.fromkeys(['ok', 'aborted', 'preempted'], 'B'))
        again = Scripted(look('ok'), look('aborted'))
        smach.StateMachine.add('B', again, {'ok': 'A', 'aborted': 'done', 'preempted': 'done'})
    record = OracleContainer.wrap(machine, recover=False)._oracle.record
    assert machine.execute() == 'done'
    return views


class KeysOfItsOwn(Scripted):
    """Says by a method of its own which keys it reads."""

    def get_registered_input_keys(self):
        return Scripted.get_registered_input_keys(self)


def test_the_view_of_a_state_s_userdata_is_made_once():
    first, second = visited(Scripted())
    assert first is second


def test_the_view_of_a_state_with_keys_of_its_own_is_made_at_each_visit():
    first, second = visited(KeysOfItsOwn())
    assert first is not second
