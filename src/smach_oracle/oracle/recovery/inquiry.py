"""Asking the expert until an answer fits or the deadline is over (paper, section V)."""

import threading
from typing import Callable, Optional

import smach
from smach_common.foreign import repr_of

from ..asking.answer_rules import addressed, check_answer, checked_type, choices_of
from ..asking.question import Answer, AnswerKind, Expert, Progress, Question
from ..errors import AnswerError
from ..records.events import EventKind
from ..scope.background_call import BackgroundCall
from ..scope.scope import Scope
from .falling_back import fallback_in_short
from .question_making import make_question, targets_of
from .recovery import Recovery

# how long past the deadline an expert is waited for before its question is taken back
_OVERTIME_S = 2.0
# how long an expert's port is waited for once its question has been taken back
_PATIENCE_S = 1.0
_MAX_PAUSE_S = 1.0  # between questions while the answers do not fit
_TOLD = {'claimed': EventKind.QUERY_CLAIMED, 'released': EventKind.QUERY_RELEASED}


class _NoAnswer(Exception):
    """Nobody answers this question any more. It never leaves this module."""


class Inquiry:
    """All questions of one recovery. They share one deadline, in monotonic time."""

    def __init__(self, recovery: Recovery, expert: Expert, deadline_s: float) -> None:
        """`deadline_s`: 0 waits without end."""
        self._recovery = recovery
        self._expert = expert
        self._scope = recovery.scope
        self._now = recovery.scope.clock.now
        self._end = self._now() + deadline_s if deadline_s else None
        self._cancelled = recovery.question_cancelled = threading.Event()
        self._unfit = 0

    def run(self) -> Optional[Answer]:
        """Ask, and ask again while the answer does not fit, until the deadline.

        Where nobody answers, `recovery.why_no_answer` says why.
        """
        try:
            while True:
                left_s = self._remaining_s()
                self._recovery.begin_question(self._recovery)
                question = make_question(self._recovery, left_s)
                self._recovery.question_id = question.question_id
                self._tell(EventKind.QUERY_OPENED, text=question.reason)
                _say_that_it_waits(self._recovery, question)
                answer = self._answer_to(question)
                if answer is not None:
                    return answer
                self._pause()
        except _NoAnswer as why:
            self._recovery.why_no_answer = str(why)
            return None

    def _remaining_s(self) -> float:
        if self._scope.reason is not None:
            raise _NoAnswer('taken back')
        if self._end is None:
            return 0.0
        remaining_s = self._end - self._now()
        if remaining_s <= 0:
            raise _NoAnswer('no answer by the deadline')
        return remaining_s

    def _pause(self) -> None:
        """Give a front end that answers nonsense at full speed less and less to do."""
        self._unfit += 1
        pause_s = 0.0
        if self._unfit > 1:
            pause_s = min(_MAX_PAUSE_S, 0.05 * 2.0 ** min(self._unfit, 10))
        self._scope.wait(pause_s if self._end is None else min(pause_s, self._remaining_s()))

    def _answer_to(self, question: Question) -> Optional[Answer]:
        """Return the answer to one question, None where it did not fit."""
        recovery, cancelled = self._recovery, self._cancelled
        try:
            given = self._guarded(lambda told: self._expert.ask(question, cancelled, told))
            if given is None:
                raise _NoAnswer('no answer by the deadline')
            answer = addressed(checked_type(given), choices_of(question))
            self._check(answer, question)
            is_taken = recovery.takes(answer)
            if is_taken:
                self._tell(
                    EventKind.QUERY_ANSWERED,
                    outcome=answer.kind.name.lower(),
                    target=answer.named(),
                    by=answer.by,
                    text=answer.why,
                )
            if is_taken and answer.kind is AnswerKind.INTERFACE:
                return self._try_interface(answer, question)
            return answer
        except AnswerError as err:
            recovery.warn('an answer does not fit: {}'.format(err))
            return None

    def _check(self, answer: Answer, question: Question) -> None:
        check_answer(answer, choices_of(question)._replace(states=targets_of(self._recovery)))

    def _guarded(self, call: Callable[[Progress], Optional[Answer]]) -> object:
        """Call the expert's port in a thread that can be left behind.

        What it raises beside AnswerError is its fault and no answer. What it tells or returns too
        late is dropped.
        """

        def progress(what: str, by: str, text: str) -> None:
            # an interface's start and end are told by the oracle itself
            if what in _TOLD and not port.was_left_behind:
                self._tell(_TOLD[what], by=by, text=text)

        port = BackgroundCall(lambda: call(progress), 'smach_oracle expert')
        port.start()
        try:
            self._wait_for(port)
        except BaseException:  # Ctrl-C in the machine's thread
            self._cancelled.set()
            port.leave_behind()
            raise
        if not isinstance(port.error, Exception) or isinstance(port.error, AnswerError):
            if port.error is not None:
                raise port.error
            return port.result
        self._recovery.warn("the expert's port failed: {}".format(repr_of(port.error)))
        raise _NoAnswer("the expert's port failed") from port.error

    def _wait_for(self, port: BackgroundCall) -> None:
        """Wait for the expert's port, and not long once its question has been taken back."""
        latest_s = None if self._end is None else self._end + _OVERTIME_S - self._now()
        if self._scope.wait(latest_s, port.done):
            return
        self._cancelled.set()
        patience = Scope(clock=self._scope.clock)  # in which nothing ends it
        patience.wait(_PATIENCE_S, port.done)
        if port.leave_behind():
            self._recovery.warn(
                "the expert's port goes on although its question was taken back; it is left behind"
            )
            raise _NoAnswer('no answer by the deadline')

    def _try_interface(self, answer: Answer, question: Question) -> Optional[Answer]:
        try:
            return self._run_interface(answer, question)
        except AnswerError as err:
            told = 'interface {}: {}'.format(answer.interface, err)
            self._recovery.tried.append(told)
            self._recovery.warn(told)
            return None

    def _run_interface(self, answer: Answer, question: Question) -> Optional[Answer]:
        offer = next(offer for offer in question.interfaces if offer.name == answer.interface)
        run, cancelled, by = self._expert.run_interface, self._cancelled, answer.by
        self._tell(EventKind.INTERFACE_START, target=offer.name, by=by)
        outcome = ''
        try:
            given = self._guarded(lambda told: run(offer, question, cancelled, told))
            if given is None:
                self._recovery.tried.append('interface {}: failed'.format(offer.name))
                return None
            done = addressed(checked_type(given), choices_of(question))
            if done.kind is not AnswerKind.SUPERSEDE:
                raise AnswerError('it gave {}, allowed: SUPERSEDE'.format(done.kind.name))
            self._check(done, question)
            outcome = done.outcome
        finally:
            self._tell(EventKind.INTERFACE_END, target=offer.name, by=by, outcome=outcome)
        return done if done.by else done._replace(by=by)

    def _tell(self, kind: EventKind, **fields: str) -> None:
        self._recovery.tell(kind, query_id=self._recovery.question_id, **fields)


def _say_that_it_waits(recovery: Recovery, question: Question) -> None:
    """Log that somebody is asked: for minutes a machine that waits would look as if it hung."""
    place = '/'.join((recovery.node.path, recovery.record.label))
    if recovery.failure.still_runs:
        text = '{}: {} The expert is asked (question {})'
        smach.logwarn(text.format(place, recovery.failure.text, question.question_id))
        return
    limit = 'it waits on'
    if question.deadline_s:
        limit = 'within {:.0f} s: {}'.format(question.deadline_s, fallback_in_short(recovery))
    smach.logwarn(
        '{}: the expert is asked (question {}); without an answer {}'.format(
            place, question.question_id, limit
        )
    )
