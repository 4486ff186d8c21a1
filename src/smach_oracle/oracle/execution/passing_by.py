"""Passes by a state that is held when a preempt comes: the author's way after `preempted`.

Without an oracle the state would be executed under the request. One that does not look at it would
do its work, which an operator has held. So none is executed: the machine goes on as if the state
had obeyed at once.
"""

from typing import Optional, Tuple, cast

from ..checkpoint.resuming import forget_resumed
from ..machine.tree_node import TreeNode, WrappedMachine
from ..places.place import Place
from ..records.events import EventKind
from ..records.facts import PASSED_BY
from ..recovery.failure import Route, route_at_preempt, route_of
from ..settings.failing_outcomes import PREEMPTED
from .transitions import Stop, go_to, message_of, obey_preempt, terminate

Down = Tuple[Place, ...]


def pass_by(node: TreeNode) -> Optional[Stop]:
    """Go where the author sends a preempt of the current state, at a state boundary.

    Return None where nothing is drawn for it. A machine in which the state would begin with a way
    of its own is entered, and begins behind its first state.
    """
    machine = node.machine
    label = str(machine._current_label)
    route, down = _behind(node, label)
    if not route.target:
        return None
    state = machine._states[label]
    node.execution.tell_preempt()
    forget_resumed(node)
    record = node.record(label)
    record.forget_entry()  # it may have been led to, and is not entered
    obey_preempt(node, state, bool(down))
    if not route.is_state:
        machine.service_preempt()
        return Stop(terminate(node, label, PREEMPTED, route.target))
    if down:
        record.go_down(down)
        return Stop()  # to the next boundary, which is before the same state
    node.emit(
        EventKind.TRANSITION, state=label, outcome=PREEMPTED, target=route.target, **PASSED_BY
    )
    go_to(node, message_of(label, PREEMPTED, route.target), route.target)
    return Stop()


def _behind(node: TreeNode, label: str) -> Tuple[Route, Down]:
    """Return where a state leads at a preempt, with the way down where that is within it.

    Within a machine that is the way behind the state in which it would begin.
    """
    inner = _machine_in(node, label)
    if inner is not None:
        led = [place.label for place in node.record(label).way_down if place.node is inner]
        route, down = _behind(inner, led[0] if led else str(inner.machine._initial_state_label))
        if route.is_state:
            return Route(label, True), (Place(inner, route.target), *down)
        if route.target:
            return route_of(node.machine, label, route.target), ()
    return route_at_preempt(node.machine, label), ()


def _machine_in(node: TreeNode, label: str) -> Optional[TreeNode]:
    """Return the node of a machine that is a state itself, and begins from its start."""
    state = node.machine._states[label]
    if not isinstance(state, node.tree.container_class):
        return None
    inner = cast(WrappedMachine, state)._oracle
    goes_on = node.tree.resumed.entry_of(inner) is not None
    return inner if inner.parent is node and not goes_on else None
