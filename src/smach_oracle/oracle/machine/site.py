"""The place where the states of a wrapped container run, and where outcomes lead there."""

from typing import TYPE_CHECKING, Iterable, NamedTuple, Optional, Tuple, cast

import smach

from ..asking.question import OutcomeChoice
from ..records.events import Event, EventKind, FailureKind
from ..settings.failing_outcomes import FailingNames, name_text
from ..settings.settings import Settings, StateSettings
from ..smach_private import break_outcomes_of, loop_outcomes_of, states_of, transitions_of

if TYPE_CHECKING:
    from .tree_node import TreeNode


class Route(NamedTuple):
    """The target of an outcome, as the machine's author drew it."""

    target: str  # a state, a container outcome, or '' where it leads nowhere
    is_state: bool

    @property
    def leads_on(self) -> bool:
        """Whether it leads anywhere. An outcome need not be text, and may be False or 0."""
        return self.target != ''


def route_of(machine: smach.StateMachine, label: str, outcome: str) -> Route:
    """Follow an outcome of a state.

    It leads to a state, to a container outcome by its target's or its own name, or nowhere.
    """
    transitions = transitions_of(machine).get(label, {})
    if outcome not in transitions:  # registered after the state was added: nothing was drawn for it
        return Route('', False)
    target = transitions[outcome]
    if target is not None and target in states_of(machine):
        return Route(target, True)
    container_outcomes = machine.get_registered_outcomes()
    for name in (target, outcome):
        if name is not None and name in container_outcomes:
            return Route(name, False)
    return Route('', False)


def outcome_told(outcomes: Iterable[str], told: object) -> str:
    """Return the outcome of which a record has the text, that text where there is none."""
    text = name_text(told)
    return next((each for each in outcomes if name_text(each) == text), text)


def failure_kind(
    outcome: str, route: Route, settings: StateSettings, failing: FailingNames
) -> FailureKind:
    """Classify a registered outcome, without regard to who recovers from it."""
    text = name_text(outcome)
    if route.leads_on and text in settings.intended_outcomes:
        return FailureKind.NOT_A_FAILURE
    if text in settings.failure_outcomes:
        return FailureKind.FAILING_OUTCOME
    if not route.leads_on:
        return FailureKind.UNREGISTERED_OUTCOME
    if not route.is_state and route.target in failing:
        excused = failing.excuse(outcome)
        return FailureKind.NOT_A_FAILURE if excused else FailureKind.FELL_THROUGH
    return FailureKind.FAILING_OUTCOME if outcome in failing else FailureKind.NOT_A_FAILURE


def judged_at(node: 'TreeNode', label: str, outcome: str) -> Tuple[Route, FailureKind]:
    """Return where an outcome of a state leads, and whether that is a failure."""
    route = route_of(node.machine, label, outcome)
    return route, failure_kind(outcome, route, node.settings_of(label), node.in_force.failing)


def author_recovers(outcome: str, route: Route, kind: FailureKind, settings: StateSettings) -> bool:
    """Whether the author's own transition from this failing outcome stays.

    It does where it leads to another state, or, for an outcome that only sounds like a failure, to
    a container outcome that does not.
    """
    if settings.author_recoveries == 'override' or kind is not FailureKind.FAILING_OUTCOME:
        return False
    return route.is_state or name_text(outcome) not in settings.failure_outcomes


def leads_to_next_item(container: smach.Container, outcome: str) -> bool:
    """Whether a container is an Iterator that goes on behind this outcome of its state."""
    if not isinstance(container, smach.Iterator):
        return False
    looping, breaking = loop_outcomes_of(container), break_outcomes_of(container)
    return outcome not in breaking and (not looping or outcome in looping)


def goes_unnoticed(node: 'TreeNode', route: Route) -> bool:
    """Whether a failure that ends a container has no outcome there by which others notice it.

    So its author was not able to say more of it, and the oracle recovers from it.
    """
    failing = node.in_force.failing
    return (
        failing.by_name
        and not route.is_state
        and not any(each in failing for each in node.machine.get_registered_outcomes())
    )


class Site:
    """A place where states run: this one is a StateMachine.

    `branches` has those of the plain states of Concurrences and Iterators. There the oracle
    knows one state alone, which works on the userdata of the container. Whoever does something
    that depends on the place asks the site of the node.

    `is_container`: whether it is a container that its author made. It begins and ends by its own
    events, its states have userdata and neighbours, and it goes on by registered outcomes alone.
    `label`: of the only state, else ''.
    `begins_by`: the event by which it begins.
    """

    is_container = True
    label = ''
    begins_by = EventKind.CONTAINER_START

    def __init__(self, node: 'TreeNode') -> None:
        self._node = node

    def shown(self) -> smach.Container:
        """Return the container that people see."""
        return cast('smach.Container', self._node.machine)

    # -- settings

    def settings_here(self, settings: Settings) -> Settings:
        """Return the settings of the whole machine as they are in force here."""
        return settings

    def settings_of_state(self, settings: StateSettings) -> StateSettings:
        """Return the settings of a state as they are in force here."""
        return settings

    # -- where outcomes lead

    def foresees(
        self, outcome: str, route: Route, kind: FailureKind, settings: StateSettings
    ) -> bool:
        """Whether the author has said what is to happen at this failing outcome of a state."""
        recovers = author_recovers(outcome, route, kind, settings)
        return recovers and not goes_unnoticed(self._node, route)

    def shown_route(self, route: Route, outcome: str) -> Route:
        """Return where an outcome leads, for people."""
        return route

    def choices(self, label: str) -> Tuple[OutcomeChoice, ...]:
        """Return the outcomes of a state that lead on, and where, as an expert is shown them."""
        outcomes = sorted(states_of(self._node.machine)[label].get_registered_outcomes(), key=str)
        routes = ((outcome, route_of(self._node.machine, label, outcome)) for outcome in outcomes)
        return tuple(
            OutcomeChoice(outcome, route.target) for outcome, route in routes if route.leads_on
        )

    # -- what is told

    def tell_item_passed_over(self, label: str, outcome: str) -> None:
        """Say what the author passes over by a failing outcome that is foreseen."""

    def ended_by(self, event: Event) -> Optional[str]:
        """Return the outcome with which it ends at an event of its own, None for other events."""
        is_end = event.kind is EventKind.CONTAINER_END and event.outcome != ''
        return event.outcome if is_end else None

    def is_line_over(self, event: Event) -> bool:
        """Whether no state follows in its thread, that of a Concurrence, after an event."""
        return event.kind is EventKind.CONTAINER_END and len(self._node.labels_from_parent) > 1
