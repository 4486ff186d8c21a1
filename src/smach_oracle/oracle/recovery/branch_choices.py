"""Describes Concurrences and Iterators in a question: where outcomes lead, what runs again."""

from typing import Any, Iterator, Tuple

import smach

from ..asking.question import OutcomeChoice
from ..machine.tree_node import TreeNode
from ..places.way import Way


def outcomes_of_branch(node: TreeNode, state: smach.State) -> Tuple[OutcomeChoice, ...]:
    """Return the outcomes of a branch, and in words where they lead. None where it is no branch.

    Those that go on with the next item come first.
    """
    branch = node.branch
    if branch is None:
        return ()
    last = [
        (not branch.goes_on_after(outcome), str(outcome), outcome)
        for outcome in state.get_registered_outcomes()
    ]
    return tuple(OutcomeChoice(outcome, branch.leads_to(outcome)) for _, _, outcome in sorted(last))


def running_again(way: Way) -> Tuple[str, ...]:
    """Return the branches that would all run again if the machine went a way.

    They are those of the outermost Concurrence that is entered, be it the place or on the way down.
    """
    for entered in _entered_on(way):
        if isinstance(entered, smach.Concurrence):
            return tuple(map(str, entered.get_children()))
    return ()


def _entered_on(way: Way) -> Iterator[smach.State]:
    """Yield the states that are entered, outermost first.

    Containers between two places, such as a Concurrence in an Iterator, are among them.
    """
    for place, below in zip(way.down, way.down[1:]):
        around: Any = place.node.machine._states[place.label]
        yield around
        for label in below.node.below[1:]:
            around = around.get_children()[label]
            yield around
    last = way.down[-1]
    yield last.node.machine._states[last.label]
