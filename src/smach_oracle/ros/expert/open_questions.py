"""Open questions: who asked what, who works on it, what was decided. No ROS calls, no threads.

Every method looks at the clock first, so that a lease or a deadline that has passed counts as
passed even where nobody has called `tick` since. News for the askers is collected as notices,
in order, until `take_notices` takes them. The caller serialises the calls.
"""

import math
import time
from collections import OrderedDict
from typing import Callable, Dict, List, NamedTuple, Optional

from smach_oracle.msg import (
    ExpertDecision,
    ExpertQueryFeedback,
    ExpertQueryGoal,
    ExpertQueryResult,
    OpenQuery,
)
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.srv import ClaimQueryRequest

from .answer_rules import check_decision, describe_decision, same_decision

LEASE_S = 15.0
LONGEST_LEASE_S = 3600.0
REMEMBERED = 1000
_UNKNOWN = 'there is no question'
_IDENTITY = ('robot', 'container_path', 'failed_state', 'interface')


class SettledQuestion(NamedTuple):
    """A question that has ended, and its end."""

    goal: ExpertQueryGoal  # once remembered: no more of it than identifies the question
    status: int  # ExpertQueryResult.ANSWERED, EXPIRED or CANCELLED
    decision: ExpertDecision  # kind 0 where there is none
    text: str  # for people


class QuestionNotice(NamedTuple):
    """News for the asker of a question."""

    query_id: str
    status: int  # ExpertQueryFeedback.PENDING, CLAIMED or INTERFACE_RUNNING. 0: it is settled
    by: str
    text: str
    settled: Optional[SettledQuestion] = None


class ClaimReply(NamedTuple):
    """The fields of ClaimQuery's response."""

    ok: bool
    message: str
    holder: str


class AnswerReply(NamedTuple):
    """The fields of AnswerQuery's response."""

    ok: bool
    message: str
    settled: ExpertDecision


class QuestionRefusedError(AnswerError):
    """A question that cannot be taken in. The text gives the reason."""


class OpenQuestion:
    """One question that waits, or whose interface runs. Times are in s, by the given clock."""

    def __init__(self, goal: ExpertQueryGoal, now_s: float) -> None:
        self.goal = goal
        self.opened_s = now_s
        expires = goal.deadline > 0 and not goal.interface
        self.deadline_s = now_s + goal.deadline if expires else math.inf
        self.holder = ''
        self.lease_until_s = math.inf

    @property
    def status(self) -> int:
        """Return PENDING, CLAIMED or INTERFACE_RUNNING, as in OpenQuery.msg."""
        if self.goal.interface:
            return OpenQuery.INTERFACE_RUNNING
        return OpenQuery.CLAIMED if self.holder else OpenQuery.PENDING

    def to_msg(self, now_s: float) -> OpenQuery:
        """Return the question as it stands in the open list."""
        return OpenQuery(
            query=self.goal,
            status=self.status,
            claimed_by=self.holder,
            age=now_s - self.opened_s,
            remaining=_remaining(self.deadline_s, now_s),
            lease_remaining=_remaining(self.lease_until_s, now_s),
        )


