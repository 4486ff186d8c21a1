"""A question that comes before the next state of some containers. Pure, and without smach."""

from typing import List, Optional, Sequence

from .events import FailureKind
from .state_record import StateRecord, Unfinished

NOT_BEGUN = 'the program was stopped before it began'


class AskedOnce:
    """Makes the oracle ask a person once, before the first state of any of some containers."""

    def __init__(self, why: str, passes: Sequence[StateRecord]) -> None:
        """`passes`: states that are entered before, once each, on the way to where it stood."""
        self._why = why
        self._passes: List[StateRecord] = list(passes)

    def take(self, record: StateRecord) -> Optional[Unfinished]:
        """Return what stands in place of the coming visit of a state, or None for nothing."""
        if not self._why:
            return None
        if record in self._passes:
            self._passes.remove(record)
            return None
        why, self._why = self._why, ''
        return Unfinished(FailureKind.INTERRUPTED, '', NOT_BEGUN, why, keeps=True)
