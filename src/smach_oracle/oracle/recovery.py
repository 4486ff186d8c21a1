"""One failure, from the policy's question to the verdict (paper, Algorithm 1)."""
import threading
from typing import Any, List, Tuple

import smach

from .events import SPENT, EventKind
from .failure import Ending, Failure, natural_ending
from .failure_rate import FailureClass
from .naming import PREEMPTED
from .policy import Action, Chain, Preconditions, Situation
from .precondition import PreconditionRunner
from .question import names
from .state_record import StateRecord
from .userdata import WriteWatch
from .verdict import Verdict, VerdictKind


class Recovery:
    """The recovery from one failure. `run` is called in the machine's thread, `cancel` from any thread."""

    def __init__(self, ledger: Any, record: StateRecord, failure: Failure, chain: Chain, continuous: bool) -> None:
        self.ledger = ledger
        self.machine = ledger.machine
        self.record = record
        self.failure = failure
        self.chain = chain
        self.continuous = continuous
        self.cancelled = threading.Event()
        self.query_cancelled = threading.Event()  # also set at a shutdown, and long after a deadline
        self.tried: List[str] = []
        self.reason = ''
        self.watch = WriteWatch(self.machine, ledger.deep_copy_keys)
        self._preconditions = PreconditionRunner(self.machine, ledger, self.watch)

    @property
    def label(self) -> str:
        """The failed state."""
        return self.record.label

    def cancel(self) -> None:
        """End the recovery soon: preempt what runs, take the question back."""
        self.cancelled.set()
        self.query_cancelled.set()
        self._preconditions.cancel()

    def stopped(self) -> bool:
        """Whether a preempt or a shutdown ends the recovery."""
        return self.cancelled.is_set() or smach.is_shutdown()

    def run(self) -> Verdict:
        """Decide, and ask where the policy says so."""
        action, target = self._decide()
        if self.stopped():
            return self.preempted()
        self.ledger.emit(EventKind.DECISION, state=self.label, outcome=action.value, target=target,
                         failure_class=int(self.record.failure_class), rate=self.record.rate,
                         continuous=self.continuous, text=self.reason)
        if action is Action.ASK:
            return self._ask()
        self.record.recoveries += 1
        return self.jump(target)

    def blocked(self, label: str) -> str:
        """Return why a state cannot be entered now, '' where it can."""
        return self.ledger.tree.workers.blocked(self.machine._states[label])

    def _decide(self) -> Tuple[Action, str]:
        record, policy = self.record, self.ledger.policy
        if record.recoveries >= record.settings.max_recoveries:
            self.reason = ('1 recovery of this trial is' if record.recoveries == 1 else
                           '{} recoveries of this trial are'.format(record.recoveries)) + SPENT
            return Action.ASK, ''
        failure_class = record.failure_class
        preconditions = self._run_preconditions(failure_class)
        action = policy.decide(Situation(failure_class, preconditions, self.continuous))
        self.reason = '{}: {}, preconditions {}, {}continuous'.format(
            policy.name, failure_class.name, preconditions.value, '' if self.continuous else 'not ')
        if action is Action.ASK:
            return action, ''
        return self._checked(action, self.label if action is Action.REVISIT else policy.step_back_target(self.chain))

    def _checked(self, action: Action, target: str) -> Tuple[Action, str]:
        why = self.blocked(target)
        if not why:
            return action, target
        self.reason += '; {} to {} is not possible: it {}'.format(action.value, target, why)
        return Action.ASK, ''

    def _run_preconditions(self, failure_class: FailureClass) -> Preconditions:
        specs = self.record.settings.preconditions
        if not specs:
            return Preconditions.NONE
        if not self.ledger.policy.runs_preconditions(failure_class):
            return Preconditions.NOT_MET
        for spec in specs:
            if self.stopped() or not self._run_precondition(spec):
                return Preconditions.NOT_MET
        return Preconditions.MET

    def _run_precondition(self, spec: Any) -> bool:
        self.ledger.emit(EventKind.PRECONDITION_START, state=self.label, target=spec.name)
        why_not = self._preconditions.run(spec)
        outcome = 'not met' if why_not else 'met'
        self.ledger.emit(EventKind.PRECONDITION_END, state=self.label, target=spec.name, outcome=outcome, text=why_not)
        self.tried.append('precondition {}: {}'.format(spec.name, '{} ({})'.format(outcome, why_not)
                                                       if why_not else outcome))
        return not why_not

    def _ask(self) -> Verdict:
        from .asking import Inquiry  # it builds on this module
        ledger = self.ledger
        if ledger.settings.escalate and ledger.has_running_ancestor():
            return self.give_up('handed to the oracle above: ' + self.reason)
        expert = ledger.tree.expert
        if expert is None:
            return self.fall_back('no expert is there to ask')
        return Inquiry(self, expert).run()

    def jump(self, target: str, by: str = '', text: str = '') -> Verdict:
        """Go to a state."""
        return Verdict(VerdictKind.JUMP, state=target, by=by, text=text, written=frozenset(self.watch.written()))

    def give_up(self, text: str, outcome: str = '', by: str = '') -> Verdict:
        """End the container with an outcome, or ('') as the failure would have ended it."""
        ending = Ending(outcome=outcome) if outcome else self._natural_ending()
        return Verdict(VerdictKind.GIVE_UP, ending=ending, by=by, text=text)

    def preempted(self) -> Verdict:
        """End the container as preempted, or, where it has no such outcome, as the failure would have ended it."""
        registered = self.machine.get_registered_outcomes()
        ending = Ending(outcome=PREEMPTED) if PREEMPTED in registered else self._natural_ending()
        return Verdict(VerdictKind.PREEMPTED, ending=ending)

    def fall_back(self, why: str) -> Verdict:
        """Do what is configured for a question that nobody answers."""
        verb, target = self.ledger.settings.on_no_answer
        if verb == 'goto':
            problem = self._why_not_fall_back_to(target)
            if not problem:
                self.record.fallbacks += 1
                return self.jump(target, text=why)
            self.ledger.warn('on_no_answer: cannot go to {!r}: {}; stopping'.format(target, problem), self.label)
        elif verb == 'give_up':
            if target in self.machine.get_registered_outcomes():
                return self.give_up(why, target)
            self.ledger.warn('on_no_answer: {!r} is no outcome of this container; stopping'.format(target), self.label)
        return self.give_up(why)

    def why_not_enter(self, label: str) -> str:
        """Return why the machine cannot be sent to a state, '' where it can."""
        if label not in self.machine._states or self.ledger.is_oracle(label):
            return 'no such state; there are ' + names(self.ledger.labels())
        return self.blocked(label)

    def _why_not_fall_back_to(self, label: str) -> str:
        """Return why `on_no_answer` cannot lead to a state. It has a cap, or a trial without experts might not end."""
        if self.record.fallbacks >= max(1, self.record.settings.max_recoveries):
            return 'this trial has gone there {} times for {} already'.format(self.record.fallbacks, self.label)
        return self.why_not_enter(label)

    def fallback_in_words(self) -> str:
        """Return what `fall_back` will do."""
        verb, target = self.ledger.settings.on_no_answer
        if verb == 'goto' and not self._why_not_fall_back_to(target):
            return 'go to {}'.format(target)
        if verb == 'give_up' and target in self.machine.get_registered_outcomes():
            return 'end with {}'.format(target)
        ending = self._natural_ending()
        if ending.error is not None:
            return 'stop with the error {}'.format(type(ending.error).__name__)
        return 'go on to {}'.format(ending.state) if ending.state else 'stop with {}'.format(ending.outcome)

    def _natural_ending(self) -> Ending:
        return natural_ending(self.failure, self.machine.get_registered_outcomes(), self.ledger.failing)