class OpenQuestions:
    """Open and settled questions by query id."""

    def __init__(
        self,
        lease_s: float = LEASE_S,
        remember: int = REMEMBERED,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._lease_s = lease_s
        self._remember = remember
        self._clock = clock
        self._open: Dict[str, OpenQuestion] = {}
        self._settled: 'OrderedDict[str, SettledQuestion]' = OrderedDict()
        self._notices: List[QuestionNotice] = []

    def __len__(self) -> int:
        return len(self._open)

    def listing(self) -> List[OpenQuery]:
        """Return the open list, oldest first, with the ages and remaining times of this moment."""
        self.tick()
        now_s = self._clock()
        return [
            question.to_msg(now_s)
            for question in sorted(self._open.values(), key=lambda each: each.opened_s)
        ]

    def open(self, goal: ExpertQueryGoal) -> Optional[SettledQuestion]:
        """Take a question in, or the same one again.

        A question that was taken back (or whose asker was thought gone) opens again.

        :returns: how it ended, where it is settled already, else None.
        :raises QuestionRefusedError: no id, a deadline that is no time, or another question's id.
        """
        self.tick()
        _check_goal(goal)
        known = self._open.get(goal.query_id)
        if known is not None:
            _check_same(known.goal, goal)
            return None
        settled = self._settled.get(goal.query_id)
        if settled is not None and not goal.interface:
            _check_same(settled.goal, goal)
            if settled.status != ExpertQueryResult.CANCELLED:
                return settled
        self._admit(goal, settled)
        return None

    def claim(self, action: int, query_id: str, expert: str, lease_s: float = 0.0) -> ClaimReply:
        """Carry out CLAIM, RENEW, RELEASE or TAKE_OVER, as in ClaimQuery.srv."""
        self.tick()
        question = self._open.get(query_id)
        if question is None:
            return ClaimReply(False, self._why_closed(query_id), '')
        problem = _claim_problem(question, action, expert, lease_s)
        if problem:
            return ClaimReply(False, problem, question.holder)
        if action == ClaimQueryRequest.RELEASE:
            self._release(question, '{} gave it back'.format(expert))
            return ClaimReply(True, '', '')
        return self._take_claim(question, expert, min(lease_s or self._lease_s, LONGEST_LEASE_S))

    def answer(self, query_id: str, decision: ExpertDecision) -> AnswerReply:
        """Settle a question, or say why not.

        The question stays open where the answer does not fit.
        """
        self.tick()
        question = self._open.get(query_id)
        settled = self._settled.get(query_id)
        if question is None or question.goal.interface:
            return self._answer_closed(query_id, settled, decision)
        try:
            check_decision(question.goal, decision)
        except AnswerError as err:
            return AnswerReply(False, str(err), ExpertDecision())
        if question.holder not in ('', decision.by):
            return AnswerReply(
                False,
                '{} works on this question; take it over first'.format(question.holder),
                ExpertDecision(),
            )
        self._settle(question, ExpertQueryResult.ANSWERED, decision, describe_decision(decision))
        return AnswerReply(True, '', decision)

    def close(self, query_id: str, why: str) -> None:
        """Close a question that the asker took back, or whose asker is gone.

        This also ends an interface that runs.
        """
        self.tick()
        question = self._open.get(query_id)
        if question is not None:
            self._settle(question, ExpertQueryResult.CANCELLED, ExpertDecision(), why)

    def tick(self) -> None:
        """Let leases and deadlines that have passed take effect."""
        now_s = self._clock()
        for question in list(self._open.values()):
            if now_s >= question.deadline_s:
                self._settle(
                    question,
                    ExpertQueryResult.EXPIRED,
                    ExpertDecision(),
                    'nobody answered by the deadline',
                )
            elif now_s >= question.lease_until_s:
                self._release(question, 'the claim of {} ran out'.format(question.holder))

    def next_due_s(self) -> float:
        """Return when the next lease or deadline passes, by the given clock.

        It is infinity where none will.
        """
        times = [
            min(question.deadline_s, question.lease_until_s) for question in self._open.values()
        ]
        return min(times, default=math.inf)

    def take_notices(self) -> List[QuestionNotice]:
        """Return the notices since the last call, oldest first."""
        notices, self._notices = self._notices, []
        return notices

    def _admit(self, goal: ExpertQueryGoal, settled: Optional[SettledQuestion]) -> None:
        question = OpenQuestion(goal, self._clock())
        self._open[goal.query_id] = question
        if not goal.interface:
            self._settled.pop(goal.query_id, None)
            self._notify(question, '')
            return
        if settled is not None:
            question.holder = settled.decision.by
        self._notify(question, goal.interface)

    def _take_claim(self, question: OpenQuestion, expert: str, lease_s: float) -> ClaimReply:
        before, question.holder = question.holder, expert
        question.lease_until_s = self._clock() + lease_s
        if before == expert:
            return ClaimReply(True, 'renewed', expert)
        message = 'taken over from {}'.format(before) if before else 'claimed'
        self._notify(question, message)
        return ClaimReply(True, message, expert)

    def _release(self, question: OpenQuestion, text: str) -> None:
        before, question.holder = question.holder, ''
        question.lease_until_s = math.inf
        if before:
            self._notices.append(
                QuestionNotice(question.goal.query_id, ExpertQueryFeedback.PENDING, before, text)
            )

    def _settle(
        self, question: OpenQuestion, status: int, decision: ExpertDecision, text: str
    ) -> None:
        goal = question.goal
        del self._open[goal.query_id]
        settled = SettledQuestion(goal, status, decision, text)
        self._notices.append(QuestionNotice(goal.query_id, 0, decision.by, text, settled))
        if goal.interface:
            return  # the answer that started the interface stays the question's settlement
        self._settled[goal.query_id] = settled._replace(goal=_identity(goal))
        while len(self._settled) > self._remember:
            self._settled.popitem(last=False)

    def _notify(self, question: OpenQuestion, text: str) -> None:
        self._notices.append(
            QuestionNotice(question.goal.query_id, question.status, question.holder, text)
        )

    def _answer_closed(
        self, query_id: str, settled: Optional[SettledQuestion], decision: ExpertDecision
    ) -> AnswerReply:
        if settled is None or settled.status != ExpertQueryResult.ANSWERED:
            return AnswerReply(False, self._why_closed(query_id), ExpertDecision())
        first = settled.decision
        if not same_decision(first, decision):
            return AnswerReply(False, self._why_closed(query_id), first)
        message = '{} was first with the same'.format(first.by)
        if first.by == decision.by:
            message = 'accepted before'
        return AnswerReply(True, message, first)

    def _why_closed(self, query_id: str) -> str:
        settled = self._settled.get(query_id)
        if settled is None:
            return '{} {!r} here'.format(_UNKNOWN, query_id)
        if settled.status == ExpertQueryResult.ANSWERED:
            return '{} was first: {}'.format(settled.decision.by, settled.text)
        return 'the question is closed: {}'.format(settled.text)


def is_unknown(message: str) -> bool:
    """Whether the message of a refused claim says that the server does not know the question.

    ClaimQuery.srv promises that such a message begins so, and no other.
    """
    return message.startswith(_UNKNOWN + ' ')


def _check_goal(goal: ExpertQueryGoal) -> None:
    if not goal.query_id:
        raise QuestionRefusedError('a question needs a query id')
    if not 0 <= goal.deadline < math.inf:
        raise QuestionRefusedError(
            'deadline {} is not allowed; allowed: seconds, 0 waits without end'.format(
                goal.deadline
            )
        )


def _identity(goal: ExpertQueryGoal) -> ExpertQueryGoal:
    """The goal without its userdata, history and the like.

    Thousands of them are remembered.
    """
    return ExpertQueryGoal(
        query_id=goal.query_id, **{field: getattr(goal, field) for field in _IDENTITY}
    )


def _check_same(known: ExpertQueryGoal, goal: ExpertQueryGoal) -> None:
    for field in _IDENTITY:
        if getattr(known, field) != getattr(goal, field):
            raise QuestionRefusedError(
                'query id {!r} belongs to another question, with {} {!r} instead of {!r}'.format(
                    goal.query_id, field, getattr(known, field), getattr(goal, field)
                )
            )


def _claim_problem(question: OpenQuestion, action: int, expert: str, lease_s: float) -> str:
    """Return why this claim cannot be, '' where it can."""
    if not expert.strip():
        return 'the claim does not say who claims: `expert` is empty'
    if not 0 <= lease_s < math.inf:
        return "lease {} is not allowed; allowed: seconds from 0 (the server's own setting)".format(
            lease_s
        )
    if action not in (
        ClaimQueryRequest.CLAIM,
        ClaimQueryRequest.RENEW,
        ClaimQueryRequest.RELEASE,
        ClaimQueryRequest.TAKE_OVER,
    ):
        return (
            'action {} is unknown; '
            'allowed: CLAIM (1), RENEW (2), RELEASE (3), TAKE_OVER (4)'.format(action)
        )
    if question.goal.interface:
        return 'interface {} runs for this question'.format(question.goal.interface)
    if action == ClaimQueryRequest.TAKE_OVER or question.holder == expert:
        return ''
    if question.holder:
        return '{} works on this question'.format(question.holder)
    return 'the claim has run out; claim again' if action == ClaimQueryRequest.RENEW else ''


def _remaining(until_s: float, now_s: float) -> float:
    return -1.0 if until_s == math.inf else max(0.0, until_s - now_s)
