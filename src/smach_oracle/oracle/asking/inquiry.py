"""Asking the expert until an answer fits or the deadline is over (paper, section V)."""

import threading
from typing import Any, Callable, List, Mapping, NamedTuple, Optional, Protocol

from smach_common.foreign import repr_of

from ..errors import AnswerError
from ..records.events import EventKind
from ..scope.background_call import BackgroundCall
from ..scope.scope import Scope
from .answer_rules import Target, addressed, check_answer, checked_type, choices_of
from .question import Answer, AnswerKind, Expert, Progress, Question

# how long past the deadline an expert is waited for before its question is taken back
_OVERTIME_S = 2.0
# how long an expert's port is waited for once its question has been taken back
_PATIENCE_S = 1.0
_MAX_PAUSE_S = 1.0  # between questions while the answers do not fit


class Asker(Protocol):
    """The recovery that asks: what an inquiry needs of it."""

    tried: List[str]  # what was tried already, in words. Runs of interfaces are added
    question_cancelled: threading.Event  # the question is to be taken back
    scope: Scope  # ends the recovery, as a preempt or a shutdown does

    def make_question(self, deadline_s: float) -> Question:
        """Return a new question about the failure. `deadline_s`: seconds left, 0 without end."""

    def say_that_it_waits(self, question: Question) -> None:
        """Log that the machine waits for an answer."""

    def states_now(self) -> Mapping[Target, str]:
        """Return where the machine could go, and why it cannot go there now, '' where it can."""

    def emit(self, kind: EventKind, **fields: Any) -> None:
        """Tell the observers."""

    def warn(self, text: str) -> None:
        """Log what the operator should know, and tell the observers."""


class Reply(NamedTuple):
    """The end of an inquiry: with an answer that fits, or without one."""

    answer: Optional[Answer]
    question_id: str = ''  # of the last question, '' where none was put
    why_none: str = ''


class _NoAnswer(Exception):
    """Nobody answers this question any more. It never leaves this module."""


class Inquiry:
    """All questions about one failure. They share one deadline, in monotonic time."""

    def __init__(self, asker: Asker, expert: Expert, deadline_s: float) -> None:
        """`deadline_s`: 0 waits without end."""
        self._asker = asker
        self._expert = expert
        self._scope = asker.scope
        self._now = asker.scope.clock.now
        self._end = self._now() + deadline_s if deadline_s else None
        self._cancelled = asker.question_cancelled
        self._unfit = 0
        self._question_id = ''

    def run(self) -> Reply:
        """Ask, and ask again while the answer does not fit, until the deadline."""
        try:
            return Reply(self._ask_until_it_fits(), self._question_id)
        except _NoAnswer as why:
            return Reply(None, self._question_id, str(why))

    def _ask_until_it_fits(self) -> Answer:
        while True:
            question = self._asker.make_question(self._remaining_s())
            self._question_id = question.question_id
            self._emit(EventKind.QUERY_OPENED, text=question.reason)
            self._asker.say_that_it_waits(question)
            answer = self._answer_to(question)
            if answer is not None:
                return answer
            self._pause()

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
        try:
            given = self._guarded(
                lambda progress: self._expert.ask(question, self._cancelled, progress)
            )
            if given is None:
                raise _NoAnswer('no answer by the deadline')
            answer = addressed(checked_type(given), choices_of(question))
            self._check(answer, question)
            self._emit(
                EventKind.QUERY_ANSWERED,
                outcome=answer.kind.name.lower(),
                target=answer.named(),
                by=answer.by,
                text=answer.why,
            )
            if answer.kind is AnswerKind.INTERFACE:
                return self._try_interface(answer, question)
            return answer
        except AnswerError as err:
            self._asker.warn('an answer does not fit: {}'.format(err))
            return None

    def _check(self, answer: Answer, question: Question) -> None:
        check_answer(answer, choices_of(question)._replace(states=self._asker.states_now()))

    def _guarded(self, call: Callable[[Progress], object]) -> Optional[object]:
        """Call the expert's port in a thread that can be left behind.

        What it raises beside AnswerError is its fault and no answer. What it tells or returns too
        late is dropped.
        """

        def progress(what: str, by: str, text: str) -> None:
            if not port.left:
                self._progress(what, by, text)

        port = BackgroundCall(lambda: call(progress), 'smach_oracle expert')
        port.start()
        try:
            self._wait_for(port)
        except BaseException:  # Ctrl-C in the machine's thread
            self._cancelled.set()
            port.leave()
            raise
        if not isinstance(port.error, Exception) or isinstance(port.error, AnswerError):
            if port.error is not None:
                raise port.error
            return port.result
        self._asker.warn("the expert's port failed: {}".format(repr_of(port.error)))
        raise _NoAnswer("the expert's port failed") from port.error

    def _wait_for(self, port: BackgroundCall) -> None:
        """Wait for the expert's port, and not long once its question has been taken back."""
        latest_s = None if self._end is None else self._end + _OVERTIME_S - self._now()
        if self._scope.wait(latest_s, port.done):
            return
        self._cancelled.set()
        patience = Scope(clock=self._scope.clock)  # in which nothing ends it
        if not patience.wait(_PATIENCE_S, port.done) and port.leave():
            self._asker.warn(
                "the expert's port goes on although its question was taken back; it is left behind"
            )
            raise _NoAnswer('no answer by the deadline')

    def _try_interface(self, answer: Answer, question: Question) -> Optional[Answer]:
        try:
            return self._run_interface(answer, question)
        except AnswerError as err:
            self._asker.tried.append('interface {}: {}'.format(answer.interface, err))
            self._asker.warn('interface {}: {}'.format(answer.interface, err))
            return None

    def _run_interface(self, answer: Answer, question: Question) -> Optional[Answer]:
        offer = next(offer for offer in question.interfaces if offer.name == answer.interface)
        self._emit(EventKind.INTERFACE_START, target=offer.name, by=answer.by)
        outcome, done = '', None
        try:
            given = self._guarded(
                lambda progress: self._expert.run_interface(
                    offer, question, self._cancelled, progress
                )
            )
            if given is not None:
                done = checked_type(given)
                self._check_done(done, question)
                outcome = done.outcome
        finally:
            self._emit(EventKind.INTERFACE_END, target=offer.name, by=answer.by, outcome=outcome)
        self._asker.tried.append('interface {}: {}'.format(offer.name, outcome or 'failed'))
        if done is None or done.by:
            return done
        return done._replace(by=answer.by)

    def _check_done(self, done: Answer, question: Question) -> None:
        if done.kind is not AnswerKind.SUPERSEDE:
            raise AnswerError('it gave {}, allowed: SUPERSEDE'.format(done.kind.name))
        self._check(done, question)

    def _progress(self, what: str, by: str, text: str) -> None:
        kinds = {'claimed': EventKind.QUERY_CLAIMED, 'released': EventKind.QUERY_RELEASED}
        if what in kinds:  # an interface's start and end are told by the oracle itself
            self._emit(kinds[what], by=by, text=text)

    def _emit(self, kind: EventKind, **fields: Any) -> None:
        self._asker.emit(kind, query_id=self._question_id, **fields)
