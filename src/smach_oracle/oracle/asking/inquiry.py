"""Asking the expert, until there is an answer that fits or the deadline is over (paper, section V)."""
import threading
import time
from typing import Any, Callable, Dict, Optional

import smach

from .errors import AnswerError, InterfaceError
from .events import EventKind
from .question import Answer, AnswerKind, Expert, Question, names
from .question_making import make_question
from .verdict import Verdict, VerdictKind

_WATCH_PERIOD_S = 0.05  # how soon a shutdown is noticed while a question is open
_OVERTIME_S = 2.0  # how long past the deadline an expert is waited for before its question is taken back
_MAX_PAUSE_S = 1.0  # between questions while the answers do not fit


class _StopWatch:
    """Sets `cancelled` at a shutdown, and when an expert has not come back long after the deadline."""

    def __init__(self, cancelled: threading.Event, end: Optional[float]) -> None:
        self._cancelled = cancelled
        self._latest = None if end is None else end + _OVERTIME_S
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name='smach_oracle shutdown watch', daemon=True)

    def __enter__(self) -> '_StopWatch':
        self._thread.start()
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._over.set()

    def _watch(self) -> None:
        while not self._over.wait(_WATCH_PERIOD_S):
            if smach.is_shutdown() or (self._latest is not None and time.monotonic() > self._latest):
                self._cancelled.set()
                return


class _NoAnswer(Exception):
    """Nobody answers this question any more; never leaves this module."""


