"""One failure while the robot was not well: it is waited for health before all else."""
from ..decision.policy import FailureContext
from ..machine.health_watch import FAILED
from ..machine.repeats import repeated_by_going_to
from ..machine.tree_node import TreeNode
from ..places.place import Place
from ..places.way import Way
from ..records.events import FailureKind
from ..records.state_record import StateRecord
from .failure import Failure
from .recovery import Recovery
from .verdict import Verdict


class UnwellRecovery(Recovery):
    """Waits until the robot is well again."""

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure,
                 context: FailureContext, why: str) -> None:
        """`why`: the robot is not well, or '' where a preempt or a shutdown is under way."""
        super().__init__(node, record, failure, context, False)
        self._why_unwell = why

    def run(self) -> Verdict:
        """Wait, and enter the failed state again."""
        if not self._why_unwell:
            return self._preempted()
        if self._stop.is_over() or not self._stop.wait_until_well(FAILED, self._why_unwell):
            return self._ended_early()
        return self._enter_again()

    def _enter_again(self) -> Verdict:
        """Enter the failed state again, now that the robot is well, or ask where that repeats."""
        label = self._record.label
        if not repeated_by_going_to(self._node, label):
            self._record.unwell_repeats += 1
            return self._jump(Way((), self._node, (Place(self._node, label),)))
        self._judge_anew(self._failure._replace(
            kind=FailureKind.HELD_BACK,
            text='failed while the robot was not well, and is not repeated by itself'))
        return super().run()


class OftenUnwellRecovery(Recovery):
    """Waits until the robot is well again, and then recovers as usual.

    For a state that has been repeated uncounted too often: it may be what makes the robot unwell.
    """

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure,
                 context: FailureContext, continuous: bool, why: str) -> None:
        """`why`: the robot is not well."""
        super().__init__(node, record, failure, context, continuous)
        self._why_unwell = why

    def run(self) -> Verdict:
        """Wait, and recover from a failure that was counted."""
        if self._stop.is_over() or not self._stop.wait_until_well('failed again', self._why_unwell):
            return self._ended_early()
        return super().run()
