"""A failure while the robot was not well: it is not counted, and the state runs again after that.

Such a visit is no visit: it is in no history, no rate and no count, and the observers are told of
no failure, transition or jump. They are told that the machine waits.
"""
import time
from typing import Any, Mapping, Optional

import smach

from ..decision.policy import FailureContext
from ..machine.tree_node import TreeNode
from ..machine.workers import recall_preempts
from ..records.state_record import StateRecord
from ..recovery.failure import Failure
from ..recovery.judging import in_words
from ..recovery.recovery import Recovery
from ..recovery.unwell_recovery import OftenUnwellRecovery, UnwellRecovery
from .oracle_visit import OracleVisit


def why_unwell_after(node: TreeNode) -> Optional[str]:
    """Return why the robot was not well when a state has just failed, None where it was.

    It looks for the settle time. Where a preempt or a shutdown comes meanwhile, it returns '':
    nothing is a failure then.
    """
    machine = node.machine

    def stopped() -> bool:
        return machine.preempt_requested() or smach.is_shutdown() or node.is_left_behind()

    lock = machine._state_transitioning_lock
    lock.release()
    try:
        why = node.tree.health.unwell_after(stopped, time.sleep)
    finally:
        lock.acquire()
    return '' if stopped() else why or None


class UnwellVisit(OracleVisit):
    """The way of a failure that is not counted into the meta state, and back to its state."""

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure, why: str) -> None:
        """`why`: the robot is not well, or '' where a preempt or a shutdown is under way."""
        super().__init__(node, record, failure)
        self._why = why
        state = node.machine._states[record.label]
        if not why and state.preempt_requested():
            recall_preempts(state)  # it came after the state's end: the meta state services it

    def _recovery(self, context: FailureContext, continuous: bool) -> Recovery:
        return UnwellRecovery(self._node, self._record, self._failure, context, self._why)

    def _tell_failure(self) -> None:
        # what the wait says in the log is one sentence for all who wait
        smach.loginfo('{}/{} failed, which is not counted: {}'.format(
            self._node.path, self._record.label, self._failure.details or in_words(self._failure)))

    def _note_passage(self, outcome: str, what: str) -> None:
        """Record nothing: the visit does not count."""

    def _note_superseded(self, outcome: str) -> None:
        self._count_superseded(outcome)

    def _note_jump(self, target: str, data: Mapping[str, Any], by: str, text: str) -> None:
        if target != self._record.label or by:  # else it runs again, and that is told
            super()._note_jump(target, data, by, text)


class OftenUnwellVisit(OracleVisit):
    """The way of a failure that is counted, since its state has failed unwell too often."""

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure, why: str) -> None:
        """`why`: the robot is not well."""
        super().__init__(node, record, failure)
        self._why = why

    def _recovery(self, context: FailureContext, continuous: bool) -> Recovery:
        return OftenUnwellRecovery(self._node, self._record, self._failure, context, continuous,
                                   self._why)
