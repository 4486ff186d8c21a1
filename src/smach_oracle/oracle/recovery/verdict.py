"""The verdict on one failure: where the machine goes from the meta state (paper, section IV-A).

There are four kinds, and no other way out. `execution.applying` carries them out.
"""

from typing import FrozenSet, NamedTuple, Optional, Union

from ..machine.tree_node import TreeNode
from ..places.way import Way
from .failure import ContainerEnding


class JumpTo(NamedTuple):
    """Go to a state, its userdata as the settings say."""

    way: Way
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
