"""Decides about a failure of a state, for the oracle of one level (paper, Algorithm 1)."""

from typing import Any, Callable, List, Optional, Tuple

from ..decision.failure_rate import FailureClass
from ..decision.policy import Action, FailureContext, Past, Preconditions, Situation
from ..decision.sentence import DecisionFacts, goes, going_would_repeat
from ..machine.jump_path import JumpPath, closed_in_words, jump_path_to, repeated_on
from ..machine.places import TreePlace, levels_above, place_named
from ..machine.repeats import has_visited
from ..machine.snapshots import WriteWatch
from ..machine.state_record import RateReading, StateRecord
from ..machine.tree_node import TreeNode
from ..records.events import EventKind
from ..records.facts import Decider
from ..settings.preconditions import PreconditionSpec
from ..settings.settings import ALLOW
from .failure import Failure
from .precondition_runner import PreconditionRunner
from .stop import RecoveryStop

Decided = Tuple[Decider, DecisionFacts]


def _nothing_above() -> str:
    return ''


class Deciding:
    """One decision of one container's oracle. `tried` says what was done before it.

    `way`: the way to the place where it has decided to go, None where it goes nowhere.

    `decide` is called in the machine's thread, `cancel` from any thread.
    """

    def __init__(
        self,
        node: TreeNode,
        record: StateRecord,
        failure: Failure,
        context: FailureContext,
        continuous: bool,
        stop: RecoveryStop,
    ) -> None:
        self._node = node
        self._record = record
        self.failure = failure
        self._context = context
        self._continuous = continuous
        self._stop = stop
        self._budget = node.tree.budget
        self._met: List[str] = []  # names of preconditions
        self._not_met = ''
        self.watch = WriteWatch(node.machine, node.in_force.deep_copy_keys)
        self._preconditions = PreconditionRunner(node, record.settings, self.watch, stop.scope)
        self.tried: List[str] = []
        self.way: Optional[JumpPath] = None  # that was decided on
        self._standing: Optional[RateReading] = None  # of the state as its policy was asked

    def cancel(self) -> None:
        """Preempt the precondition that runs."""
        self._preconditions.cancel()

    def decide(self, why_not_above: Callable[[], str] = _nothing_above) -> Decided:
        """Run the preconditions that the policy wants, and say what it does.

        :param why_not_above: says why no level above is to be disturbed by this failure.
        """
        decider, facts = self._ask_at_once() or self._follow_policy(why_not_above)
        if facts.action is Action.ASK and not self._node.in_force.policy.asks:
            return decider, facts._replace(action=Action.GIVE_UP)
        return decider, facts

    def _ask_at_once(self) -> Optional[Decided]:
        """Return the decision where no policy has a say, and no precondition is run."""
        record, ask = self._record, Action.ASK
        if self.failure.is_held_back:
            return Decider.HELD_BACK, self.facts_of(ask)
        if record.recoveries >= record.settings.max_recoveries:
            return Decider.MAX_RECOVERIES, self.facts_of(ask, spent=record.recoveries)
        spent = self._budget.why_no_recovery()
        if spent:
            return Decider.BUDGET, self.facts_of(ask, blocked=spent)
        if record.settings.on_retry != ALLOW:
            return Decider.ON_RETRY, self.facts_of(ask, blocked=self._why_repeats(record.label))
        return None

    def _follow_policy(self, why_not_above: Callable[[], str]) -> Decided:
        record, policy = self._record, self._node.in_force.policy
        standing = self._standing = record.read_rate()
        preconditions = self._run_preconditions(standing.failure_class)
        situation = Situation(standing.failure_class, preconditions, self._continuous, self._past())
        action = policy.decide(situation)
        if action in (Action.ASK, Action.GIVE_UP):
            return Decider.POLICY, self.facts_of(action, blocked=policy.why(situation))
        name, place = self._place_of(action)
        way = jump_path_to(self._node, place) if place is not None else None
        if way is None:
            return Decider.POLICY, self.facts_of(
                Action.ASK, blocked='there is no state {!r} to go back to'.format(name)
            )
        why_not = why_not_above() if action is Action.RESTART else ''
        decider, why_not = (Decider.AUTHOR, why_not) if why_not else self._what_prevents(way)
        if why_not:
            return decider, self.facts_of(Action.ASK, blocked=why_not)
        self.way = way
        facts = self.facts_of(action, target=self._named(way), wait_s=policy.wait_s(situation))
        record.note_tried(goes(facts), standing.successes)
        return decider, facts

    def _past(self) -> Past:
        node, record = self._node, self._record
        place = ''
        if node.in_force.policy.draws:
            place = '{}/{} {}'.format(node.path, record.label, record.visits)
        return Past(record.recoveries, node.tree.restarts.count, place, node.tree.trials - 1)

    def _place_of(self, action: Action) -> Tuple[str, Optional[TreePlace]]:
        """Return where a decision leads, by name and as a place.

        None means there is no such state.
        """
        node = self._node
        if action is Action.RESTART:
            top = [node, *levels_above(node)][-1]
            label = top.machine._initial_state_label or ''
            return label, TreePlace(top, label)
        name = (
            self._record.label
            if action is Action.REVISIT
            else node.in_force.policy.step_back_target(self._context)
        )
        return name, place_named(node, name)

    def _named(self, way: JumpPath) -> str:
        """Return the label of a place, or its path where it is in another container."""
        place = way.down[-1]
        return place.label if place.node is self._node else place.path

    def _what_prevents(self, way: JumpPath) -> Tuple[Decider, str]:
        """Spend a recovery on going to a place, or return what prevents it, and why."""
        reason = self.why_repeats_on(way)
        if reason:
            return Decider.ON_RETRY, reason
        reason = self._why_not(way)
        if reason:
            return Decider.POLICY, reason
        spent = self._budget.take_recovery()
        return (Decider.BUDGET, spent) if spent else (Decider.POLICY, '')

    def _why_repeats(self, label: str) -> str:
        """Say what would be repeated if the machine went to a state by itself, or '' if nothing."""
        return self.why_repeats_on(JumpPath((), self._node, (TreePlace(self._node, label),)))

    def why_repeats_on(self, way: JumpPath) -> str:
        """Say what would be repeated if the machine went to a place by itself, or '' if nothing."""
        repeated, place = repeated_on(way), way.down[-1]
        if not repeated:
            return ''
        target = self._named(way)
        if not has_visited(place.node, place.label):
            return 'this trial has not been in {}, and going there may repeat {}'.format(
                target, ', '.join(repeated)
            )
        return going_would_repeat(self._record.label, target, repeated)

    def _why_not(self, way: JumpPath) -> str:
        """Return why the machine cannot go on to a place by itself now, '' where it can."""
        return closed_in_words(way, self._named(way)) or self._function_that_runs()

    def _function_that_runs(self) -> str:
        """Return which function among the preconditions was left behind and runs, '' for none."""
        workers = self._node.tree.workers
        for spec in self._record.settings.preconditions if workers.abandoned else ():
            for name, function in spec.functions():
                blocked = workers.blocked(function)
                if blocked:
                    return '{} {}'.format(name, blocked)
        return ''

    def facts_of(self, action: Action, **fields: Any) -> DecisionFacts:
        """Return what has led to a decision."""
        record = self._record
        standing = self._standing or record.read_rate()
        return DecisionFacts(
            record.label,
            standing.recent,
            standing.rate,
            self._continuous,
            action,
            met=self._met,
            not_met=self._not_met,
            tried=standing.tried,
            not_failed=self.failure.why_none,
            **fields,
        )

    # -- preconditions

    def _run_preconditions(self, failure_class: FailureClass) -> Preconditions:
        record = self._record
        specs = record.settings.preconditions
        if not specs:
            return Preconditions.NONE
        if not self._node.in_force.policy.runs_preconditions(failure_class):
            return Preconditions.NOT_MET
        for spec in specs:
            if self._stop.scope.reason is not None or not self._run_precondition(spec):
                return Preconditions.NOT_MET
        return Preconditions.MET

    def _run_precondition(self, spec: PreconditionSpec) -> bool:
        emit, label = self._node.emit, self._record.label
        emit(EventKind.PRECONDITION_START, label, target=spec.name)
        why_not = self._preconditions.run(spec)
        for _ in range(self._record.most_repeats if why_not else 0):
            if not why_not or not self._stop.has_waited_after(
                'did not get its precondition ' + spec.name
            ):
                break
            why_not = self._preconditions.run(spec)
        outcome = 'not met' if why_not else 'met'
        emit(EventKind.PRECONDITION_END, label, outcome, spec.name, text=why_not)
        if why_not:
            self._not_met = spec.name
        else:
            self._met.append(spec.name)
        self.tried.append(
            'precondition {}: {}'.format(
                spec.name, '{} ({})'.format(outcome, why_not) if why_not else outcome
            )
        )
        return not why_not
