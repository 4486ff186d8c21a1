"""The meta state of the level that goes on, once the containers below it were left for it."""
from typing import Mapping, Optional

from ..decision.policy import FailureContext
from ..machine.tree_node import TreeNode
from ..places.way import Way
from ..records.facts import LEFT
from ..records.state_record import StateRecord
from ..records.visits import VisitResult
from ..recovery.arrival_recovery import ArrivalRecovery
from ..recovery.failure import Failure
from ..recovery.verdict import VerdictKind
from .departure import Departure
from .oracle_visit import OracleVisit


class ArrivingVisit(OracleVisit):
    """The way through the meta state of a verdict that comes from a container below."""

    _facts = LEFT

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure,
                 departure: Departure) -> None:
        """`failure`: of the state that was left, if it has to be asked about."""
        super().__init__(node, record, failure)
        self._departure = departure

    def arrive(self, outcome: str, context: FailureContext) -> Optional[str]:
        """Follow the verdict, or ask where something prevents it meanwhile.

        `outcome`: with what the state that was left has ended. It returns, and raises, what `run`
        does.
        """
        meta = self._pass_to_meta(outcome, outcome or 'left')
        verdict = self._departure.verdict._replace(level=None)
        with self._back_where_it_raises():
            why_not = self._departure.why_not()
            if why_not:
                verdict = self._recover(meta, ArrivalRecovery(
                    self._node, self._record, self._failure, context, why_not))
            if verdict.kind is VerdictKind.SUPERSEDE:
                self._note_superseded(verdict.outcome)
            return self._leave(meta, verdict)

    def _note_superseded(self, outcome: str) -> None:
        if self._departure.result_of(self._node) is VisitResult.FAILURE:
            super()._note_superseded(outcome)
        else:
            self._node.records.history.count_superseded(self._record.label, outcome)

    def _across(self, way: Way) -> Mapping[str, str]:
        return {'from': self._departure.failed, **super()._across(way)}
