"""The state boundary as an operator uses it: holds, announcements, jumps that were asked for."""

import contextlib
from typing import Iterator, Optional

import smach

from ..control.hold import HeldPlace, Hold, LetGo
from ..control.holding import Wait, wait_until_let_go
from ..machine.tree_node import TreeNode
from ..machine.workers import recall_preempts
from ..records.events import EventKind
from ..recovery.operator_wait import clocks_stand_still
from ..recovery.stop import is_asked_around
from ..settings.failing_outcomes import PREEMPTED
from ..settings.settings import ANNOUNCE, CONFIRM_FIRST
from .passing_by import pass_by
from .sending import make_jump
from .transitions import Stop, terminate


def pass_boundary(node: TreeNode, was_preempted: bool, is_drawn: bool) -> Optional[Stop]:
    """Do before a state what an operator has asked for. None: the state is executed now.

    :param was_preempted: whether there was a preempt request, which the last state may have obeyed.
    :param is_drawn: whether its author drew the state after the last one's `preempted`.
    """
    with _locked(node):
        return _pass(node, was_preempted, is_drawn)


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


def _pass(node: TreeNode, was_preempted: bool, is_drawn: bool) -> Optional[Stop]:
    machine, control = node.machine, node.tree.control
    stands = machine.preempt_requested()
    obeyed = was_preempted and (is_drawn or not stands)
    asked = stands and not obeyed
    stops = asked or is_asked_around(node)
    if not (stops or was_preempted):
        control.stop_is_over()
    jump = None if stops else control.take_jump(node.key)
    if jump is not None and make_jump(node, jump):
        return Stop()  # to the next boundary, which is before that state
    place = HeldPlace(node.path, str(machine._current_label))
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
        _announce(node, place)
    return None if hold is None else _hold(node, hold)


def _announce(node: TreeNode, place: HeldPlace) -> None:
    smach.loginfo('{}: is about to enter {}'.format(*place))
    node.emit(EventKind.ANNOUNCE, state=place.state, text='about to enter ' + place.state)


def _hold(node: TreeNode, hold: Hold) -> Optional[Stop]:
    let_go = _wait(node, hold)
    if let_go in (LetGo.SENT, LetGo.SHUTDOWN, LetGo.LEFT_BEHIND):
        return Stop()  # whoever calls for the next step finds out
    return _preempted_before(node, True) if let_go is LetGo.PREEMPTED else None


def _preempted_before(node: TreeNode, asked: bool) -> Optional[Stop]:
    """Go on where a preempt comes before a state that is held: the state is not executed.

    While an operator has paused the tree and somebody else preempts it, no other one is either.

    :param asked: whether the container itself is to obey.
    """
    stop = pass_by(node) if asked and not node.tree.control.holds_all else None
    return stop or _end_preempted(node)


def _wait(node: TreeNode, hold: Hold) -> LetGo:
    lock = node.machine._state_transitioning_lock
    lock.release()  # who asks for a preempt takes it
    try:
        return wait_until_let_go(
            node.tree.control, hold, Wait(node, clocks_stand_still(node), lambda: _ended_by(node))
        )
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
        node.execution.tell_preempt()
    for state in (machine._preempted_state, machine._current_state):
        if state is not None:
            recall_preempts(state)
    machine.service_preempt()
    return Stop(terminate(node, label, outcome, outcome))
