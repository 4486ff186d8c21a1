"""A stop of the whole machine: which states have obeyed it, and who winds down since."""

from typing import Optional

from ..machine.tree_node import TreeNode, node_of
from ..settings.failing_outcomes import is_preempted
from ..smach_private import states_of


def note_obeyed(node: TreeNode, label: str, cleans_within: bool = False) -> None:
    """Note that a state has ended by a preempt, where that is a stop of the whole machine.

    Who preempts only a part of it wants the rest to go on, as a Concurrence does with its branches.

    :param cleans_within: the state is entered again, a machine with a clean-up of its own.
    """
    outermost = [node, *node.running_around()][-1]
    if outermost.machine.preempt_requested():
        node.records.note_obeyed(label, cleans_within)


def note_end_under_preempt(node: TreeNode, label: str, outcome: Optional[str]) -> None:
    """Note that a state has ended under a preempt, if it has obeyed.

    It has not where it goes on as if nobody had asked: then the next state is asked.

    :param outcome: the outcome as its author drew it, None for a failure.
    """
    is_drawn = is_preempted(outcome)
    if is_drawn:
        node.records.note_drawn()
    if outcome is None or is_drawn or not states_of(node.machine)[label].preempt_requested():
        note_obeyed(node, label)


def is_asked_around(node: TreeNode) -> bool:
    """Whether a container around this one was asked to stop, and none below it has obeyed."""
    for each in node.running_around():
        if node.records.has_obeyed:
            return False
        if each.machine.preempt_requested():
            return True
        node = each
    return False


def note_stop_of_part(node: TreeNode, label: str) -> bool:
    """Return whether the program has asked a state, or the machine in it, to stop.

    To be asked of one that has just failed, or says that it was preempted, in a container that was
    not asked. So the program wants neither the state nor what is around it to be done again.
    """
    state = states_of(node.machine)[label]
    inner = node_of(state)
    asked = bool(
        state.preempt_requested()
        or (inner and (inner.execution.was_preempted or inner.execution.was_stopped))
    )
    node.execution.was_stopped = node.execution.was_stopped or asked
    return asked


def winds_down(node: TreeNode) -> bool:
    """Whether this container is to do no more work: the innermost one that has obeyed decides.

    The oracle does not lead it back to its work, whatever its clean-up ends with. Its author may.
    """
    around = [node, *node.running_around()]
    is_stop = bool(around[-1].machine.preempt_requested())
    for each in around:
        if is_stop and each.machine.preempt_requested():
            return True
        if each.records.has_obeyed:
            return each.records.winds_down()
    return False


def preempt_beside(node: TreeNode) -> None:
    """Preempt the whole machine where others may run next to a container.

    To be called in its thread, its lock not held.
    """
    if node.runs_beside_others():
        node.top().machine.request_preempt()