class Inquiry:
    """All questions about one failure; they share one deadline, in monotonic time."""

    def __init__(self, recovery: Any, expert: Expert) -> None:
        self._recovery = recovery
        self._ledger = recovery.ledger
        self._machine = recovery.machine
        self._expert = expert
        deadline_s = self._ledger.settings.deadline_s
        self._end = time.monotonic() + deadline_s if deadline_s else None
        self._cancelled: threading.Event = recovery.query_cancelled
        self._unfit = 0
        self._query_id = ''

    def run(self) -> Verdict:
        """Ask, and ask again while the answer does not fit; fall back at the deadline."""
        try:
            with _StopWatch(self._cancelled, self._end):
                verdict = self._ask_until_it_fits()
        except _NoAnswer as why:
            if self._recovery.stopped():
                return self._taken_back()
            fallback = self._recovery.fallback_in_words()
            self._emit(EventKind.QUERY_EXPIRED, text='{}; fallback: {}'.format(why, fallback))
            return self._recovery.fall_back(str(why))
        return self._taken_back() if self._recovery.stopped() else verdict

    def _ask_until_it_fits(self) -> Verdict:
        while True:
            question = make_question(self._recovery, self._ledger.tree.next_query_id(), self._remaining_s())
            self._query_id = question.query_id
            self._emit(EventKind.QUERY_OPENED, text=question.reason)
            self._say_that_it_waits(question)
            verdict = self._settled(question)
            if verdict is not None:
                return verdict._replace(query_id=question.query_id)
            self._pause()

    def _say_that_it_waits(self, question: Question) -> None:
        """In the log: a machine that stands still for minutes looks as if it hung."""
        fallback = ' '.join(self._ledger.settings.on_no_answer).strip()
        limit = 'within {:.0f} s: {}'.format(question.deadline_s, fallback) if question.deadline_s else 'it waits on'
        smach.logwarn('{}/{}: the expert is asked (question {}); without an answer {}'.format(
            self._ledger.path, self._recovery.label, question.query_id, limit))

    def _remaining_s(self) -> float:
        if self._recovery.stopped():
            raise _NoAnswer('taken back')
        if self._end is None:
            return 0.0
        remaining_s = self._end - time.monotonic()
        if remaining_s <= 0:
            raise _NoAnswer('no answer by the deadline')
        return remaining_s

    def _pause(self) -> None:
        """Give a front end that answers nonsense at full speed less and less to do."""
        self._unfit += 1
        pause_s = 0.0 if self._unfit == 1 else min(_MAX_PAUSE_S, 0.05 * 2.0 ** min(self._unfit, 10))
        self._cancelled.wait(pause_s if self._end is None else min(pause_s, self._remaining_s()))

    def _settled(self, question: Question) -> Optional[Verdict]:
        """Return the verdict of one question, None where its answer did not fit."""
        try:
            answer = self._guarded(lambda: self._expert.ask(question, self._cancelled, self._progress))
            if answer is None:
                raise _NoAnswer('no answer by the deadline')
            self._check(answer, question)
            self._emit(EventKind.QUERY_ANSWERED, outcome=answer.kind.name.lower(), target=_named(answer),
                       by=answer.by, text=answer.why)
            if answer.kind is AnswerKind.INTERFACE:
                return self._try_interface(answer, question)
            return self._obey(answer)
        except AnswerError as err:
            self._ledger.warn('an answer does not fit: {}'.format(err), self._recovery.label)
            return None

    def _try_interface(self, answer: Answer, question: Question) -> Optional[Verdict]:
        try:
            return self._run_interface(answer, question)
        except InterfaceError as err:
            self._ledger.warn('interface {}: {}'.format(answer.interface, err), self._recovery.label)
            return None

    def _guarded(self, call: Callable[[], Optional[Answer]]) -> Optional[Answer]:
        """Call the expert's port; what it raises beside AnswerError is its fault and no answer."""
        try:
            return call()
        except AnswerError:
            raise
        except Exception as err:
            self._ledger.warn('the expert\'s port failed: {!r}'.format(err), self._recovery.label)
            raise _NoAnswer('the expert\'s port failed') from err

    def _run_interface(self, answer: Answer, question: Question) -> Optional[Verdict]:
        offer = next(offer for offer in question.interfaces if offer.name == answer.interface)
        self._emit(EventKind.INTERFACE_START, target=offer.name, by=answer.by)
        done: Optional[Answer] = None
        try:
            done = self._guarded(lambda: self._expert.run_interface(offer, question, self._cancelled, self._progress))
        except InterfaceError as err:
            self._recovery.tried.append('interface {}: {}'.format(offer.name, err))
            raise
        finally:
            self._emit(EventKind.INTERFACE_END, target=offer.name, by=answer.by,
                       outcome=done.outcome if done is not None else '')
        if done is None:
            self._recovery.tried.append('interface {}: failed'.format(offer.name))
            return None
        self._check(done, question)
        if done.kind is not AnswerKind.SUPERSEDE:
            raise AnswerError('interface {} gave {}, allowed: SUPERSEDE'.format(offer.name, done.kind.name))
        self._recovery.tried.append('interface {}: {}'.format(offer.name, done.outcome))
        return self._obey(done if done.by else done._replace(by=answer.by))

    def _obey(self, answer: Answer) -> Verdict:
        self._write(answer)
        if answer.kind is AnswerKind.GOTO:
            return self._recovery.jump(answer.state, answer.by, answer.why)
        if answer.kind is AnswerKind.SUPERSEDE:
            return Verdict(VerdictKind.SUPERSEDE, outcome=answer.outcome, by=answer.by, text=answer.why)
        verdict: Verdict = self._recovery.give_up(answer.why, answer.outcome, answer.by)
        return verdict

    def _write(self, answer: Answer) -> None:
        remapping = self._machine._remappings.get(self._recovery.label) or {}
        for key, value in (answer.outputs or {}).items():
            self._recovery.watch.gate[remapping.get(key, key)] = value

    def _check(self, answer: Answer, question: Question) -> None:
        problem = _CHECKS[answer.kind](self._recovery, answer, question)
        if problem:
            raise AnswerError('{} {!r}: {}'.format(answer.kind.name, _named(answer), problem))
        unknown = sorted(set(answer.outputs or {}) - set(question.output_keys))
        if unknown:
            raise AnswerError('outputs {}: the output keys are {}'.format(names(unknown), names(question.output_keys)))

    def _progress(self, what: str, by: str, text: str) -> None:
        kinds = {'claimed': EventKind.QUERY_CLAIMED, 'released': EventKind.QUERY_RELEASED}
        if what in kinds:  # an interface's start and end are told by the oracle itself
            self._emit(kinds[what], by=by, text=text)

    def _taken_back(self) -> Verdict:
        if self._query_id:
            self._emit(EventKind.QUERY_CANCELLED, text='preempted' if self._recovery.cancelled.is_set() else 'shutdown')
        verdict: Verdict = self._recovery.preempted()
        return verdict

    def _emit(self, kind: EventKind, **fields: Any) -> None:
        self._ledger.emit(kind, state=self._recovery.label, query_id=self._query_id, **fields)


def _check_goto(recovery: Any, answer: Answer, question: Question) -> str:
    problem: str = recovery.why_not_enter(answer.state)
    return problem


def _check_supersede(recovery: Any, answer: Answer, question: Question) -> str:
    allowed = [choice.outcome for choice in question.supersede_outcomes]
    return '' if answer.outcome in allowed else 'the outcomes that lead somewhere are ' + names(allowed)


def _check_give_up(recovery: Any, answer: Answer, question: Question) -> str:
    if not answer.outcome or answer.outcome in question.give_up_outcomes:
        return ''
    return 'the outcomes of the container are ' + names(question.give_up_outcomes)


def _check_interface(recovery: Any, answer: Answer, question: Question) -> str:
    offered = [offer.name for offer in question.interfaces]
    return '' if answer.interface in offered else 'the interfaces on offer are ' + names(offered)


_CHECKS: Dict[AnswerKind, Callable[[Any, Answer, Question], str]] = {
    AnswerKind.GOTO: _check_goto,
    AnswerKind.SUPERSEDE: _check_supersede,
    AnswerKind.GIVE_UP: _check_give_up,
    AnswerKind.INTERFACE: _check_interface,
}


def _named(answer: Answer) -> str:
    return {AnswerKind.GOTO: answer.state, AnswerKind.INTERFACE: answer.interface}.get(answer.kind, answer.outcome)
