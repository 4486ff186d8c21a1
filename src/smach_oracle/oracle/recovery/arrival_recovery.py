"""A jump whose place has closed while the containers on the way to it were left: it is asked."""
from ..decision.policy import FailureContext
from ..machine.tree_node import TreeNode
from ..records.state_record import StateRecord
from .failure import Failure
from .recovery import Recovery
from .verdict import Verdict


class ArrivalRecovery(Recovery):
    """Asks at the level where a jump arrives, since it cannot be gone on with."""

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure,
                 context: FailureContext, why_not: str) -> None:
        """`failure`: of the state that was left. `why_not`: a clause."""
        super().__init__(node, record, failure, context, False)
        self._why_not = why_not

    def run(self) -> Verdict:
        """Ask, where the trial's time is not over."""
        if self._stop.is_over():
            return self._ended_early()
        self._cause = self._why_not
        self.warn(self._why_not)
        return self._ask()
