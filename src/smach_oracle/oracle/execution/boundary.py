"""The state boundary: what comes before a state under a preempt, or while an operator has a say.

That is holds, announcements and jumps that were asked for. Where a preempt comes before a state
that is held, the machine takes the author's way after `preempted`. Without an oracle the state
would be executed under the request. One that does not look at it would do its work, which an
operator has held. So none is executed: the machine goes on as if the state had obeyed at once.

An Iterator is under no oracle. It calls its transition callbacks between items, on both engines.
There an operator can hold it. A machine that it contains is held at its own boundaries.
"""

import contextlib
from typing import Iterator, Optional, Tuple

import smach

from ..branches.adopting import Branching
from ..branches.wrapper import wrapper_of
from ..checkpoint.resuming import forget_resumed
from ..control.control import HeldPlace, Hold, LetGo
from ..machine.nesting import branching_below
from ..machine.places import TreePlace
from ..machine.site import Route, route_of
from ..machine.tree_node import TreeNode, marked_node
from ..machine.workers import recall_preempts
from ..records.events import EventKind
from ..records.facts import PASSED_BY
from ..recovery.operator_wait import wait_for_operator, wait_until_let_go
from ..recovery.stop import is_asked_around
from ..recovery.verdict import failing_outcome, route_at_preempt
from ..scope.scope import Reason, Scope
from ..settings.failing_outcomes import PREEMPTED
from ..settings.settings import ANNOUNCE, CONFIRM_FIRST
from ..smach_private import (
    Labels,
    current_label_of,
    current_state_of,
    initial_label_of,
    lock_of,
    note_passed_on,
    preempted_state_of,
    set_preempt_flag,
    set_preempted_state,
    states_of,
    transition_callbacks,
)
from .jump_entry import keep_start, make_jump
from .transitions import Stop, go_to, message_of, obey_preempt, stop_left_behind, terminate

Down = Tuple[TreePlace, ...]


def before_step(node: TreeNode) -> Optional[Stop]:
    """Before the first state of an execution, and before any state under a preempt request.

    Likewise before any state while an operator has a say. Under a request the state is preempted
    too, unless the last one has serviced the request.

    :returns: None where the state is executed now.
    """
    if node.engine.stepped:
        node.tree.control.calm(node.engine)
    else:
        node.begin_stepping()
        if node.tree.restarts.is_due:
            keep_start(node)
    if node.execution.is_left_behind():
        return stop_left_behind(node)
    was_preempted = node.machine.preempt_requested()
    if was_preempted:
        with _locked(node):
            _pass_preempt_on(node)
    elif not node.engine.attentive:
        return None  # nor was the state drawn after `preempted`
    is_drawn = node.records.take_drawn()
    if not node.engine.attentive:
        return None
    with _locked(node):
        return _pass(node, was_preempted, is_drawn)


def _pass_preempt_on(node: TreeNode) -> None:
    machine = node.machine
    node.execution.tell_preempt()
    last = preempted_state_of(machine)
    if last is not None and not last.preempt_requested():
        set_preempt_flag(machine, False)
        set_preempted_state(machine, None, None)
        node.execution.note_no_preempt()
        return
    if last is not None:
        last.recall_preempt()
    current = current_state_of(machine)
    set_preempted_state(machine, current, current_label_of(machine))
    # to our engine: who asked, and now waits for the lock, need not ask again
    note_passed_on(machine)
    if current is not None:
        current.request_preempt()


@contextlib.contextmanager
def _locked(node: TreeNode) -> Iterator[None]:
    """Hold the machine's lock as the engine does around a step."""
    lock = lock_of(node.machine)
    if not node.engine.lock_is_held:
        lock.acquire()
    try:
        yield
    finally:
        if not node.engine.lock_is_held:
            lock.release()


def _pass(node: TreeNode, was_preempted: bool, is_drawn: bool) -> Optional[Stop]:
    """Do before a state what an operator has asked for. None: the state is executed now.

    :param was_preempted: whether there was a preempt request, which the last state may have obeyed.
    :param is_drawn: whether its author drew the state after the last one's `preempted`.
    """
    machine, control = node.machine, node.tree.control
    stands = machine.preempt_requested()
    obeyed = was_preempted and (is_drawn or not stands)
    asked = stands and not obeyed
    stops = asked or is_asked_around(node)
    if not (stops or was_preempted):
        control.stop_is_over()
    jump = None if stops else control.take_jump(node.key)
    if jump is not None and make_jump(node, jump, obeyed and not jump.after_stop):
        return Stop()  # to the next boundary, which is before that state
    place = HeldPlace(node.path, current_label_of(machine))
    autonomy = node.record(place.state).settings.autonomy
    level = control.level_of(place, autonomy)
    # what an author does at a preempt waits for no confirmation, and at no breakpoint
    hold = control.hold_before(
        place,
        level == CONFIRM_FIRST and not obeyed,
        asked or not (stops or was_preempted),
        asked,
        obeyed,
    )
    if hold is not None:
        hold.autonomy, hold.key, hold.asks = autonomy, node.key, not obeyed
    else:
        control.arrived(node.key)
    if hold is not None and (stops or obeyed):
        return _preempted_before(node, asked)
    if level == ANNOUNCE:
        smach.loginfo('{}: is about to enter {}'.format(*place))
        node.emit(EventKind.ANNOUNCE, place.state, text='about to enter ' + place.state)
    return None if hold is None else _hold(node, hold)


