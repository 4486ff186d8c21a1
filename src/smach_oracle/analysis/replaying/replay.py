"""Follows recorded trials as an oracle does, and says what it would decide."""

from typing import Any, Dict, Iterable, List, Mapping, NamedTuple, Optional, Set, Tuple

from smach_oracle.oracle.decision.by_ways import action_of
from smach_oracle.oracle.decision.failure_rate import FailureClass, classify, make_estimator
from smach_oracle.oracle.decision.policies import policy_named
from smach_oracle.oracle.decision.policy import (
    Action,
    FailureContext,
    Past,
    Policy,
    Preconditions,
    Situation,
)
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind
from smach_oracle.oracle.records.facts import Decider, branches_of, decided_by
from smach_oracle.oracle.records.history import History
from smach_oracle.oracle.records.visits import Visit, VisitResult

from .followed import Preempts
from .menus import chosen_way, offers_preconditions, recorded_menu
from .way_reader import WayReader

ENOUGH_VISITS = 50
NOT_KNOWN = 'not known'  # what it would decide
_OUTSIDE_POLICIES = (Decider.MAX_RECOVERIES, Decider.BUDGET, Decider.ON_RETRY, Decider.AUTHOR)
STAYS = (Action.ASK.value, Action.GIVE_UP.value)

Key = Tuple[str, str]  # path and state


class ReplayedDecision(NamedTuple):
    """A decision of the oracle that follows.

    `action`: or 'not known'. `way`: of the menu, where the policy goes by ways. `lacks_menu`:
    nothing is known since the recorded policy has told of no menu. `situation`: with the menu that
    a policy that goes by ways chooses from.
    """

    action: str
    way: str = ''
    lacks_menu: bool = False
    situation: Optional[Situation] = None

    def is_as(self, event: Event) -> bool:
        """Whether it is the recorded decision. Ways are compared where both go by ways."""
        chosen = chosen_way(event)
        return self.action == event.outcome and (not (self.way and chosen) or self.way == chosen)


