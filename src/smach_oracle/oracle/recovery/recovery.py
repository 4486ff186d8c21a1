"""One failure, from the policy's question to the verdict (paper, Algorithm 1)."""
import threading
from typing import Any, FrozenSet, List, Mapping, Optional

import smach

from ..asking.answer_rules import Target
from ..asking.inquiry import Inquiry
from ..asking.question import Answer, Expert, Question, names
from ..decision.failure_rate import FailureClass
from ..decision.policy import Action, FailureContext
from ..decision.sentence import DecisionFacts, cause_of, decision_sentence
from ..machine.limited_run import standing_still
from ..machine.tree_node import TreeNode
from ..places.place import place_named
from ..places.way import Way, way_to, why_closed_on
from ..records.events import EventKind
from ..records.facts import DECIDED_BY, Decider
from ..records.state_record import StateRecord
from .deciding import Decided, Deciding
from .failure import ContainerEnding, Failure, natural_ending, preempted_ending
from .levels import (
    Foreseen,
    OuterDecision,
    OuterLevel,
    failure_above,
    foreseen_above,
    levels_that_may_decide,
    runs_as_precondition,
)
from .obeying import verdict_of
from .question_making import Account, make_question, targets_of
from .stop import RecoveryStop, preempt_beside
from .verdict import Verdict, VerdictKind


