"""An Iterator that the oracle enters again goes on with the item that was not finished."""

import smach

from ..branches.border import IteratorBorder, border_of
from ..machine.tree_node import TreeNode
from ..recovery.failure import Failure
from ..recovery.judging import judge
from ..settings.failing_outcomes import is_preempted


def ask_to_go_on(node: TreeNode, target: str) -> None:
    """Note that the oracle goes to a state: an Iterator that has failed or was left goes on there.

    Any other Iterator of the container begins again when it is entered.
    """
    for label, state in list(node.machine._states.items()):
        border = border_of(state) if isinstance(state, smach.Container) else None
        if isinstance(border, IteratorBorder):
            border.ask_to_go_on(label == target and has_stopped_early(node, label, border))


def has_stopped_early(node: TreeNode, label: str, border: IteratorBorder) -> bool:
    """Whether an Iterator has failed or was left, when it was executed last."""
    outcome = border.outcome_before()
    return (
        outcome is None
        or is_preempted(outcome)
        or isinstance(judge(node, node.record(label), outcome, None), Failure)
    )