class _LearnedState:
    """An oracle's knowledge of a state: what it learns, and what it knows of this failure."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self.estimator = make_estimator(
            settings['estimator'], settings['memory'], settings['prior']
        )
        self.context: Optional[FailureContext] = None
        self.held_back = False  # the present question is about no failure
        self.recoveries = 0  # of this trial, as recorded
        self.interrupted = False  # the program was stopped while it ran: nothing is learned of it
        # whether each was met, of those run for the present failure
        self.preconditions: List[bool] = []


class Replay:
    """An oracle that follows the recorded trials of one replicate, in their order."""

    def __init__(self, settings: Mapping[str, Any], conditioned: Mapping[Key, bool]) -> None:
        """`conditioned`: whether a state has preconditions, where that is known."""
        self._settings = settings
        self._policy = policy_of(settings)
        self._restarts = 0  # of this trial, as recorded
        self._conditioned = conditioned
        self._states: Dict[Key, _LearnedState] = {}
        self._histories: Dict[Key, History] = {}
        self._branches: Dict[str, Tuple[str, ...]] = {}  # states that are on their own, by path
        self._running: Set[str] = set()  # paths of containers
        self._go_on: Set[str] = set()  # those that ran when the program was stopped
        self._preempts = Preempts()
        self._ways = WayReader() if self._policy.learns else None

    def take(self, event: Event) -> Optional[ReplayedDecision]:
        """Follow one event. Return the decision at a DECISION ('not known' included), else None."""
        if self._ways is not None:
            self._ways.take(event)
        self._preempts.take(event)
        if event.kind == EventKind.TRIAL_START:
            self._begin_trial()
        elif event.kind == EventKind.RESUMED:
            self._go_on = set(self._running)
        elif event.kind == EventKind.CONTAINER_END and event.outcome:
            self._running.discard(event.path)
        elif event.kind == EventKind.CONTAINER_START:
            self._begin_execution(event)
        elif event.kind == EventKind.STATE_START:
            self._begin_visit(event)
        elif event.kind == EventKind.FAILURE:
            self._failed(event)
        elif event.kind == EventKind.TRANSITION:
            self._left(event)
        elif event.kind == EventKind.PRECONDITION_END:
            self._state(event).preconditions.append(event.outcome == 'met')
        elif event.kind == EventKind.SUPERSEDE:
            self._superseded(event)
        elif event.kind == EventKind.DECISION:
            self._state(event).held_back = decided_by(event) is Decider.HELD_BACK
            return None if self._state(event).held_back else self._decided(event)
        return None

    def _begin_trial(self) -> None:
        self._running.clear()
        for history in self._histories.values():
            history.begin_trial()
        for state in self._states.values():
            state.recoveries = 0
        self._restarts = 0

    def _decided(self, event: Event) -> ReplayedDecision:
        """Decide, and note what was done instead."""
        tried = self._decide(event)
        self._state(event).recoveries += event.outcome not in STAYS
        self._restarts += event.outcome == Action.RESTART.value
        return tried

    def rate(self, event: Event) -> float:
        """Return what it has learned of the event's state."""
        return self._state(event).estimator.rate

    def learned(self) -> Dict[Key, Dict[str, Any]]:
        """Return what it has learned of each state, as a rates file has it."""
        return {key: dict(state.estimator.snapshot()) for key, state in self._states.items()}

    def _state(self, event: Event) -> _LearnedState:
        key = (event.path, event.state)
        if key not in self._states:
            self._states[key] = _LearnedState(self._settings)
        return self._states[key]

    def _begin_execution(self, event: Event) -> None:
        if event.path in self._go_on:
            self._go_on.discard(event.path)
            return
        self._running.add(event.path)
        branches = branches_of(event)
        self._branches[event.path] = branches
        for key in [(event.path, state) for state in branches] or [(event.path, '')]:
            self._histories.setdefault(key, History(ENOUGH_VISITS)).begin_execution()

    def _history(self, event: Event) -> History:
        """Return the chain of the event's container, or of its state where that is on its own."""
        alone = event.state in self._branches.get(event.path, ())
        key = (event.path, event.state if alone else '')
        return self._histories.setdefault(key, History(ENOUGH_VISITS))

    def _failed(self, event: Event) -> None:
        state, history = self._state(event), self._history(event)
        state.interrupted = event.failure_kind == FailureKind.INTERRUPTED
        if state.interrupted:
            state.context = None
            return
        successes = state.estimator.successes
        state.context = history.failure_context(event.state, '', successes)
        state.preconditions = []
        history.failed(event.state, successes)
        state.estimator.add(True)
        self._visited(event, VisitResult.FAILURE)

    def _superseded(self, event: Event) -> None:
        state = self._state(event)
        if state.context is None or state.held_back:  # no failure of this visit was counted
            self._visited(event, VisitResult.SUPERSEDED)
            return
        state.estimator.take_back_failure()
        is_conditioned = self._conditioned.get((event.path, event.state), False)
        self._history(event).supersede(event.state, event.outcome, is_conditioned)

    def _left(self, event: Event) -> None:
        state = self._state(event)
        # the end of the visit whose failure is known, or of none: the state was held back
        if state.context is not None or state.interrupted or not event.outcome:
            return
        if self._preempts.is_success(event):
            state.estimator.add(False)
            self._visited(event, VisitResult.SUCCESS)

    def _visited(self, event: Event, result: VisitResult) -> None:
        self._history(event).visited(
            Visit(event.state, event.outcome, result),
            self._conditioned.get((event.path, event.state), False),
        )

    def _begin_visit(self, event: Event) -> None:
        """Note that a state is about to run."""
        state = self._state(event)
        state.context, state.interrupted = None, False

    def _decide(self, event: Event) -> ReplayedDecision:
        state = self._state(event)
        if decided_by(event) in _OUTSIDE_POLICIES:
            return ReplayedDecision((Action.ASK if self._policy.asks else Action.GIVE_UP).value)
        failure_class = classify(
            state.estimator.rate, self._settings['moderate_from'], self._settings['high_from']
        )
        if self._policy.goes_by_ways:
            return self._by_ways(event, state, failure_class)
        preconditions = self._preconditions(event, state, failure_class)
        if preconditions is None or state.context is None:
            return ReplayedDecision(NOT_KNOWN)
        actions = self._policy.may_do(
            Situation(
                failure_class,
                preconditions,
                self._policy.is_continuous(state.context),
                Past(state.recoveries, self._restarts),
            )
        )
        if len(actions) > 1:  # it would be drawn
            return ReplayedDecision(NOT_KNOWN)
        return ReplayedDecision(actions[0].value)

    def _by_ways(
        self, event: Event, state: _LearnedState, failure_class: FailureClass
    ) -> ReplayedDecision:
        """Choose from the recorded menu."""
        recorded, policy = recorded_menu(event, self._settings), self._policy
        if recorded is None or state.context is None:
            return ReplayedDecision(NOT_KNOWN, lacks_menu=recorded is None)
        menu = recorded.menu
        if self._ways is not None:
            menu = menu._replace(evidence=self._ways.evidence((event.path, event.state)))
        situation = Situation(
            failure_class,
            Preconditions.NONE,
            policy.is_continuous(state.context),
            recorded.past,
            menu,
        )
        order = policy.order(situation)
        if order and policy.draws:
            return ReplayedDecision(NOT_KNOWN, situation=situation)
        way = order[0].key if order else ''
        return ReplayedDecision(action_of(order).value, way, situation=situation)

    def _preconditions(
        self, event: Event, state: _LearnedState, failure_class: FailureClass
    ) -> Optional[Preconditions]:
        if self._conditioned.get((event.path, event.state)) is False:
            return Preconditions.NONE
        if not self._policy.runs_preconditions(failure_class):
            return Preconditions.NOT_MET
        if not state.preconditions:
            return None  # they were not run: nobody knows whether they would have been met
        return Preconditions.MET if all(state.preconditions) else Preconditions.NOT_MET


def policy_of(settings: Mapping[str, Any]) -> Policy:
    prefix = 'policy.'
    return policy_named(
        settings['policy'],
        {key[len(prefix) :]: value for key, value in settings.items() if key.startswith(prefix)},
    )


def conditioned(events: Iterable[Event], policy: Policy) -> Dict[Key, bool]:
    """Return whether states have preconditions, if known: those where some were run do.

    Those where none were run, though they would have been, do not. A menu tells it, too.
    """
    known: Dict[Key, bool] = {}
    for event in events:
        key = (event.path, event.state)
        if event.kind == EventKind.PRECONDITION_START:
            known[key] = True
        elif (
            event.kind == EventKind.DECISION
            and decided_by(event) is Decider.POLICY
            and (
                policy.goes_by_ways or policy.runs_preconditions(FailureClass(event.failure_class))
            )
        ):
            known.setdefault(key, offers_preconditions(event))
    return known
