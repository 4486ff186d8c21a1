"""The state boundary as an operator uses it: holds, announcements, jumps that were asked for."""
import contextlib
from typing import Iterator, NamedTuple, Optional

import smach

from ..control.hold import HeldPlace, Hold, LetGo
from ..control.holding import Wait, wait_until_let_go
from ..machine.tree_node import TreeNode
from ..machine.workers import recall_preempts
from ..records.events import EventKind
from ..recovery.operator_wait import clocks_stand_still
from ..settings.failing_outcomes import PREEMPTED
from ..settings.settings import ANNOUNCE, CONFIRM_FIRST
from .sending import make_jump
from .transitions import terminate


class Stop(NamedTuple):
    """The state is not executed now. `outcome`: of the container, None where it goes on."""

    outcome: Optional[str] = None


def pass_boundary(node: TreeNode, was_preempted: bool) -> Optional[Stop]:
    """Do before a state what an operator has asked for. None: the state is executed now.

    :param was_preempted: whether there was a preempt request, which the last state may have obeyed.
    """
    with _locked(node):
        return _pass(node, was_preempted)


@contextlib.contextmanager
def _locked(node: TreeNode) -> Iterator[None]:
    """Hold the machine's lock as the engine does around a step."""
    lock = node.machine._state_transitioning_lock
    if not node.engine.lock_is_held:
        lock.acquire()
    try:
        yield
    finally:
        if not node.engine.lock_is_held:
            lock.release()


def _pass(node: TreeNode, was_preempted: bool) -> Optional[Stop]:
    machine, control = node.machine, node.tree.control
    stops = machine.preempt_requested() or _is_to_stop(node)
    if not (stops or was_preempted):
        control.stop_is_over()
    jump = None if stops else control.take_jump(node.key)
    if jump is not None and make_jump(node, jump):
        return Stop()  # to the next boundary, which is before that state
    place = HeldPlace(node.path, str(machine._current_label))
    autonomy = node.record(place.state).settings.autonomy
    level = control.level_of(place, autonomy)
    # what an author does at a preempt waits for no confirmation, and at no breakpoint
    hold = control.hold_before(place, level == CONFIRM_FIRST and not was_preempted,
                               not (stops or was_preempted))
    if hold is not None:
        hold.autonomy, hold.key, hold.asks = autonomy, node.key, not was_preempted
    else:
        control.arrived(node.key)
    if hold is not None and (stops or (was_preempted and control.paused)):
        return _end_preempted(node)
    if level == ANNOUNCE:
        _announce(node, place)
    return None if hold is None else _hold(node, hold)


def _is_to_stop(node: TreeNode) -> bool:
    """Whether a machine around this one was asked to stop, though this one has obeyed already."""
    while node.parent is not None:
        node = node.parent
        if node.machine._is_running and node.machine.preempt_requested():
            return True
    return False


def _announce(node: TreeNode, place: HeldPlace) -> None:
    smach.loginfo('{}: is about to enter {}'.format(*place))
    node.emit(EventKind.ANNOUNCE, state=place.state, text='about to enter ' + place.state)


def _hold(node: TreeNode, hold: Hold) -> Optional[Stop]:
    let_go = _wait(node, hold)
    if let_go in (LetGo.SENT, LetGo.SHUTDOWN, LetGo.LEFT_BEHIND):
        return Stop()  # whoever calls for the next step finds out
    return _end_preempted(node) if let_go is LetGo.PREEMPTED else None


def _wait(node: TreeNode, hold: Hold) -> LetGo:
    lock = node.machine._state_transitioning_lock
    lock.release()  # who asks for a preempt takes it
    try:
        return wait_until_let_go(node.tree.control, hold, Wait(
            node, clocks_stand_still(node), lambda: _ended_by(node)))
    finally:
        lock.acquire()


def _ended_by(node: TreeNode) -> Optional[LetGo]:
    if node.is_left_behind():
        return LetGo.LEFT_BEHIND
    if node.machine.preempt_requested():
        return LetGo.PREEMPTED
    return LetGo.SHUTDOWN if smach.is_shutdown() else None


def _end_preempted(node: TreeNode) -> Optional[Stop]:
    """End the container at once, preempted. Return None where it has no outcome for that.

    Then its state is executed under the request, as without an oracle.
    """
    machine = node.machine
    registered = machine.get_registered_outcomes()
    failing = sorted(each for each in registered if each in node.in_force.failing)
    if PREEMPTED not in registered and not failing:
        return None
    outcome = PREEMPTED if PREEMPTED in registered else failing[0]
    label = str(machine._current_label)
    if machine.preempt_requested():
        node.tell_preempt()
    for state in (machine._preempted_state, machine._current_state):
        if state is not None:
            recall_preempts(state)
    machine.service_preempt()
    return Stop(terminate(node, label, outcome, outcome))
