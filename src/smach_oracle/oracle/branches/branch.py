"""One branch: where its outcomes lead, by its author's word."""

from dataclasses import replace
from typing import Any, Tuple

import smach

from ..identity import attribute_of
from ..machine.tree_node import TreeNode
from ..records.events import FailureKind
from ..recovery.failure import failure_kind, route_of
from ..settings.settings import Settings
from .items import TrackedItems


class Branch:
    """The Concurrence or Iterator that holds a plain state, as the oracle of the state knows it."""

    def __init__(self, container: smach.Container, label: str) -> None:
        self.container: Any = container
        self.label = label

    def settings_here(self, settings: Settings) -> Settings:
        """Return the settings of the whole machine as they are in force for the branch."""
        return settings

    def foresees(self, node: TreeNode, outcome: str) -> bool:
        """Whether the author has said what is to happen at this failing outcome."""
        raise NotImplementedError

    def leads_to(self, outcome: str) -> str:
        """Say where an outcome leads, for people."""
        raise NotImplementedError

    def goes_on_after(self, outcome: str) -> bool:
        """Whether an outcome leads to the next item."""
        return False

    def passes_over(self, outcome: str) -> str:
        """Say what is passed over where this failing outcome is foreseen, or '' for nothing."""
        return ''


class ConcurrenceBranch(Branch):
    """One state of a Concurrence."""

    def settings_here(self, settings: Settings) -> Settings:
        """Keep the userdata at jumps: others write it at the same time."""
        return replace(settings, userdata='keep', deep_copy_keys=())

    def foresees(self, node: TreeNode, outcome: str) -> bool:
        """Whether the outcome map names it for the branch, and leads to what is no failure."""
        return any(
            not is_failure_above(node, name)
            for name, conditions in _entries(self.container._outcome_map)
            if dict(_entries(conditions)).get(self.label) == outcome
        )

    def leads_to(self, outcome: str) -> str:
        """Say where an outcome leads, for people."""
        return 'the end of this branch'


class IteratorBranch(Branch):
    """The state of an Iterator."""

    def foresees(self, node: TreeNode, outcome: str) -> bool:
        """Whether it leads to the next item, or is mapped to what is no failure."""
        if loops(self.container, outcome):
            return True
        mapped = self.container._final_outcome_map
        return outcome in mapped and not is_failure_above(node, mapped[outcome])

    def leads_to(self, outcome: str) -> str:
        """Say where an outcome leads, for people."""
        if loops(self.container, outcome):
            return 'the next item'
        return 'the end of the iteration, with {}'.format(
            self.container._final_outcome_map.get(outcome, outcome)
        )

    def goes_on_after(self, outcome: str) -> bool:
        """Whether an outcome leads to the next item."""
        return loops(self.container, outcome)

    def passes_over(self, outcome: str) -> str:
        """Say which item is passed over where this failing outcome leads to the next one."""
        items = self.container._items
        if isinstance(items, TrackedItems) and loops(self.container, outcome):
            return items.in_words()
        return ''


def loops(iterator: smach.Iterator, outcome: str) -> bool:
    """Whether an outcome of its state leads an Iterator to the next item."""
    looping, breaking = iterator._loop_outcomes, iterator._break_outcomes
    return outcome not in breaking and (not looping or outcome in looping)


def is_failure_above(node: TreeNode, outcome: str) -> bool:
    """Whether an outcome of the Concurrence or Iterator of a branch is a failure above it.

    By its name alone where another Concurrence or Iterator is around it.
    """
    parent = node.parent
    if parent is None or len(node.below) != 1:
        return outcome in node.in_force.failing
    (label,) = node.below
    kind = failure_kind(
        outcome,
        route_of(parent.machine, label, outcome),
        parent.settings_of(label).failure_outcomes,
        parent.in_force.failing,
    )
    return kind is not FailureKind.NOT_A_FAILURE


def _entries(given: object) -> Tuple[Tuple[Any, Any], ...]:
    """Return the entries of an outcome map, or of the conditions in it. None of what is no map."""
    items = attribute_of(given, 'items')
    return tuple(items()) if callable(items) else ()
