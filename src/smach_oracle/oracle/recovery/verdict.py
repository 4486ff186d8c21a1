"""The verdict on one failure: where the machine goes from the meta state (paper, section IV-A).

There are four kinds, and no other way out. `execution.applying` carries them out.
"""

from typing import Callable, FrozenSet, NamedTuple, Optional, Union

import smach

from ..asking.question import Answer, AnswerKind
from ..machine.jump_path import JumpPath, jump_path_to
from ..machine.places import levels_above, place_at
from ..machine.snapshots import WriteWatch
from ..machine.tree_node import TreeNode
from .endings import ContainerEnding


class JumpTo(NamedTuple):
    """Go to a state, its userdata as the settings say."""

    way: JumpPath
    by: str = ''  # the expert's name
    text: str = ''
    # userdata keys of the container where the ways meet that survive a restore
    written: FrozenSet[str] = frozenset()
    decided_by: Optional[TreeNode] = None  # the level above, as if its own state had failed
    restarts: bool = False  # with the userdata of the start, in all containers


class Supersede(NamedTuple):
    """Go on as if the failed state had ended with `outcome`."""

    outcome: str
    by: str = ''
    text: str = ''


class GiveUp(NamedTuple):
    """End, or go on, as `ending` says."""

    ending: ContainerEnding
    by: str = ''
    text: str = ''
    level: Optional[TreeNode] = None  # the container that ends. None: that of the failure


class Preempted(NamedTuple):
    """End, or go on, as `ending` says: a preempt or a shutdown has ended the recovery.

    `ending` is empty where the trial ends early, and the container has no outcome.
    """

    ending: ContainerEnding = ContainerEnding()


Verdict = Union[JumpTo, Supersede, GiveUp, Preempted]


def arrives_at(verdict: Verdict) -> Optional[TreeNode]:
    """Return the level above that goes on, once the containers below it are left.

    None means no other.
    """
    if isinstance(verdict, JumpTo):
        return verdict.way.meets if verdict.way.left else None
    return verdict.level if isinstance(verdict, GiveUp) else None


def leads_to(verdict: Verdict) -> str:
    """Return the state or outcome that the meta state leads to.

    It is '' where it raises, and where a level above goes on.
    """
    if arrives_at(verdict) is not None:
        return ''
    if isinstance(verdict, JumpTo):
        return verdict.way.first
    if isinstance(verdict, Supersede):
        return verdict.outcome
    return verdict.ending.state or verdict.ending.outcome or ''


# -- of an answer


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
        way = jump_path_of(answer, node)
        return JumpTo(way, answer.by, answer.why, way.kept(watch))
    if answer.kind is AnswerKind.SUPERSEDE:
        return Supersede(answer.outcome, answer.by, answer.why)
    ending = ContainerEnding(outcome=answer.outcome) if answer.outcome else natural_ending()
    return GiveUp(ending, answer.by, answer.why, _level_of(answer, node))


def jump_path_of(answer: Answer, node: TreeNode) -> JumpPath:
    """Return the way that an answer sends the machine.

    :raises InvalidStateError: where there is none. An answer that was checked has one.
    """
    place = place_at(node, answer.container, answer.state)
    way = jump_path_to(node, place) if place is not None else None
    if way is None:
        raise smach.InvalidStateError(
            'there is no way to {}/{}'.format(answer.container or node.path, answer.state)
        )
    return way


def _level_of(answer: Answer, node: TreeNode) -> Optional[TreeNode]:
    """Return the level above that an answer gives up, or None where it is the container itself."""
    return next((level for level in levels_above(node) if level.path == answer.container), None)
