"""One failure while the robot was not well: nothing is decided, it is waited for health."""
from ..decision.policy import FailureContext
from ..machine.health_watch import FAILED
from ..machine.repeats import repeated_by_going_to
from ..machine.tree_node import TreeNode
from ..records.events import FailureKind
from ..records.state_record import StateRecord
from .failure import Failure
from .recovery import Recovery
from .verdict import Verdict


class UnwellRecovery(Recovery):
    """Waits until the robot is well again."""

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure,
                 context: FailureContext, why: str) -> None:
        """`why`: the robot is not well; '' where a preempt or a shutdown is under way."""
        super().__init__(node, record, failure, context, False)
        self._why_unwell = why

    def run(self) -> Verdict:
        """Wait, and enter the failed state again."""
        if not self._why_unwell or not self._wait_until_well(FAILED, self._why_unwell):
            return self._preempted()
        return self._enter_again()

    def _enter_again(self) -> Verdict:
        """Enter the failed state again, now that the robot is well, or ask where that repeats."""
        label = self._record.label
        if not repeated_by_going_to(self._node, label):
            return self._jump(label)
        self._failure = self._failure._replace(
            kind=FailureKind.HELD_BACK,
            text='failed while the robot was not well, and is not repeated by itself')
        return super().run()
