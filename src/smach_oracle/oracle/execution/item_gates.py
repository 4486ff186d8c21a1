"""Lets an operator hold an Iterator between two items.

An Iterator is under no oracle. It calls its transition callbacks between items, on both engines. A
machine that it contains is held at its own boundaries.
"""

from typing import Any, Iterator, Optional

import smach

from ..branches.wrapper import wrapper_of
from ..machine.nesting import branching_below
from ..machine.tree_node import TreeNode
from ..recovery.operator_wait import wait_for_operator
from ..scope.scope import Reason, Scope
from ..smach_private import Labels, transition_callbacks


class ItemGate:
    """A transition callback of an Iterator that waits where an operator holds the tree."""

    def __init__(self, node: TreeNode, below: Labels, container: Any) -> None:
        """`node`: of the wrapped container around it. `below`: the labels that lead to it."""
        self.node = node
        self._below = below
        self._container = container

    def __call__(self, userdata: object, active: object, *args: object) -> None:
        """Wait before the next item."""
        node = self.node
        if not (node.tree.control.is_set or node.in_force.limits_autonomy()):
            return
        label = next(iter(self._container.get_children()), '')
        relative = '/'.join(filter(None, (node.relative_path,) + self._below))
        autonomy = node.in_force.of_state(relative, label).autonomy
        scope = Scope(node.execution.scope_around, look=self._look_for_preempt)
        wait_for_operator(node, self._below, label, autonomy, scope)

    def _look_for_preempt(self) -> Optional[Reason]:
        return Reason.PREEMPTED if self._container.preempt_requested() else None


def place_gates(node: TreeNode) -> None:
    """Place a gate in each Iterator of a container whose items have no boundary themselves; once.

    Machines have one, and states under an oracle of their own.
    """
    for below, container in branching_below(node.machine):
        children = container.get_children().values()
        wrapper = wrapper_of(container)
        if wrapper is not None and wrapper.branches:
            _remove(container)
            continue
        if isinstance(container, smach.Iterator) and not any(
            isinstance(child, smach.StateMachine) for child in children
        ):
            if any(gate.node is node for gate in _gates_of(container)):
                continue
            _remove(container)
            container.register_transition_cb(ItemGate(node, below, container))


def remove_gates(machine: smach.StateMachine) -> None:
    """Take the gates away from the Iterators of a container."""
    for _, container in branching_below(machine):
        _remove(container)


def _gates_of(container: Any) -> Iterator[ItemGate]:
    return (
        callback[0]
        for callback in transition_callbacks(container)
        if isinstance(callback[0], ItemGate)
    )


def _remove(container: Any) -> None:
    transition_callbacks(container)[:] = [
        each for each in transition_callbacks(container) if not isinstance(each[0], ItemGate)
    ]
