"""The sites of branches: plain states of a Concurrence or an Iterator."""

from dataclasses import replace
from typing import Any, Optional, Tuple, cast

import smach

from ..asking.question import OutcomeChoice
from ..identity import attribute_of
from ..machine.site import Route, Site, judged_at, leads_to_next_item
from ..machine.tree_node import TreeNode
from ..records.events import Event, EventKind, FailureKind
from ..settings.settings import Settings, StateSettings
from ..smach_private import final_outcomes_of, outcome_map_of, states_of
from .wrapper import wrapper_of

NEXT_ITEM = 'the next item'
_LEAVES = frozenset((EventKind.TRANSITION, EventKind.SUPERSEDE, EventKind.GIVE_UP))


class BranchSite(Site):
    """The Concurrence that holds a plain state, as the oracle of the state knows it."""

    is_container = False
    begins_by = EventKind.STATE_START

    def __init__(self, node: TreeNode, container: smach.Container, label: str) -> None:
        super().__init__(node)
        self.container = container
        self.label = label

    def shown(self) -> smach.Container:
        """Return the container that people see."""
        return self.container

    def settings_here(self, settings: Settings) -> Settings:
        """Keep the userdata at jumps: others write it at the same time."""
        return replace(settings, userdata='keep', deep_copy_keys=())

    def settings_of_state(self, settings: StateSettings) -> StateSettings:
        """Leave out preconditions by label: beside a branch is no state that could be run for it.

        A path names one elsewhere.
        """
        if not any(spec.labels() for spec in settings.preconditions):
            return settings
        return replace(
            settings,
            preconditions=tuple(
                spec
                for spec in settings.preconditions
                if all('/' in label for label in spec.labels())
            ),
        )

    def foresees(
        self, outcome: str, route: Route, kind: FailureKind, settings: StateSettings
    ) -> bool:
        """Whether the author has said what is to happen at this failing outcome."""
        return settings.author_recoveries != 'override' and self._is_drawn(outcome)

    def _is_drawn(self, outcome: str) -> bool:
        """Whether the outcome map names it for the branch, and leads to what is no failure."""
        return any(
            not is_failure_above(self._node, name)
            for name, conditions in _entries(outcome_map_of(self.container))
            if dict(_entries(conditions)).get(self.label) == outcome
        )

    def shown_route(self, route: Route, outcome: str) -> Route:
        """Say where an outcome leads, for people."""
        return Route(self._leads_to(outcome), True)

    def _leads_to(self, outcome: str) -> str:
        return 'the end of this branch'

    def choices(self, label: str) -> Tuple[OutcomeChoice, ...]:
        """Return the outcomes, and where they lead. Those that lead to the next item come first."""
        choices = (
            OutcomeChoice(outcome, self._leads_to(outcome))
            for outcome in states_of(self._node.machine)[label].get_registered_outcomes()
        )
        return tuple(
            sorted(choices, key=lambda choice: (choice.target != NEXT_ITEM, str(choice.outcome)))
        )

    def ended_by(self, event: Event) -> Optional[str]:
        """Return the outcome with which the branch ends at an event, None for other events."""
        outcome = event.outcome if event.kind is EventKind.GIVE_UP else event.target
        is_end = event.kind in _LEAVES and outcome != '' and not self._node.is_oracle(outcome)
        return outcome if is_end else None

    def is_line_over(self, event: Event) -> bool:
        """Whether the branch is over by an event."""
        return self.ended_by(event) is not None


class IteratorSite(BranchSite):
    """The Iterator that holds a plain state."""

    def settings_here(self, settings: Settings) -> Settings:
        """Return the settings of the whole machine as they are: its state runs alone."""
        return settings

    def _is_drawn(self, outcome: str) -> bool:
        """Whether it leads to the next item, or is mapped to what is no failure."""
        if leads_to_next_item(self.container, outcome):
            return True
        mapped = final_outcomes_of(self.container)
        return outcome in mapped and not is_failure_above(self._node, mapped[outcome])

    def _leads_to(self, outcome: str) -> str:
        if leads_to_next_item(self.container, outcome):
            return NEXT_ITEM
        return 'the end of the iteration, with {}'.format(
            final_outcomes_of(self.container).get(outcome, outcome)
        )

    def tell_item_passed_over(self, label: str, outcome: str) -> None:
        """Say which item is passed over where this failing outcome leads to the next one."""
        wrapper = wrapper_of(self.container)
        item = wrapper.in_words() if wrapper is not None else ''
        if item and leads_to_next_item(self.container, outcome):
            text = '{} is passed over with {}, as its author has drawn it'
            self._node.warn(text.format(item, outcome), label)


def is_failure_above(node: TreeNode, outcome: str) -> bool:
    """Whether an outcome of the Concurrence or Iterator of a branch is a failure above it.

    By its name alone where another Concurrence or Iterator is around it.
    """
    labels = node.labels_from_parent
    if len(labels) != 1:
        return outcome in node.in_force.failing
    parent = cast('TreeNode', node.parent)
    return judged_at(parent, labels[0], outcome)[1] is not FailureKind.NOT_A_FAILURE


def _entries(given: object) -> Tuple[Tuple[Any, object], ...]:
    """Return the entries of an outcome map, or of the conditions in it. None of what is no map."""
    items = attribute_of(given, 'items')
    return tuple(items()) if callable(items) else ()
