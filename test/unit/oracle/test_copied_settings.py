"""A shallow copy of a machine has settings of its own."""

import copy

from machines import Scripted

from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.machine.tree_node import node_of


def test_settings_given_with_add_to_a_copy_are_not_those_of_the_machine():
    machine = OracleContainer(['ok', 'aborted', 'preempted'])
    with machine:
        OracleContainer.add('A', Scripted(), prior=0.2)
    twin = copy.copy(machine)
    with twin:
        OracleContainer.add('B', Scripted(), prior=0.3)
    assert [node_of(each).settings_of('A').prior for each in (machine, twin)] == [0.2, 0.2]
    assert [node_of(each).settings_of('B').prior for each in (machine, twin)] == [0.1, 0.3]
