"""One recovery under way: what its phases share, and how it ends early."""

import threading
from typing import Any, Callable, List, Optional, Tuple, cast

import smach

from ..asking.question import Answer
from ..decision.policy import Action, Situation
from ..decision.sentence import DecisionFacts, cause_of
from ..decision.ways import (
    BY_PERSON,
    FIRST,
    LATER,
    ChosenOrder,
    WayKind,
    WayResult,
    key_of,
    kind_of_choice,
)
from ..machine.places import JumpPath, name_of
from ..machine.state_record import RateReading, StateRecord
from ..machine.tree_node import TreeNode
from ..machine.userdata import WriteWatch
from ..records.events import EventKind, FailureKind
from ..records.facts import Decider
from ..scope.scope import Reason, Scope, standing_still
from .occasions import Occasion
from .stop import preempt_beside
from .verdict import (
    ChosenWay,
    ContainerEnding,
    GiveUp,
    JumpTo,
    Preempted,
    Verdict,
    natural_ending,
    preempted_ending,
)

Decided = Tuple[Decider, DecisionFacts]

KEPT = (
    'nobody has said how the trial goes on ({}). The machine stops where it stands, and the '
    'trial is kept. The next start asks again. `oracle_run --resume` asks only before a state '
    'that on_retry protects, if the script has changed (unless --resume-map says how), and if '
    'the store may have lost something. `oracle_state {} drop` ends the trial'
)


