"""One failure, from the policy's question to the verdict (paper, Algorithm 1)."""
import threading
from typing import Any, List, Mapping, Optional, Tuple

import smach

from ..asking.inquiry import Inquiry
from ..asking.question import Answer, Expert, Question, names
from ..decision.failure_rate import FailureClass
from ..decision.policy import Action, FailureContext, Preconditions, Situation
from ..decision.sentence import (
    DecisionFacts,
    cause_of,
    decision_sentence,
    going_would_repeat,
)
from ..machine.limited_run import standing_still
from ..machine.repeats import has_visited, repeated_by_going_to, why_closed
from ..machine.tree_node import TreeNode
from ..machine.write_watch import WriteWatch
from ..records.events import EventKind
from ..records.facts import DECIDED_BY, Decider
from ..records.state_record import StateRecord
from ..settings.failing_outcomes import PREEMPTED
from ..settings.preconditions import PreconditionSpec
from ..settings.settings import ALLOW
from .failure import ContainerEnding, Failure, natural_ending
from .obeying import verdict_of
from .precondition_runner import PreconditionRunner
from .question_making import Account, make_question
from .verdict import Verdict, VerdictKind


class Recovery:
    """The recovery from one failure.

    `run` is called in the machine's thread, `cancel` from any thread. It asks as an
    `inquiry.Asker`, and it alone makes the verdict.
    """

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure,
                 context: FailureContext, continuous: bool) -> None:
        self._node = node
        self._machine = node.machine
        self._record = record
        self._failure = failure
        self._context = context
        self._continuous = continuous
        self._cancelled = threading.Event()
        self._cause = ''  # of the decision
        self._met: List[str] = []  # names of preconditions
        self._not_met = ''
        self._budget = node.tree.budget
        self._ends_budget = False  # whether the question's deadline is that of the trial
        self._watch = WriteWatch(node.machine, node.in_force.deep_copy_keys)
        self._preconditions = PreconditionRunner(node, record.settings, self._watch)
        self.tried: List[str] = []
        self.question_cancelled = threading.Event()  # also at a shutdown, and long after a deadline

    def cancel(self) -> None:
        """End the recovery soon: preempt what runs, take the question back."""
        self._cancelled.set()
        self.question_cancelled.set()
        self._preconditions.cancel()

    def stopped(self) -> bool:
        """Whether a preempt or a shutdown ends the recovery, or the machine is left behind."""
        return self._cancelled.is_set() or smach.is_shutdown() or self._node.is_left_behind()

    def run(self) -> Verdict:
        """Decide, and ask where the policy says so; neither where the trial's time is over."""
        if self._budget.why_over():
            return self._end_unaided()
        decider, facts = self._decide()
        if self.stopped():
            return self._preempted()
        if self._budget.why_over():
            return self._end_unaided()
        record, self._cause, sentence = self._record, cause_of(facts), decision_sentence(facts)
        smach.loginfo('{}/{}'.format(self._node.path, sentence))
        self.emit(EventKind.DECISION, outcome=facts.action.value, target=facts.target,
                  failure_class=int(record.failure_class), rate=record.rate,
                  continuous=self._continuous, text=sentence,
                  data={DECIDED_BY: decider.value})
        if facts.action is Action.ASK:
            return self._ask()
        record.recoveries += 1
        return self._jump(facts.target)

    # -- deciding

    def _decide(self) -> Tuple[Decider, DecisionFacts]:
        return self._ask_at_once() or self._follow_policy()

    def _ask_at_once(self) -> Optional[Tuple[Decider, DecisionFacts]]:
        """Return the decision where no policy has a say, and no precondition is run."""
        record, ask = self._record, Action.ASK
        if self._failure.is_held_back:
            return Decider.HELD_BACK, self._facts_of(ask)
        if record.recoveries >= record.settings.max_recoveries:
            return Decider.MAX_RECOVERIES, self._facts_of(ask, spent=record.recoveries)
        spent = self._budget.why_no_recovery()
        if spent:
            return Decider.BUDGET, self._facts_of(ask, blocked=spent)
        if record.settings.on_retry != ALLOW:
            return Decider.ON_RETRY, self._facts_of(ask, blocked=self._why_repeats(record.label))
        return None

    def _follow_policy(self) -> Tuple[Decider, DecisionFacts]:
        record, policy = self._record, self._node.in_force.policy
        preconditions = self._run_preconditions(record.failure_class)
        action = policy.decide(Situation(record.failure_class, preconditions, self._continuous))
        target = ''
        if action is not Action.ASK:
            target = (record.label if action is Action.REVISIT
                      else policy.step_back_target(self._context))
        decider, why_not = self._what_prevents(target) if target else (Decider.POLICY, '')
        if why_not:
            action, target = Action.ASK, ''
        return decider, self._facts_of(action, target=target, blocked=why_not)

    def _what_prevents(self, target: str) -> Tuple[Decider, str]:
        """Spend a recovery on going to a state; or return what prevents it, and why."""
        for decider, why_not in ((Decider.ON_RETRY, self._why_repeats),
                                 (Decider.POLICY, self._why_not)):
            reason = why_not(target)
            if reason:
                return decider, reason
        spent = self._budget.take_recovery()
        return (Decider.BUDGET, spent) if spent else (Decider.POLICY, '')

    def _why_repeats(self, target: str) -> str:
        """Say what would be repeated if the machine went to a state by itself; '' if nothing."""
        repeated = repeated_by_going_to(self._node, target)
        if not repeated:
            return ''
        if not has_visited(self._node, target):
            return 'this trial has not been in {}, and going there may repeat {}'.format(
                target, ', '.join(repeated))
        return going_would_repeat(self._record.label, target, repeated)

    def _why_not(self, target: str) -> str:
        """Return why the machine cannot go on to a state by itself now, '' where it can."""
        blocked = self._blocked(target)
        return '{} {}'.format(target, blocked) if blocked else self._function_that_runs()

    def _function_that_runs(self) -> str:
        """Return which function among the preconditions was left behind and runs, '' for none."""
        for spec in self._record.settings.preconditions:
            for name, function in spec.functions():
                blocked = self._node.tree.workers.blocked(function)
                if blocked:
                    return '{} {}'.format(name, blocked)
        return ''

    def _facts_of(self, action: Action, **fields: Any) -> DecisionFacts:
        record = self._record
        return DecisionFacts(record.label, record.recent, record.rate, self._continuous, action,
                             met=self._met, not_met=self._not_met,
                             held_back=self._failure.text if self._failure.is_held_back else '',
                             asked=self._asked_in_words() if action is Action.ASK else '', **fields)

    def _asked_in_words(self) -> str:
        node = self._node
        if self._escalates():
            return 'the oracle above'
        if node.tree.expert is None:
            return 'nobody, since there is no expert'
        spent = self._budget.why_no_question()
        if spent:
            return 'nobody, since ' + spent
        limit_s, is_cut = self._budget.within(node.settings.deadline_s)
        if is_cut:
            return "an expert, {:.0f} s, which are the trial's last".format(limit_s)
        return 'an expert, {:g} s'.format(limit_s) if limit_s else 'an expert'

    def _escalates(self) -> bool:
        """Whether the oracle above is to ask; it cannot confirm that a state is repeated here."""
        node = self._node
        return (node.settings.escalate and node.has_running_ancestor()
                and not self._failure.is_held_back)

    def _blocked(self, label: str) -> str:
        """Return why a state cannot be entered now, '' where it can."""
        return why_closed(self._node, label)

    def _run_preconditions(self, failure_class: FailureClass) -> Preconditions:
        specs = self._record.settings.preconditions
        if not specs:
            return Preconditions.NONE
        if not self._node.in_force.policy.runs_preconditions(failure_class):
            return Preconditions.NOT_MET
        for spec in specs:
            if self.stopped() or not self._run_precondition(spec):
                return Preconditions.NOT_MET
        return Preconditions.MET

    def _run_precondition(self, spec: PreconditionSpec) -> bool:
        self.emit(EventKind.PRECONDITION_START, target=spec.name)
        why_not = self._preconditions.run(spec)
        for _ in range(self._record.most_repeats):
            if not why_not or not self._has_waited_after('did not get its precondition '
                                                         + spec.name):
                break
            why_not = self._preconditions.run(spec)
        outcome = 'not met' if why_not else 'met'
        self.emit(EventKind.PRECONDITION_END, target=spec.name, outcome=outcome, text=why_not)
        if why_not:
            self._not_met = spec.name
        else:
            self._met.append(spec.name)
        self.tried.append('precondition {}: {}'.format(
            spec.name, '{} ({})'.format(outcome, why_not) if why_not else outcome))
        return not why_not

    # -- health

    def _has_waited_after(self, what: str) -> bool:
        """Wait where the robot was not well at what has happened; whether it is well again."""
        health = self._node.tree.health
        if not health.is_set:
            return False
        why = health.unwell_after(self.stopped, self._cancelled.wait)
        return bool(why) and self._wait_until_well(what, why)

    def _wait_until_well(self, what: str, why: str) -> bool:
        """Wait until the robot is well; False where something has ended the recovery."""
        with standing_still(self._node.runs_around):
            is_well = self._node.tree.health.wait_until_well(
                self._node, self._record.label, what, why, self._is_over, self._cancelled.wait)
        return is_well and not self._is_over()

    def _is_over(self) -> bool:
        return self.stopped() or bool(self._budget.why_over())

    def _not_waited(self) -> Verdict:
        """End the container, where something has ended the wait."""
        return self._preempted() if self.stopped() else self._end_unaided()

    # -- asking

    def _ask(self) -> Verdict:
        node = self._node
        if self._escalates():
            return self._give_up('handed to the oracle above: ' + self._cause)
        expert = node.tree.expert
        if expert is None:
            return self._fall_back('no expert is there to ask')
        spent = self._budget.take_question()
        return self._fall_back(spent) if spent else self._ask_expert(expert)

    def _ask_expert(self, expert: Expert) -> Verdict:
        deadline_s, self._ends_budget = self._budget.within(self._node.settings.deadline_s)
        with standing_still(self._node.runs_around):
            reply = Inquiry(self, expert, deadline_s).run()
        if self.stopped():
            if reply.question_id:
                self.emit(EventKind.QUERY_CANCELLED, query_id=reply.question_id,
                          text=self._why_stopped())
            return self._preempted()
        if reply.answer is not None:
            return self._obey(reply.answer)
        why = '; '.join(filter(None, (reply.why_none, self._budget.why_over())))
        self.emit(EventKind.QUERY_EXPIRED, query_id=reply.question_id,
                  text='{}; fallback: {}'.format(why, self._fallback_in_words()))
        return self._fall_back(why)

    def _why_stopped(self) -> str:
        if self._cancelled.is_set():
            return 'preempted'
        return 'left behind' if self._node.is_left_behind() else 'shutdown'

    def make_question(self, deadline_s: float) -> Question:
        """Return a new question about the failure; `deadline_s`: seconds left, 0 without end."""
        account = Account(self._continuous, self._cause, tuple(self.tried), self._watch.written(),
                          self._fallback_in_words())
        return make_question(self._node, self._record, self._failure, account, deadline_s)

    def say_that_it_waits(self, question: Question) -> None:
        """In the log: a machine that stands still for minutes looks as if it hung."""
        fallback = ' '.join(self._node.settings.on_no_answer).strip()
        limit = 'it waits on'
        if question.deadline_s:
            limit = 'within {:.0f} s: {}'.format(question.deadline_s, fallback)
        smach.logwarn('{}/{}: the expert is asked (question {}); without an answer {}'.format(
            self._node.path, self._record.label, question.question_id, limit))

    def states_now(self) -> Mapping[str, str]:
        """Return the states by label, and why each cannot be entered now, '' where it can."""
        return {label: self._blocked(label) for label in self._node.labels()}

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

    def _jump(self, target: str, text: str = '') -> Verdict:
        """Go to a state, once the robot is well."""
        return self._when_well(Verdict(VerdictKind.JUMP, state=target, text=text,
                                       written=frozenset(self._watch.written())))

    def _when_well(self, verdict: Verdict) -> Verdict:
        """Return a verdict, after a wait where it leads to a state and the robot is not well."""
        health = self._node.tree.health
        if verdict.kind is not VerdictKind.JUMP or not health.is_set:
            return verdict
        why = health.why_unwell(self.stopped)
        if why and not self._wait_until_well('is left for ' + verdict.state, why):
            return self._not_waited()
        return verdict

    def _give_up(self, text: str, outcome: str = '') -> Verdict:
        """End the container with an outcome, or ('') as the failure would have ended it."""
        ending = ContainerEnding(outcome=outcome) if outcome else self._natural_ending()
        return Verdict(VerdictKind.GIVE_UP, ending=ending, text=text)

    def _end_unaided(self) -> Verdict:
        """End the container as without an oracle, since the trial's time is over."""
        cause = cause_of(self._facts_of(Action.ASK, blocked=self._budget.why_over()))
        text = '{}: the machine ends as without an oracle'.format(cause)
        smach.logwarn('{}/{}'.format(self._node.path, text))
        return self._give_up(text)

    def _preempted(self) -> Verdict:
        """End the container as preempted.

        Where it has no such outcome, it ends as the failure would have ended it.
        """
        ending = self._natural_ending()
        if PREEMPTED in self._machine.get_registered_outcomes():
            ending = ContainerEnding(outcome=PREEMPTED)
        return Verdict(VerdictKind.PREEMPTED, ending=ending)

    def _natural_ending(self) -> ContainerEnding:
        return natural_ending(self._failure, self._machine.get_registered_outcomes(),
                              self._node.in_force.failing)

    # -- nobody answers

    def _fall_back(self, why: str) -> Verdict:
        """Do what is configured for a question that nobody answers."""
        verb, target = self._node.settings.on_no_answer
        if verb == 'goto':
            problem = self._why_not_fall_back_to(target) or self._budget.take_recovery()
            if not problem:
                self._record.fallbacks += 1
                return self._jump(target, text=why)
            self.warn('on_no_answer: cannot go to {!r}: {}; stopping'.format(target, problem))
        elif verb == 'give_up':
            if target in self._machine.get_registered_outcomes():
                return self._give_up(why, target)
            self.warn('on_no_answer: {!r} is no outcome of this container; stopping'.format(target))
        return self._give_up(why)

    def _why_not_fall_back_to(self, label: str) -> str:
        """Return why `on_no_answer` cannot lead to a state, '' where it can.

        It has a cap, or a trial without experts might not end.
        """
        record = self._record
        if record.fallbacks >= max(1, record.settings.max_recoveries):
            return 'this trial has gone there {} times for {} already'.format(
                record.fallbacks, record.label)
        states = self.states_now()
        if label not in states:
            return 'no such state; there are ' + names(states)
        over = 'the trial is over then' if self._ends_budget else self._budget.why_over()
        return (states[label] or self._why_repeats(label) or over
                or self._budget.why_no_recovery())

    def _fallback_in_words(self) -> str:
        """Return what `_fall_back` will do."""
        verb, target = self._node.settings.on_no_answer
        if verb == 'goto' and not self._why_not_fall_back_to(target):
            return 'go to {}'.format(target)
        if verb == 'give_up' and target in self._machine.get_registered_outcomes():
            return 'end with {}'.format(target)
        ending = self._natural_ending()
        if ending.error is not None:
            return 'stop with the error {}'.format(type(ending.error).__name__)
        return ('go on to {}'.format(ending.state) if ending.state
                else 'stop with {}'.format(ending.outcome))
