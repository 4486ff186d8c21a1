"""Makes a verdict of an expert's answer."""

from typing import Callable, Optional

import smach

from ..asking.question import Answer, AnswerKind
from ..machine.snapshots import WriteWatch
from ..machine.tree_node import TreeNode
from ..places.levels import levels_above
from ..places.place import place_at
from ..places.way import Way, way_to
from .failure import ContainerEnding
from .verdict import GiveUp, JumpTo, Supersede, Verdict


def verdict_of(
    answer: Answer,
    node: TreeNode,
    label: str,
    watch: WriteWatch,
    natural_ending: Callable[[], ContainerEnding],
) -> Verdict:
    """Write the outputs of an answer about a state, and return the way out of the meta state.

    `natural_ending`: how the container ends where the answer gives up without an outcome.
    """
    remapping = node.machine._remappings.get(label) or {}
    for key, value in (answer.outputs or {}).items():
        watch.gate[remapping.get(key, key)] = value
    if answer.kind is AnswerKind.GOTO:
        way = way_of(answer, node)
        return JumpTo(way, answer.by, answer.why, way.kept(watch))
    if answer.kind is AnswerKind.SUPERSEDE:
        return Supersede(answer.outcome, answer.by, answer.why)
    ending = ContainerEnding(outcome=answer.outcome) if answer.outcome else natural_ending()
    return GiveUp(ending, answer.by, answer.why, _level_of(answer, node))


def way_of(answer: Answer, node: TreeNode) -> Way:
    """Return the way that an answer sends the machine.

    :raises InvalidStateError: where there is none. An answer that was checked has one.
    """
    place = place_at(node, answer.container, answer.state)
    way = way_to(node, place) if place is not None else None
    if way is None:
        raise smach.InvalidStateError(
            'there is no way to {}/{}'.format(answer.container or node.path, answer.state)
        )
    return way


def _level_of(answer: Answer, node: TreeNode) -> Optional[TreeNode]:
    """Return the level above that an answer gives up, or None where it is the container itself."""
    return next((level for level in levels_above(node) if level.path == answer.container), None)
