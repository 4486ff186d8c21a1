"""What the meta state hands back to the machine."""
from enum import Enum
from typing import FrozenSet, NamedTuple

from .failure import ContainerEnding


class VerdictKind(Enum):
    """Ways out of the meta state."""

    JUMP = 'jump'  # to a state, its userdata as the settings say
    SUPERSEDE = 'supersede'  # the failed state counts as having ended with `outcome`
    GIVE_UP = 'give up'  # end, or go on, as `ending` says
    PREEMPTED = 'preempted'  # a preempt or a shutdown ended the recovery; `ending` as above


class Verdict(NamedTuple):
    """One way out of the meta state."""

    kind: VerdictKind
    state: str = ''  # JUMP
    outcome: str = ''  # SUPERSEDE
    ending: ContainerEnding = ContainerEnding()
    by: str = ''  # the expert's name
    text: str = ''
    written: FrozenSet[str] = frozenset()  # userdata keys that survive a restore

    def leads_to(self) -> str:
        """Return the state or outcome that the meta state leads to, '' where it raises."""
        return self.state or self.outcome or self.ending.state or self.ending.outcome or ''