class Recovery:
    """The recovery from one failure, on all levels of the tree.

    `run` is called in the machine's thread, `cancel` from any thread. It asks as an
    `inquiry.Asker`, and it alone makes the verdict.
    """

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure,
                 context: FailureContext, continuous: bool) -> None:
        self._node = node
        self._machine = node.machine
        self._record = record
        self._failure = failure
        self._continuous = continuous
        self._stop = RecoveryStop(node, record)
        self._cause = ''  # of the decision
        self._budget = node.tree.budget
        self._ends_budget = False  # whether the question's deadline is that of the trial
        self._deciding = Deciding(node, record, failure, context, continuous, self._stop)
        self._outer: Optional[OuterLevel] = None  # that decides now
        self._watch = self._deciding.watch
        self.tried: List[str] = self._deciding.tried
        self.question_cancelled = threading.Event()  # also at a shutdown, and long after a deadline

    def cancel(self) -> None:
        """End the recovery soon: preempt what runs, take the question back."""
        self._stop.cancelled.set()
        self.question_cancelled.set()
        self._deciding.cancel()
        outer = self._outer
        if outer is not None:
            outer.cancel()

    def stopped(self) -> bool:
        """Whether a preempt or a shutdown ends the recovery, or the machine is left behind."""
        return self._stop.stopped()

    def run(self) -> Verdict:
        """Decide, and ask where the policy says so. Do neither where the trial's time is over."""
        if self._budget.why_over():
            return self._end_unaided()
        decided = self._deciding.decide(self._why_left_to_others)
        if self._stop.is_over():
            return self._ended_early()
        decider, facts = decided
        record, self._cause = self._record, cause_of(facts)
        if facts.action is not Action.ASK:
            self._tell_decision(decided)
            return self._follow_policy(facts)
        nobody = self._why_nobody_is_asked()
        levels = [] if nobody else self._levels_that_may_decide(decider)
        asked = ('the oracle above' if levels
                 else 'nobody, since ' + nobody.text if nobody else self._asked_in_words())
        self._tell_decision((decider, facts._replace(asked=asked)))
        outer = self._decided_above(levels)
        if self._stop.is_over():
            return self._ended_early()
        if outer is not None:
            record.recoveries += 1
            return self._wait_and_jump(outer.wait_s, Verdict(
                VerdictKind.JUMP, way=outer.way, text=outer.text,
                written=outer.written, decided_by=outer.decided_by,
                restarts=outer.restarts))
        return self._give_way(nobody) if nobody else self._ask()

    def _follow_policy(self, facts: DecisionFacts) -> Verdict:
        """Carry out a decision that asks nobody."""
        way = self._deciding.way
        if way is None:
            return self._give_way(self._why_nobody_is_asked()
                                  or Foreseen('the policy asks nobody'))
        self._record.recoveries += 1
        restarts = facts.action is Action.RESTART
        written: FrozenSet[str] = frozenset() if restarts else way.kept(self._watch)
        return self._wait_and_jump(facts.wait_s, Verdict(
            VerdictKind.JUMP, way=way, restarts=restarts, written=written))

    def _wait_and_jump(self, wait_s: float, verdict: Verdict) -> Verdict:
        if wait_s and not self._stop.has_waited(wait_s):
            return self._ended_early()
        return self._when_well(verdict)

    def _tell_decision(self, decided: Decided) -> None:
        decider, facts = decided
        record, sentence = self._record, decision_sentence(facts)
        smach.loginfo('{}/{}'.format(self._node.path, sentence))
        self.emit(EventKind.DECISION, outcome=facts.action.value, target=facts.target,
                  failure_class=int(record.failure_class), rate=record.rate,
                  continuous=self._continuous, text=sentence,
                  data={DECIDED_BY: decider.value})

    def _ended_early(self) -> Verdict:
        """End the container, where a preempt, a shutdown or the budget has ended the recovery."""
        return self._preempted() if self.stopped() else self._end_unaided()

    def _asked_in_words(self) -> str:
        if self._node.tree.expert is None:
            return 'nobody, since there is no expert'
        spent = self._budget.why_no_question()
        if spent:
            return 'nobody, since ' + spent
        limit_s, is_cut = self._budget.within(self._node.settings.deadline_s)
        if is_cut:
            return "an expert, {:.0f} s, which are the trial's last".format(limit_s)
        return 'an expert, {:g} s'.format(limit_s) if limit_s else 'an expert'

    def _judge_anew(self, failure: Failure) -> None:
        """Take the failure for another."""
        self._failure = self._deciding.failure = failure

    # -- the levels above

    def _why_nobody_is_asked(self) -> Optional[Foreseen]:
        """Return why the end of the container is left to a level above, or None where it is not."""
        if runs_as_precondition(self._node):
            return Foreseen('it runs as a precondition')
        if self._failure.is_held_back:  # no other oracle can confirm that it is repeated
            return None
        foreseen = foreseen_above(self._node, self._natural_ending())
        return foreseen and foreseen._replace(
            text='its author goes on from there ({})'.format(foreseen.text))

    def _why_left_to_others(self) -> str:
        nobody = self._why_nobody_is_asked()
        return nobody.text if nobody is not None else ''

    def _give_way(self, why: Foreseen) -> Verdict:
        """End the container, and leave all else to who is above it."""
        if why.passed_over:
            self.warn('its item is passed over with {}'.format(why.passed_over))
        return self._give_up('{}: {}'.format(self._cause, why.text))

    def _levels_that_may_decide(self, decider: Decider) -> List[TreeNode]:
        """Return them, innermost first. None where the failure is to be asked about at once."""
        if decider is not Decider.POLICY or self._record.failure_class is FailureClass.HIGH:
            return []
        return levels_that_may_decide(self._node)

    def _decided_above(self, levels: List[TreeNode]) -> Optional[OuterDecision]:
        """Return what the innermost level decides that does not ask, or None where all ask."""
        below, ending = self._node, self._natural_ending()
        for level in levels:
            failure = failure_above(level, below.below[0], ending,
                                    '{}: {}'.format(below.path, self._cause))
            if failure is None or self._stop.is_over():
                return None
            self._outer = OuterLevel(level, self._node, failure, self._stop)
            decision = self._outer.decide()
            self.tried += self._outer.tried
            self._outer = None
            if decision is not None:
                return decision
            below = level
            ending = natural_ending(failure, level.machine.get_registered_outcomes(),
                                    level.in_force.failing)
        return None

    # -- asking

    def _ask(self) -> Verdict:
        expert, policy = self._node.tree.expert, self._node.in_force.policy
        if not policy.asks:
            return self._give_up('{}: the policy asks nobody'.format(self._cause))
        if expert is None:
            return self._fall_back('no expert is there to ask')
        spent = self._budget.take_question()
        return self._fall_back(spent) if spent else self._ask_expert(expert)

    def _ask_expert(self, expert: Expert) -> Verdict:
        deadline_s, self._ends_budget = self._budget.within(self._node.settings.deadline_s)
        early_end = self._node.tree.early_end
        with standing_still(self._node.runs_around), early_end.asking():
            reply = Inquiry(self, expert, deadline_s).run()
        if self.stopped():
            if early_end.end_at_shutdown(bool(smach.is_shutdown())):
                preempt_beside(self._node)
            if reply.question_id:
                self.emit(EventKind.QUERY_CANCELLED, query_id=reply.question_id,
                          text=self._stop.why())
            return self._preempted()
        if reply.answer is not None:
            return self._obey(reply.answer)
        why = '; '.join(filter(None, (reply.why_none, self._budget.why_over())))
        self.emit(EventKind.QUERY_EXPIRED, query_id=reply.question_id,
                  text='{}; fallback: {}'.format(why, self._fallback_in_words()))
        return self._fall_back(why)

    def make_question(self, deadline_s: float) -> Question:
        """Return a new question about the failure. `deadline_s`: seconds left, 0 without end."""
        account = Account(self._continuous, self._cause, tuple(self.tried), self._watch.written(),
                          self._fallback_in_words())
        return make_question(self._node, self._record, self._failure, account, deadline_s)

    def say_that_it_waits(self, question: Question) -> None:
        """Log that the machine waits: for minutes it would look as if it hung."""
        self._say_that_it_waits(question, ' '.join(self._node.settings.on_no_answer).strip())

    def _say_that_it_waits(self, question: Question, fallback: str) -> None:
        limit = 'it waits on'
        if question.deadline_s:
            limit = 'within {:.0f} s: {}'.format(question.deadline_s, fallback)
        smach.logwarn('{}/{}: the expert is asked (question {}); without an answer {}'.format(
            self._node.path, self._record.label, question.question_id, limit))

    def states_now(self) -> Mapping[Target, str]:
        """Return where the machine could go, and why it cannot go there now, '' where it can."""
        return targets_of(self._node)

    def emit(self, kind: EventKind, **fields: Any) -> None:
        """Tell the observers of a step that is about the failed state."""
        self._node.emit(kind, state=self._record.label, **fields)

    def warn(self, text: str) -> None:
        """Log what the operator should know of this failure, and tell the observers."""
        self._node.warn(text, self._record.label)

    # -- verdicts

    def _obey(self, answer: Answer) -> Verdict:
        return self._when_well(verdict_of(answer, self._node, self._record.label, self._watch,
                                          self._natural_ending))

    def _jump(self, way: Way, text: str = '') -> Verdict:
        """Go to a place, once the robot is well."""
        return self._when_well(Verdict(VerdictKind.JUMP, way=way, text=text,
                                       written=way.kept(self._watch)))

    def _when_well(self, verdict: Verdict) -> Verdict:
        """Return a verdict, after a wait where it leads to a state and the robot is not well."""
        health = self._node.tree.health
        if verdict.way is None or not health.is_set:
            return verdict
        why = health.why_unwell(self.stopped)
        if why and not self._stop.wait_until_well(
                'is left for ' + verdict.way.down[-1].label, why):
            return self._ended_early()
        return verdict

    def _give_up(self, text: str, outcome: str = '') -> Verdict:
        """End the container with an outcome, or ('') as the failure would have ended it."""
        ending = ContainerEnding(outcome=outcome) if outcome else self._natural_ending()
        return Verdict(VerdictKind.GIVE_UP, ending=ending, text=text)

    def _end_unaided(self) -> Verdict:
        """End the container as without an oracle, since the trial's time is over."""
        cause = cause_of(self._deciding.facts_of(Action.ASK, blocked=self._budget.why_over()))
        text = '{}: the machine ends as without an oracle'.format(cause)
        smach.logwarn('{}/{}'.format(self._node.path, text))
        return self._give_up(text)

    def _preempted(self) -> Verdict:
        """Go where the author sends a preempt of the failed state, or end the container.

        Where the trial ends early, it has no outcome at all.
        """
        if self._node.tree.early_end.why is not None:
            return Verdict(VerdictKind.PREEMPTED)
        return Verdict(VerdictKind.PREEMPTED, ending=preempted_ending(self._node, self._failure))

    def _natural_ending(self) -> ContainerEnding:
        return natural_ending(self._failure, self._machine.get_registered_outcomes(),
                              self._node.in_force.failing)

    # -- nobody answers

    def _fall_back(self, why: str) -> Verdict:
        """Do what is configured for a question that nobody answers."""
        verb, target = self._node.settings.on_no_answer
        if verb == 'goto':
            way = self._way_back()
            problem = self._why_not_fall_back(way) or self._budget.take_recovery()
            if way is not None and not problem:
                self._record.fallbacks += 1
                return self._jump(way, why)
            self.warn('on_no_answer: cannot go to {!r}: {}; stopping'.format(target, problem))
        elif verb == 'give_up':
            if target in self._machine.get_registered_outcomes():
                return self._give_up(why, target)
            self.warn('on_no_answer: {!r} is no outcome of this container; stopping'.format(target))
        return self._give_up(why)

    def _way_back(self) -> Optional[Way]:
        """Return the way to the place that `on_no_answer` names, None where there is none."""
        place = place_named(self._node, self._node.settings.on_no_answer[1])
        return way_to(self._node, place) if place is not None else None

    def _why_not_fall_back(self, way: Optional[Way]) -> str:
        """Return why `on_no_answer` cannot lead to a place, '' where it can.

        It has a cap, or a trial without experts might not end.
        """
        record = self._record
        if record.fallbacks >= max(1, record.settings.max_recoveries):
            return 'this trial has gone there {} times for {} already'.format(
                record.fallbacks, record.label)
        if way is None:
            return 'no such state; there are ' + names(self._node.labels())
        over = 'the trial is over then' if self._ends_budget else self._budget.why_over()
        return (why_closed_on(way) or self._deciding.why_repeats_on(way) or over
                or self._budget.why_no_recovery())

    def _fallback_in_words(self) -> str:
        """Return what `_fall_back` will do."""
        verb, target = self._node.settings.on_no_answer
        if verb == 'goto' and not self._why_not_fall_back(self._way_back()):
            return 'go to {}'.format(target)
        if verb == 'give_up' and target in self._machine.get_registered_outcomes():
            return 'end with {}'.format(target)
        ending = self._natural_ending()
        if ending.error is not None:
            return 'stop with the error {}'.format(type(ending.error).__name__)
        return ('go on to {}'.format(ending.state) if ending.state
                else 'stop with {}'.format(ending.outcome))