class Recovery:
    """One recovery under way, of a failure or of a state that still runs.

    A preempt or a shutdown cancels its `scope`, and so does the end of what goes on around it. The
    phases run in the machine's thread. `cancel` may be called from any thread.

    `recovered`: the states whose recovery it is, if it comes to a jump.
    `met`, `not_met`: names of preconditions. `reading`: the rate as the policy was asked.
    `jump_path`: where it has decided to go. `situation`, `choice`: that of a policy that goes
    by ways, and the ways as it would go them, the first one now. `decided_to_ask`: why. `cause`: of
    the decision.
    `begin_question`: is called before each question. `takes`: whether an answer comes in time, once
    it is here.
    """

    asks_at_once = False  # no policy has a say
    cause = ''
    decided_to_ask: Optional[Decided] = None
    ends_budget = False  # whether the question's deadline is that of the trial
    not_met = ''
    question_cancelled: Optional[threading.Event] = None  # also at a shutdown, or a late deadline
    question_id = ''  # of the last question
    reading: Optional[RateReading] = None
    running: Optional[smach.State] = None  # as a precondition
    jump_path: Optional[JumpPath] = None
    situation: Optional[Situation] = None
    choice: Optional[ChosenOrder] = None
    why_no_answer = ''

    def __init__(
        self,
        node: TreeNode,
        record: StateRecord,
        occasion: Occasion,
        below: Optional['Recovery'] = None,
        scope: Optional[Scope] = None,
    ) -> None:
        """`below`: the recovery in a container below, for which this level decides."""
        self.node = node
        self.record = record
        self.occasion = occasion
        self.failure = occasion.failure
        self._below = below
        self.scope: Scope = scope or (node.execution.scope_around if below is None else below.scope)
        self.budget = node.tree.budget
        self.tried: List[str] = []
        self.met: List[str] = []
        self.recovered: List[StateRecord] = []
        # who still runs writes meanwhile, and nothing of that is the recovery's
        keys = () if self.failure.still_runs else node.in_force.deep_copy_keys
        self.watch = WriteWatch(node.machine, keys)
        self.lock = threading.Lock()
        self.takes: Callable[[Answer], bool] = lambda answer: not self.stopped()
        self.begin_question: Callable[['Recovery'], None] = lambda recovery: None

    @property
    def origin(self) -> 'Recovery':
        """Return the recovery that waits, and that a preempt reaches."""
        return self._below or self

    def cancel(self, reason: Reason = Reason.PREEMPTED) -> None:
        """End the recovery soon: preempt what runs, take the question back."""
        self.scope.cancel(reason)
        if self.question_cancelled is not None:
            self.question_cancelled.set()
        with self.lock:
            running = self.running
        if running is not None:
            running.request_preempt()

    def stopped(self) -> bool:
        """Whether a preempt or a shutdown ends the recovery, or the machine is left behind."""
        return self.scope.reason is not None

    def is_over(self) -> bool:
        """Whether it is stopped, or the trial's time is over."""
        return self.scope.reason is not None or bool(self.budget.why_over())

    def take_recovery(self, most: Optional[int] = None) -> str:
        """Set a recovery of the budget aside, once, or say why not. See TrialBudget."""
        if self.is_over():
            return 'the recovery was ended early'
        return self.budget.take_recovery(self.origin, most)

    @property
    def _is_due(self) -> bool:
        """Whether a person is asked whatever the policy, and it costs no question of the budget.

        That is how a stored trial goes on, and a question that was open as the program was stopped.
        """
        return self.occasion.keeps or self.node.tree.resumed.has_question(self.record)

    @property
    def may_ask(self) -> bool:
        """Whether a person may be asked."""
        return self._is_due or self.node.in_force.policy.asks

    def why_no_question(self) -> str:
        """Say that the questions of the budget are spent, where one is needed."""
        return '' if self._is_due else self.budget.why_no_question()

    def take_question(self) -> str:
        """Spend a question of the budget, where one is needed, or say why not."""
        return '' if self._is_due else self.budget.take_question()

    def settle(self, verdict: Optional[Verdict]) -> None:
        """Count what was set aside if the machine jumps. Else the budget has it back."""
        jumps = isinstance(verdict, JumpTo)
        for record in self.recovered if jumps else ():
            record.recoveries += 1
        self.budget.settle_recovery(self, jumps)

    def why_taken_back(self) -> str:
        """Return why its question is taken back, as the events say it."""
        early = self.node.tree.early_end.why
        return (self.scope.reason or Reason.SHUTDOWN).text if early is None else early.value

    def ask_at_once(self, why: str) -> None:
        """Have a person asked, whatever a policy says. `why`: a clause."""
        self.cause = why
        self.asks_at_once = True
        self.warn(why)

    def warn(self, text: str) -> None:
        """Log what the operator should know of this failure, and tell the observers."""
        self.node.warn(text, self.record.label)

    def tell(self, kind: EventKind, **fields: Any) -> None:
        """Tell the observers of a step that is about the failed state."""
        if self.node.events.observers:
            self.node.emit(kind, self.record.label, **fields)

    def facts(self, action: Action, **fields: Any) -> DecisionFacts:
        """Return what has led to a decision."""
        record = self.record
        reading = self.reading or record.read_rate()
        return DecisionFacts(
            record.label,
            reading.recent,
            reading.rate,
            self.occasion.continuous,
            action,
            met=self.met,
            not_met=self.not_met,
            tried=reading.tried,
            not_failed=self.failure.why_none,
            **fields,
        )

    @property
    def chosen(self) -> Optional[ChosenWay]:
        """Return the way that it has decided for, None where no streak is to know of it."""
        choice = self.choice
        if choice is None:
            return None
        tried = cast('Situation', self.situation).menu.streak.tried
        way, place = choice.ways[0], LATER if tried else FIRST
        return self._gone(way.key, way.kind, place, choice.hoped)

    def asked_for(self, path: JumpPath) -> Optional[ChosenWay]:
        """Return the choice of a person as a way, None where its result is not to be noted."""
        if not self.node.in_force.policy.goes_by_ways:
            return None
        key = key_of(name_of(path.place, self.node), self.record.label)
        return self._gone(key, kind_of_choice(key), BY_PERSON)

    def _gone(
        self, key: str, kind: WayKind, place: int, hoped: Optional[float] = None
    ) -> Optional[ChosenWay]:
        if not self.failure.is_counted:
            return None
        gone = WayResult(key, kind.value, place, self.failure_key, None, 0.0, hoped)
        return ChosenWay(self.node, self.record, gone, self.budget.work_time.now())

    @property
    def failure_key(self) -> str:
        """Return the name of this kind of failure, as the results of ways have it.

        That of a failure which another state has reported goes by what the failed one said.
        """
        failure, record = self.failure, self.record
        told: Tuple[FailureKind, str, str] = failure.kind, failure.outcome, failure.text
        if self.occasion.visits_since and record.last_failure is not None:
            told = record.last_failure
        return record.failure_key(*told)

    # -- waits

    def _in_time(self) -> Scope:
        return Scope(self.scope, look=lambda: Reason.TIME_OVER if self.budget.why_over() else None)

    def has_waited_after(self, what: str) -> bool:
        """Wait where the robot was not well at what has happened.

        Return whether it is well again.
        """
        health = self.node.tree.health
        why = health.unwell_after(self.scope) if health.is_set else ''
        return bool(why) and self.wait_until_well(what, why)

    def wait_until_well(self, what: str, why: str) -> bool:
        """Wait until the robot is well. Return False where something has ended the recovery."""
        node = self.node
        with standing_still(node.execution.runs_around), self.budget.work_time.paused():
            place = '/'.join((node.path, self.record.label))
            is_well = node.tree.health.wait_until_well(self.tell, place, what, why, self._in_time())
        return is_well and not self.is_over()

    # -- verdicts

    def jump(self, way: JumpPath, text: str = '') -> Verdict:
        """Go to a place, once the robot is well."""
        return self.after_waits(JumpTo(way, text=text, written=way.kept(self.watch)))

    def after_waits(self, jump: JumpTo) -> Verdict:
        """Return a jump, once its wait is over and the robot is well."""
        if jump.wait_s:
            with standing_still(self.node.execution.runs_around):
                self.node.tree.waiting.wait(jump.wait_s, 'waiting', self._in_time())
            if self.is_over():
                return self.end_early()
        health = self.node.tree.health
        why = health.why_unwell(self.scope) if health.is_set else ''
        if why and not self.wait_until_well('is left for ' + jump.jump_path.place.label, why):
            return self.end_early()
        return jump

    def ending(self, outcome: str = '') -> ContainerEnding:
        """End the container with an outcome, or ('') as the failure would have ended it."""
        if outcome != '':
            return ContainerEnding(outcome=outcome)
        return natural_ending(self.node, self.failure)

    def give_up(self, text: str, outcome: str = '') -> Verdict:
        """End the container. `outcome`: see `ending`."""
        return self.keep(text) if self.occasion.keeps else GiveUp(self.ending(outcome), text=text)

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
        cause = cause_of(self.facts(Action.ASK, blocked=why_over))
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
