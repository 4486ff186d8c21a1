"""One container at one moment, as a store has it."""

from typing import Any, Dict, List, Mapping, Optional, Set

from smach_oracle.store.names import BEFORE, ENDED, IN, MOVED

from ..records.visits import Visit


class StoredContainer:
    """One container as it was.

    `at`: label (or, where it has ended, its outcome), phase, and what belongs to that, or empty
    where it has not begun in the present visit of the state that holds it. `keys`: userdata.
    `missing`: why a key that was there is not. `gone`: keys that were deleted. `visits`: of its
    latest execution, oldest first. `snapshots`: userdata with which its states began, by label.
    `asked`: label and id of the open question. `item`: of an Iterator, the number of the one under
    way.
    """

    def __init__(self) -> None:
        self.at: List[Any] = []
        self.execution = 0
        self.history: List[Any] = []
        self.visits: List[Visit] = []
        self.visits_of_execution = 0
        self.states: Dict[str, Mapping[str, Any]] = {}
        self.marks: Dict[str, List[Any]] = {}
        self.begun: Set[str] = set()  # states at which it has stood, and which had begun
        # sent elsewhere by oracle_state: the states that may be repeated. None: it was not
        self.sent: Optional[List[str]] = None
        self.keys: Dict[str, Any] = {}
        self.missing: Dict[str, str] = {}
        self.snapshots: Dict[str, Dict[str, Any]] = {}
        self.asked: List[str] = []
        self.item = 0
        self.gone: List[str] = []

    def complete_snapshots(self, data: Mapping[str, Any]) -> None:
        """Have in the snapshots what could not be stored, as the userdata have it now."""
        for key in self.missing:
            if key in data:
                for snapshot in self.snapshots.values():
                    snapshot.setdefault(key, data[key])

    def labels(self) -> Set[str]:
        """Return the states of which anything is told."""
        here = {self.label} if self.at and self.phase not in (ENDED, MOVED) else set()
        return {*self.states, *self.marks, *self.begun, *here}

    def visits_of(self, label: str) -> int:
        """Return how many visits of a state have ended in the trial."""
        return int(self.states.get(label, {}).get('counts', [0])[0])

    @property
    def phase(self) -> str:
        """Return the phase, '' where it has not begun."""
        return str(self.at[1]) if self.at else ''

    @property
    def moved_to(self) -> str:
        """Path of the state at which it stood, where that is in another container now, else ''."""
        return str(self.at[2]) if self.phase == MOVED else ''

    @property
    def jumped_to(self) -> str:
        """Path of the place below to which a jump was under way, '' for none.

        Once a container below has begun, it knows better.
        """
        has_it = self.phase in (BEFORE, IN) and len(self.at) > 2
        return str(self.at[2] or '') if has_it else ''

    @property
    def label(self) -> str:
        """Return the state where it stands, '' where it has not begun."""
        return str(self.at[0]) if self.at else ''
