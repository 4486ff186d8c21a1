"""The way of a visit through the meta state that was begun before the program was stopped."""
from ..decision.policy import FailureContext
from ..machine.tree_node import TreeNode
from ..records.state_record import StateRecord
from ..recovery.arrival_recovery import ArrivalRecovery
from ..recovery.failure import Failure
from ..recovery.recovery import Recovery
from .oracle_visit import OracleVisit


class ResumedVisit(OracleVisit):
    """Recovers as from any failure, or asks first where the machine is not to move by itself."""

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure, asks: str) -> None:
        """`asks`: why a person is asked at once, '' where nobody is."""
        super().__init__(node, record, failure)
        self._asks = asks

    def _recovery(self, context: FailureContext, continuous: bool) -> Recovery:
        if not self._asks:
            return super()._recovery(context, continuous)
        return ArrivalRecovery(self._node, self._record, self._failure, context, self._asks)
