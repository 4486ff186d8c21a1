"""Verdicts of the meta state, for the machine."""
from enum import Enum
from typing import FrozenSet, NamedTuple, Optional

from ..machine.tree_node import TreeNode
from ..places.way import Way
from .failure import ContainerEnding


class VerdictKind(Enum):
    """Ways out of the meta state."""

    JUMP = 'jump'  # to a state, its userdata as the settings say
    SUPERSEDE = 'supersede'  # the failed state counts as having ended with `outcome`
    GIVE_UP = 'give up'  # end, or go on, as `ending` says
    PREEMPTED = 'preempted'  # a preempt or a shutdown ended the recovery. `ending` as above


class Verdict(NamedTuple):
    """One way out of the meta state."""

    kind: VerdictKind
    way: Optional[Way] = None  # JUMP
    outcome: str = ''  # SUPERSEDE
    ending: ContainerEnding = ContainerEnding()
    by: str = ''  # the expert's name
    text: str = ''
    # JUMP: userdata keys of the container where the ways meet that survive a restore
    written: FrozenSet[str] = frozenset()
    # JUMP: the level above that decided on it, as if its own state had failed
    decided_by: Optional[TreeNode] = None
    restarts: bool = False  # JUMP: with the userdata of the start, in all containers
    level: Optional[TreeNode] = None  # GIVE_UP: the container that ends. None: that of the failure

    @property
    def arrives_at(self) -> Optional[TreeNode]:
        """Return the level above that goes on, once the containers below it are left.

        None means no other.
        """
        if self.way is not None:
            return self.way.meets if self.way.left else None
        return self.level

    def leads_to(self) -> str:
        """Return the state or outcome that the meta state leads to.

        It is '' where it raises, and where a level above goes on.
        """
        if self.arrives_at is not None:
            return ''
        if self.way is not None:
            return self.way.first
        return self.outcome or self.ending.state or self.ending.outcome or ''
