"""The way of a visit through the meta state that was begun before the program was stopped."""
from ..checkpoint.unanswered import KeepingHeldBack, KeepingRecovery
from ..decision.policy import FailureContext
from ..machine.tree_node import TreeNode
from ..records.state_record import StateRecord, Unfinished
from ..recovery.arrival_recovery import ArrivalRecovery
from ..recovery.failure import Failure
from ..recovery.recovery import Recovery
from .oracle_visit import OracleVisit


class ResumedVisit(OracleVisit):
    """Recovers as from any failure, or asks first where the machine is not to move by itself."""

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure,
                 before: Unfinished) -> None:
        """`before`: how the visit stood."""
        super().__init__(node, record, failure)
        self._before = before

    def _recovery(self, context: FailureContext, continuous: bool) -> Recovery:
        before = self._before
        if not before.asks:
            return super()._recovery(context, continuous)
        if self._failure.is_held_back:
            return KeepingHeldBack(self._node, self._record, self._failure, context, continuous)
        kind = KeepingRecovery if before.keeps else ArrivalRecovery
        return kind(self._node, self._record, self._failure, context, before.asks)
