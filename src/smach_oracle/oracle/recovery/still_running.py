"""A state that the oracle has entered and that takes much longer than ever before.

Without an oracle the machine might have ended before it came to this state. A state without a time
limit is never abandoned, so a person is asked, while it runs, whether to wait on.
"""

import threading
from functools import partial
from typing import NamedTuple, Optional

import smach

from ..asking.question import Answer, AnswerKind
from ..decision.sentence import ran_in_words, still_running_sentence
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..machine.workers import request_preempt
from ..records.events import EventKind, FailureKind
from ..scope.clock import Flag, PausableClock
from ..scope.scope import Reason, Scope, inside, standing_still
from ..smach_private import states_of
from .failure import Failure
from .inquiry import Inquiry
from .occasions import still_running
from .recovery import Recovery


class EndedByAnswer(NamedTuple):
    """Stands in place of the outcome of a state that an answer ended while it still ran."""

    answer: Answer
    failure: Failure  # as if it had failed, for giving up as the failure would
    outcome: object
    error: Optional[Exception]


class WatchedVisit:
    """One visit of a state that the oracle has entered.

    The machine's thread runs the state. The tree's alarm clock tells when it has run too long. Each
    question has a thread of its own, and a recovery that ends with the visit.
    """

    def __init__(self, node: TreeNode, record: StateRecord) -> None:
        clock = node.tree.scope.clock
        self._node = node
        self._record = record
        self._state = states_of(node.machine)[record.label]
        self._time = PausableClock(clock)  # stands still while a person is asked inside
        self._run = Scope(clock=clock, time=self._time)
        self._now = clock.now
        self._begun_s = clock.now()
        self._lock = threading.Lock()
        self._ended = Flag()
        self._due_s = 0.0  # of the run's own time: it is asked about then
        self._recovery: Optional[Recovery] = None  # that asks now
        self._closed_id = ''  # of its latest question that is not open any more
        self._answer: Optional[Answer] = None
        self._answered = False  # by who wants the state to end. It has no effect before `_answer`

    def execute(self, userdata: smach.Remapper) -> object:
        """Execute the state, and return its outcome, or an EndedByAnswer.

        It raises what the state raises.
        """
        under_way = self._node.tree.workers.under_way
        under_way[id(self._state)] = self._run
        settings = self._node.settings
        longest_s = self._record.longest_s or 0.0
        self._ask_at(max(settings.still_running_s, settings.still_running_factor * longest_s))
        outcome, error = None, None
        try:
            with inside(self._run):
                outcome = self._state.execute(userdata)
        except Exception as err:
            error = err
        finally:
            under_way.pop(id(self._state), None)
            answer = self._end()
        if answer is not None:
            return EndedByAnswer(answer, self._failure(), outcome, error)
        if error is not None:
            raise error
        return outcome

    def _end(self) -> Optional[Answer]:
        """The state has ended: close the question. Return the answer that has ended it, if any."""
        with self._lock:
            self._ended.set()
            recovery = self._recovery
        self._node.tree.alarms.forget(self._ring)
        if recovery is not None:
            recovery.cancel(Reason.ENDED)
            text = '{} has ended'.format(self._record.label)
            self._close(recovery, EventKind.QUERY_CANCELLED, text)
        preempted = self._node.machine.preempt_requested()
        if self._answered and self._answer is None and not preempted:
            self._warn('{} has ended by itself; the answer is not used'.format(self._record.label))
        return self._answer

    # -- asking, in threads of its own

    def _ask_at(self, due_s: float) -> None:
        """Ask once the state has run so long. Its time may stand still meanwhile."""
        with self._lock:
            self._due_s = due_s
            if not self._ended.is_set():
                self._node.tree.alarms.ring_in(self._time.left_s(due_s), self._ring)

    def _ring(self) -> None:
        if self._time.left_s(self._due_s):
            self._ask_at(self._due_s)
        else:
            threading.Thread(
                target=self._ask, name='smach_oracle still running', daemon=True
            ).start()

    def _ask_later(self) -> None:
        self._ask_at(self._time.now() + self._ran_s())  # once it has run twice as long

    def _ask(self) -> None:
        node, failure = self._node, self._failure()
        scope = Scope(node.execution.scope)
        recovery = Recovery(node, self._record, still_running(failure), scope=scope)
        recovery.takes = partial(self._takes, recovery)
        recovery.begin_question = self._begin_question
        with self._lock:
            self._recovery = recovery
            if self._ended.is_set():
                return
        if recovery.stopped():
            return
        expert, budget = node.tree.expert if node.in_force.policy.asks else None, recovery.budget
        spent = '' if expert is None else budget.why_over() or budget.take_question()
        if expert is None or spent:
            self._warn(failure.text + (' Nobody is asked: ' + spent if spent else ''))
            return
        # the state runs on, and so do the time limits around it. Whoever looks whether a state
        # around still runs has its answer in this question
        watched = [run for run in node.execution.runs_around if run.limit_s is None]
        with standing_still(watched), node.tree.early_end.asking():
            answer = Inquiry(recovery, expert, budget.within(0.0)[0]).run()
        if recovery.stopped():
            if not self._ended.is_set():
                node.tree.early_end.end_at_shutdown()
                self._close(recovery, EventKind.QUERY_CANCELLED, recovery.why_taken_back())
        elif answer is None:
            why_over = budget.why_over()
            why = '; '.join(filter(None, (recovery.why_no_answer, why_over)))
            self._close(recovery, EventKind.QUERY_EXPIRED, why + '; it runs on')
            if not why_over:
                self._ask_later()
        elif self._is_wait_on(answer):
            smach.loginfo('{}: {} waits on'.format(self._place(), answer.by or 'the expert'))
            self._ask_later()
        else:
            self._take_out(answer)

    def _is_wait_on(self, answer: Answer) -> bool:
        return (
            answer.kind is AnswerKind.GOTO
            and answer.state == self._record.label
            and answer.container in ('', self._node.path)
        )

    def _take_out(self, answer: Answer) -> None:
        """Preempt the state. Once it has ended, the machine goes as answered."""
        with self._lock:
            if self._ended.is_set():
                return
            self._answer = answer
            smach.logwarn(
                '{}: is preempted, as {} answered {} {}'.format(
                    self._place(),
                    answer.by or 'the expert',
                    answer.kind.name.lower(),
                    answer.named(),
                ).rstrip()
            )
            request_preempt(self._state)
        if not Scope(clock=self._run.clock).wait(self._record.settings.grace_period_s, self._ended):
            self._warn(
                'does not heed its preempt and still runs; the machine waits for its end, '
                'and then goes as answered'
            )

    # -- its question

    def _failure(self) -> Failure:
        sentence = still_running_sentence(self._record.label, self._ran_s(), self._record.longest_s)
        return Failure(self._record.label, FailureKind.STILL_RUNNING, '', sentence)

    def _begin_question(self, recovery: Recovery) -> None:
        """Say in the next question how long the state has run by then."""
        recovery.failure = self._failure()
        ran = ran_in_words(self._ran_s(), self._record.longest_s)
        recovery.cause = 'it still runs after ' + ran

    def _takes(self, recovery: Recovery, answer: Answer) -> bool:
        """Close the question, as it is answered. Return False where it was taken back before."""
        with self._lock:
            is_open = bool(self._take_open(recovery))
            self._answered = is_open and not self._is_wait_on(answer)
        if not is_open:
            smach.logwarn('{}: the answer came too late and is not used'.format(self._place()))
        return is_open

    def _close(self, recovery: Recovery, kind: EventKind, text: str) -> None:
        """Tell how the question, if one is open, has ended."""
        with self._lock:
            question_id = self._take_open(recovery)
        if question_id:
            recovery.tell(kind, text=text, query_id=question_id)

    def _take_open(self, recovery: Recovery) -> str:
        """Return the id of the question that is open, once, '' for none."""
        question_id = recovery.question_id
        closed_id, self._closed_id = self._closed_id, question_id
        return '' if question_id == closed_id else question_id

    def _ran_s(self) -> float:
        return self._now() - self._begun_s

    def _warn(self, text: str) -> None:
        self._node.warn(text, self._record.label)

    def _place(self) -> str:
        return '/'.join((self._node.path, self._record.label))
