"""A state that the oracle has entered and that takes much longer than ever before.

Without an oracle the machine might have ended before it came to this state. A state without a time
limit is never abandoned, so a person is asked, while it runs, whether to wait on.
"""

import threading
from typing import Any, List, Mapping, NamedTuple, Optional

import smach

from ..asking.answer_rules import Target
from ..asking.inquiry import Inquiry, Reply
from ..asking.question import Answer, AnswerKind, Expert, Question
from ..decision.sentence import ran_in_words, still_running_sentence
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..machine.workers import request_preempt
from ..records.events import EventKind, FailureKind
from ..scope.clock import Flag, PausableClock
from ..scope.scope import Reason, Scope, inside, standing_still
from .failure import Failure
from .question_making import Account, make_question, targets_of
from .stop import in_words


class EndedByAnswer(NamedTuple):
    """Stands in place of the outcome of a state that an answer ended while it still ran."""

    answer: Answer
    failure: Failure  # as if it had failed, for giving up as the failure would
    outcome: Any
    error: Optional[Exception]


class WatchedVisit:
    """One visit of a state that the oracle has entered.

    The machine's thread runs the state. The tree's alarm clock tells when it has run too long. Each
    question has a thread of its own, in which this is an `inquiry.Asker`.
    """

    def __init__(self, node: TreeNode, record: StateRecord) -> None:
        clock = node.tree.scope.clock
        self._node = node
        self._machine = node.machine
        self._record = record
        self._state: smach.State = node.machine._states[record.label]
        self._time = PausableClock(clock)  # stands still while a person is asked inside
        self._run = Scope(clock=clock, time=self._time)
        self._now = clock.now
        self._begun_s = clock.now()
        self._lock = threading.Lock()
        self._ended = Flag()
        self._due_s = 0.0  # of the run's own time: it is asked about then
        self.scope: Scope = node.tree.scope  # while it asks, one that ends with the visit
        self._answer: Optional[Answer] = None
        self._open_id = ''  # of the question that is open
        self._answered = False  # by who wants the state to end. It has no effect before `_answer`
        self._budget = node.tree.budget
        self.tried: List[str] = []
        self.question_cancelled = threading.Event()

    def execute(self, userdata: smach.Remapper) -> object:
        """Execute the state, and return its outcome, or an EndedByAnswer.

        It raises what the state raises.
        """
        node = self._node
        under_way = node.tree.workers.under_way
        under_way[id(self._state)] = self._run
        settings = node.settings
        longest_s = self._record.longest_s or 0.0
        due_s = max(settings.still_running_s, settings.still_running_factor * longest_s)
        self._ask_at(due_s)
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
        self.scope.wake()
        self._node.tree.alarms.forget(self._ring)
        self.question_cancelled.set()
        self._close('{} has ended'.format(self._record.label))
        if self._answered and self._answer is None and not self._machine.preempt_requested():
            self.warn('{} has ended by itself; the answer is not used'.format(self._record.label))
        return self._answer

    def _ran_s(self) -> float:
        return self._now() - self._begun_s

    # -- asking, in threads of its own

    def _ask_at(self, due_s: float) -> None:
        """Ask once the state has run so long. Its time may stand still meanwhile."""
        with self._lock:
            self._due_s = due_s
            if not self._ended.is_set():
                left_s = self._time.left_s(due_s)
                self._node.tree.alarms.ring_in(left_s, self._ring)

    def _ring(self) -> None:
        if self._time.left_s(self._due_s):
            self._ask_at(self._due_s)
        else:
            threading.Thread(
                target=self._ask, name='smach_oracle still running', daemon=True
            ).start()

    def _ask(self) -> None:
        if self._asks_again():
            self._ask_at(self._time.now() + self._ran_s())  # once it has run twice as long

    def _look_for_end(self) -> Optional[Reason]:
        return Reason.ENDED if self._ended.is_set() else None

    def _asks_again(self) -> bool:
        """Ask. Return whether to do so again, if it runs on."""
        expert = self._node.tree.expert if self._node.in_force.policy.asks else None
        self.scope = Scope(self._node.execution.scope, look=self._look_for_end)
        if self.scope.reason is not None:
            return False
        spent = '' if expert is None else self._budget.why_over() or self._budget.take_question()
        if expert is None or spent:
            self.warn(self._sentence() + (' Nobody is asked: ' + spent if spent else ''))
            return False
        reply = self._inquire(expert)
        reason = self.scope.reason
        if reason is not None:
            if not self._ended.is_set():
                self._node.tree.early_end.end_at_shutdown()
                self._close(in_words(reason, self._node))
            return False
        if reply.answer is None:
            why_over = self._budget.why_over()
            self._expire('; '.join(filter(None, (reply.why_none, why_over))))
            return not why_over
        if self._is_wait_on(reply.answer):
            smach.loginfo('{}: {} waits on'.format(self._place(), reply.answer.by or 'the expert'))
            return True
        self._take_out(reply.answer)
        return False

    def _inquire(self, expert: Expert) -> Reply:
        # the state runs on, and so do the time limits around it. Whoever looks whether a state
        # around still runs has its answer in this question
        watched = [run for run in self._node.execution.runs_around if run.limit_s is None]
        with standing_still(watched), self._node.tree.early_end.asking():
            return Inquiry(self, expert, self._budget.within(0.0)[0]).run()

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
            self.warn(
                'does not heed its preempt and still runs; the machine waits for its end, '
                'and then goes as answered'
            )

    # -- its question

    def make_question(self, deadline_s: float) -> Question:
        """Return a new question about the state. `deadline_s`: seconds left, 0 without end."""
        ran = ran_in_words(self._ran_s(), self._record.longest_s)
        question = make_question(
            self._node,
            self._record,
            self._failure(),
            Account(False, 'it still runs after ' + ran, (), (), 'it runs on'),
            deadline_s,
        )
        with self._lock:
            self._open_id = question.question_id
        # no interface can do the work of a state that runs, and no function of a user's is called
        # meanwhile
        choices = tuple(
            choice._replace(blocked='', repeats=())
            if (choice.container, choice.state) == ('', self._record.label)
            else choice
            for choice in question.choices
        )  # its own name means to wait on
        return question._replace(choices=choices, interfaces=(), preconditions=None)

    def _failure(self) -> Failure:
        return Failure(self._record.label, FailureKind.STILL_RUNNING, '', self._sentence(), None)

    def _sentence(self) -> str:
        return still_running_sentence(self._record.label, self._ran_s(), self._record.longest_s)

    def say_that_it_waits(self, question: Question) -> None:
        """Log that somebody is asked, while the state runs on."""
        smach.logwarn(
            '{}: {} The expert is asked (question {})'.format(
                self._place(), self._sentence(), question.question_id
            )
        )

    def states_now(self) -> Mapping[Target, str]:
        """Return where the machine could go, and why it cannot go there now, '' where it can."""
        return {**targets_of(self._node), ('', self._record.label): ''}

    def _close(self, why: str) -> None:
        """Tell that the question, if one is open, was taken back."""
        question_id = self._take_open()
        if question_id:
            self.emit(EventKind.QUERY_CANCELLED, query_id=question_id, text=why)

    def _expire(self, why: str) -> None:
        question_id = self._take_open()
        if question_id:
            self.emit(EventKind.QUERY_EXPIRED, query_id=question_id, text=why + '; it runs on')

    def _take_open(self) -> str:
        with self._lock:
            question_id, self._open_id = self._open_id, ''
        return question_id

    def emit(self, kind: EventKind, **fields: Any) -> None:
        """Tell the observers of a step that is about the state."""
        if kind is EventKind.QUERY_ANSWERED and not self._note_answer(fields):
            smach.logwarn('{}: the answer came too late and is not used'.format(self._place()))
            return
        self._node.emit(kind, state=self._record.label, **fields)

    def _note_answer(self, fields: Mapping[str, object]) -> bool:
        """Close the question, as it is answered. Return False where it was taken back before."""
        waits_on = (fields.get('outcome'), fields.get('target')) == (
            AnswerKind.GOTO.name.lower(),
            self._record.label,
        )
        with self._lock:
            is_open, self._open_id = bool(self._open_id), ''
            self._answered = is_open and not waits_on
        return is_open

    def warn(self, text: str) -> None:
        """Log what the operator should know of this visit, and tell the observers."""
        self._node.warn(text, self._record.label)

    def _place(self) -> str:
        return '{}/{}'.format(self._node.path, self._record.label)
