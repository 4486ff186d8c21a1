"""Tells what ends a recovery: a preempt, a shutdown or the budget's minutes. Waits until then."""

from typing import Optional, Sequence

from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..scope.scope import Reason, Scope, standing_still
from ..settings.failing_outcomes import is_preempted


def in_words(reason: Optional[Reason], node: TreeNode) -> str:
    """Return why a question is taken back, as the events say it."""
    early = node.tree.early_end.why
    if early is not None:
        return early.value
    return (reason or Reason.SHUTDOWN).text


def note_obeyed(node: TreeNode, label: str, cleans_within: bool = False) -> None:
    """Note that a state has ended by a preempt, where that is a stop of the whole machine.

    Who preempts only a part of it wants the rest to go on, as a Concurrence does with its branches.

    :param cleans_within: the state is entered again, a machine with a clean-up of its own.
    """
    if _is_stop(node):
        node.records.note_obeyed(label, cleans_within)


def _is_stop(node: TreeNode) -> bool:
    """Whether the outermost container is asked to stop, and not a part of it, which is left."""
    return _asks_for_stop([node, *node.running_around()])


def _asks_for_stop(around: Sequence[TreeNode]) -> bool:
    return bool(around[-1].machine.preempt_requested())


def note_end_under_preempt(node: TreeNode, label: str, outcome: Optional[str]) -> None:
    """Note that a state has ended under a preempt, if it has obeyed.

    It has not where it goes on as if nobody had asked: then the next state is asked.

    :param outcome: the outcome as its author drew it, None for a failure.
    """
    is_drawn = outcome is not None and is_preempted(outcome)
    if is_drawn:
        node.records.note_drawn()
    if outcome is None or is_drawn or not node.machine._states[label].preempt_requested():
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


def winds_down(node: TreeNode) -> bool:
    """Whether this container is to do no more work: the innermost one that has obeyed decides.

    The oracle does not lead it back to its work, whatever its clean-up ends with. Its author may.
    """
    around = [node, *node.running_around()]
    is_stop = _asks_for_stop(around)
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


class RecoveryStop:
    """Whether one recovery is over.

    A preempt or a shutdown cancels its `scope`, and so does the end of what goes on around it. The
    end of the trial's time cancels `timed` as well.
    """

    def __init__(self, node: TreeNode, record: StateRecord) -> None:
        self._node = node
        self._record = record
        self.scope = Scope(node.execution.scope_around)
        self.timed = Scope(self.scope, look=self._look_at_budget)

    def _look_at_budget(self) -> Optional[Reason]:
        return Reason.TIME_OVER if self._node.tree.budget.why_over() else None

    def is_over(self) -> bool:
        """Whether it is stopped, or the trial's time is over."""
        return self.timed.reason is not None

    def has_waited(self, seconds: float) -> bool:
        """Let time pass. Return False where something has ended the recovery meanwhile."""
        with standing_still(self._node.execution.runs_around):
            self._node.tree.waiting.wait(seconds, 'waiting', self.timed)
        return not self.is_over()

    # -- health

    def has_waited_after(self, what: str) -> bool:
        """Wait where the robot was not well at what has happened.

        Return whether it is well again.
        """
        health = self._node.tree.health
        if not health.is_set:
            return False
        why = health.unwell_after(self.scope)
        return bool(why) and self.wait_until_well(what, why)

    def wait_until_well(self, what: str, why: str) -> bool:
        """Wait until the robot is well. Return False where something has ended the recovery."""
        with standing_still(self._node.execution.runs_around):
            is_well = self._node.tree.health.wait_until_well(
                self._node, self._record.label, what, why, self.timed
            )
        return is_well and not self.is_over()
