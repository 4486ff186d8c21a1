"""One recovery under way: what its phases share, and how it ends early."""

import contextlib
import threading
from typing import Any, Iterator, List, Mapping, Optional

import smach

from ..asking.answer_rules import Target
from ..asking.question import Question
from ..decision.policy import Action
from ..decision.sentence import cause_of
from ..machine.jump_path import JumpPath
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..records.events import EventKind
from ..scope.scope import Reason
from .deciding import Decided, Deciding
from .endings import ContainerEnding, natural_ending, preempted_ending
from .failure import Failure
from .falling_back import fallback_in_short, fallback_in_words
from .occasions import Occasion
from .question_making import Account, make_question, targets_of
from .stop import RecoveryStop, preempt_beside
from .verdict import GiveUp, JumpTo, Preempted, Verdict

KEPT = (
    'nobody has said how the trial goes on ({}). The machine stops where it stands, and the '
    'trial is kept. The next start asks again. `oracle_run --resume` asks only before a state '
    'that on_retry protects, if the script has changed (unless --resume-map says how), and if '
    'the store may have lost something. `oracle_state {} drop` ends the trial'
)


class Recovering:
    """What the phases of one recovery share.

    They run in the machine's thread. `cancel` may be called from any thread. An expert is asked
    with this as the `inquiry.Asker`.
    """

    def __init__(self, node: TreeNode, record: StateRecord, occasion: Occasion) -> None:
        self.node = node
        self.record = record
        self.occasion = occasion
        self.failure = occasion.failure
        self.stop = RecoveryStop(node, record)
        self.scope = self.stop.scope
        self.deciding = Deciding(
            node, record, occasion.failure, occasion.context, occasion.continuous, self.stop
        )
        self.budget = node.tree.budget
        self.ends_budget = False  # whether the question's deadline is that of the trial
        self.cause = ''  # of the decision
        self.asks_at_once = False  # no policy has a say
        self.decided: Optional[Decided] = None  # to ask
        self._above: Optional[Deciding] = None  # of a level above, which decides now
        self.why_no_answer = ''
        self.tried: List[str] = self.deciding.tried
        self.question_cancelled = threading.Event()  # also at a shutdown, and long after a deadline

    def cancel(self) -> None:
        """End the recovery soon: preempt what runs, take the question back."""
        self.scope.cancel(Reason.PREEMPTED)
        self.question_cancelled.set()
        self.deciding.cancel()
        above = self._above
        if above is not None:
            above.cancel()

    @contextlib.contextmanager
    def deciding_above(self, deciding: Deciding) -> Iterator[None]:
        """Have a preempt end the decision of a level above, within it."""
        self._above = deciding
        try:
            yield
        finally:
            self._above = None

    def stopped(self) -> bool:
        """Whether a preempt or a shutdown ends the recovery, or the machine is left behind."""
        return self.scope.reason is not None

    def ask_at_once(self, why: str) -> None:
        """Have a person asked, whatever a policy says. `why`: a clause."""
        self.cause = why
        self.asks_at_once = True
        self.warn(why)

    def judge_anew(self, failure: Failure) -> None:
        """Take the failure for another."""
        self.failure = self.deciding.failure = failure

    # -- the ask

    def make_question(self, deadline_s: float) -> Question:
        """Return a new question about the failure. `deadline_s`: seconds left, 0 without end."""
        account = Account(
            self.occasion.continuous,
            self.cause,
            tuple(self.tried),
            self.deciding.watch.written(),
            fallback_in_words(self),
        )
        return make_question(self.node, self.record, self.failure, account, deadline_s)

    def say_that_it_waits(self, question: Question) -> None:
        """Log that the machine waits: for minutes it would look as if it hung."""
        limit = 'it waits on'
        if question.deadline_s:
            limit = 'within {:.0f} s: {}'.format(question.deadline_s, fallback_in_short(self))
        smach.logwarn(
            '{}/{}: the expert is asked (question {}); without an answer {}'.format(
                self.node.path, self.record.label, question.question_id, limit
            )
        )

    def states_now(self) -> Mapping[Target, str]:
        """Return where the machine could go, and why it cannot go there now, '' where it can."""
        return targets_of(self.node)

    def emit(self, kind: EventKind, **fields: Any) -> None:
        """Tell the observers of a step that is about the failed state."""
        self.node.emit(kind, state=self.record.label, **fields)

    def warn(self, text: str) -> None:
        """Log what the operator should know of this failure, and tell the observers."""
        self.node.warn(text, self.record.label)

    # -- verdicts

    def jump(self, way: JumpPath, text: str = '') -> Verdict:
        """Go to a place, once the robot is well."""
        return self.when_well(JumpTo(way, text=text, written=way.kept(self.deciding.watch)))

    def when_well(self, verdict: Verdict) -> Verdict:
        """Return a verdict, after a wait where it leads to a state and the robot is not well."""
        health = self.node.tree.health
        if not (isinstance(verdict, JumpTo) and health.is_set):
            return verdict
        why = health.why_unwell(self.scope)
        if why and not self.stop.wait_until_well('is left for ' + verdict.way.down[-1].label, why):
            return self.end_early()
        return verdict

    def natural_ending(self) -> ContainerEnding:
        """Return how the failure would have ended the container."""
        return natural_ending(self.node, self.failure)

    def give_up(self, text: str, outcome: str = '') -> Verdict:
        """End the container with an outcome, or ('') as the failure would have ended it."""
        if self.occasion.keeps:
            return self.keep(text)
        ending = ContainerEnding(outcome=outcome) if outcome else self.natural_ending()
        return GiveUp(ending, text=text)

    def keep(self, why: str) -> Verdict:
        """Stop where the machine stands, and keep the trial for the next start."""
        node = self.node
        self.warn(KEPT.format(why, node.settings.checkpoint))
        node.tree.early_end.keep()
        preempt_beside(node)
        return Preempted()

    def end_early(self) -> Verdict:
        """End the container, where a preempt, a shutdown or the budget has ended the recovery."""
        return self.preempted() if self.stopped() else self.end_unaided()

    def end_unaided(self) -> Verdict:
        """End the container as without an oracle, since the trial's time is over."""
        why_over = self.budget.why_over()
        if self.occasion.keeps:
            return self.keep(why_over)
        cause = cause_of(self.deciding.facts_of(Action.ASK, blocked=why_over))
        text = '{}: the machine ends as without an oracle'.format(cause)
        smach.logwarn('{}/{}'.format(self.node.path, text))
        return self.give_up(text)

    def preempted(self) -> Verdict:
        """Go where the author sends a preempt of the failed state, or end the container.

        Where the trial ends early, it has no outcome at all.
        """
        if self.node.tree.early_end.why is not None:
            return Preempted()
        return Preempted(preempted_ending(self.node, self.failure))
