"""A state that an expert's answer has ended while it still ran: the machine goes as answered."""
from ..asking.question import Answer, AnswerKind
from ..decision.policy import FailureContext
from ..machine.tree_node import TreeNode
from ..places.way import why_closed_on
from ..records.events import FailureKind
from ..records.state_record import StateRecord
from .failure import Failure
from .recovery import Recovery
from .verdict import Verdict


class TakenOutRecovery(Recovery):
    """Obeys an answer that was given before, once the robot is well."""

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure,
                 context: FailureContext, answer: Answer) -> None:
        """`failure`: as if the state had failed."""
        super().__init__(node, record, failure, context, False)
        self._answer = answer

    def run(self) -> Verdict:
        """Obey the answer, or ask again where the state that it names has closed meanwhile."""
        answer = self._answer
        if self.stopped():
            return self._preempted()
        verdict = self._obey(answer)
        closed = ''
        if answer.kind is AnswerKind.GOTO and verdict.way is not None:
            closed = why_closed_on(verdict.way)
        return self._refuse(closed) if closed else verdict

    def _refuse(self, closed: str) -> Verdict:
        self._cause = 'cannot go to {}, as was answered: {} {}'.format(
            self._answer.state, self._answer.state, closed)
        self.warn(self._cause)
        # it does not run any more
        self._judge_anew(self._failure._replace(kind=FailureKind.TIME_LIMIT,
                                               text='was taken out while it still ran'))
        return self._end_unaided() if self._budget.why_over() else self._ask()