def _hold(node: TreeNode, hold: Hold) -> Optional[Stop]:
    lock = lock_of(node.machine)
    lock.release()  # who asks for a preempt takes it
    try:
        let_go = wait_until_let_go(node, hold, node.execution.scope)
    finally:
        lock.acquire()
    if let_go is Reason.PREEMPTED:
        return _preempted_before(node, True)
    # whoever calls for the next step finds out
    return Stop() if let_go is LetGo.SENT or isinstance(let_go, Reason) else None


def _preempted_before(node: TreeNode, asked: bool) -> Optional[Stop]:
    """Go on where a preempt comes before a state that is held: the state is not executed.

    While an operator has paused the tree and somebody else preempts it, no other one is either.

    :param asked: whether the container itself is to obey.
    """
    stop = _pass_by(node) if asked and not node.tree.control.holds_all else None
    if stop is not None:
        return stop
    machine, outcome = node.machine, failing_outcome(node, (PREEMPTED,))
    if outcome is None:
        return None
    label = current_label_of(machine)
    if machine.preempt_requested():
        node.execution.tell_preempt()
    for state in (preempted_state_of(machine), current_state_of(machine)):
        if state is not None:
            recall_preempts(state)
    machine.service_preempt()
    return Stop(terminate(node, label, outcome, outcome))


def _pass_by(node: TreeNode) -> Optional[Stop]:
    """Go where the author sends a preempt of the current state, at a state boundary.

    Return None where nothing is drawn for it. A machine in which the state would begin with a way
    of its own is entered, and begins behind its first state.
    """
    machine = node.machine
    label = current_label_of(machine)
    route, down = _behind(node, label)
    if not route.leads_on:
        return None
    state = states_of(machine)[label]
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
    node.emit(EventKind.TRANSITION, label, PREEMPTED, route.target, **PASSED_BY)
    go_to(node, message_of(label, PREEMPTED, route.target), route.target)
    return Stop()


def _behind(node: TreeNode, label: str) -> Tuple[Route, Down]:
    """Return where a state leads at a preempt, with the way down where that is within it.

    Within a machine that is the way behind the state in which it would begin.
    """
    inner = _machine_in(node, label)
    if inner is not None:
        led = [place.label for place in node.record(label).way_down if place.node is inner]
        route, down = _behind(inner, led[0] if led else initial_label_of(inner.machine))
        if route.is_state:
            return Route(label, True), (TreePlace(inner, route.target), *down)
        if route.leads_on:
            return route_of(node.machine, label, route.target), ()
    return route_at_preempt(node.machine, label), ()


def _machine_in(node: TreeNode, label: str) -> Optional[TreeNode]:
    """Return the node of a machine that is a state itself, and begins from its start."""
    state = states_of(node.machine)[label]
    if not isinstance(state, node.tree.container_class):
        return None
    inner = marked_node(state)
    goes_on = node.tree.resumed.entry_of(inner.records) is not None
    return inner if inner.parent is node and not goes_on else None


# -- the boundary between two items of an Iterator


class ItemGate:
    """A transition callback of an Iterator that waits where an operator holds the tree."""

    def __init__(self, node: TreeNode, below: Labels, container: smach.Container) -> None:
        """`node`: of the wrapped container around it. `below`: the labels that lead to it."""
        self.node = node
        self._below = below
        self._container = container

    def __call__(self, userdata: object, active: object, *args: object) -> None:
        """Wait before the next item."""
        node = self.node
        if not (node.tree.control.is_set or node.in_force.limits_autonomy):
            return
        label = next(iter(self._container.get_children()), '')
        relative = '/'.join(filter(None, (node.relative_path,) + self._below))
        autonomy = node.in_force.of_state(relative, label).autonomy
        scope = Scope(node.execution.scope_around, look=self._look_for_preempt)
        wait_for_operator(node, self._below, label, autonomy, scope)

    def _look_for_preempt(self) -> Optional[Reason]:
        return Reason.PREEMPTED if self._container.preempt_requested() else None


def place_gates(node: TreeNode, branching: Branching) -> None:
    """Place a gate in each Iterator of a container whose items have no boundary themselves; once.

    Machines have one, and states under an oracle of their own.
    """
    for below, container in branching:
        wrapper = wrapper_of(container)
        callbacks = transition_callbacks(container)
        if (
            not isinstance(container, smach.Iterator)
            or (wrapper is not None and wrapper.branches)
            or any(
                isinstance(each, smach.StateMachine) for each in container.get_children().values()
            )
        ):
            _remove(container)
        elif not any(isinstance(each[0], ItemGate) and each[0].node is node for each in callbacks):
            _remove(container)
            container.register_transition_cb(ItemGate(node, below, container))


def remove_gates(machine: smach.StateMachine) -> None:
    """Take the gates away from the Iterators of a container."""
    for _, container in branching_below(machine):
        _remove(container)


def _remove(container: smach.Container) -> None:
    transition_callbacks(container)[:] = [
        each for each in transition_callbacks(container) if not isinstance(each[0], ItemGate)
    ]
