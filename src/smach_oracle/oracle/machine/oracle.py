"""What a container says of itself to whoever publishes, records or prints it."""
from typing import Any, Iterator, List, NamedTuple, Optional

from .config import Settings
from .events import EventSource
from .question import Expert


class StateRateRow(NamedTuple):
    """What was learned of one state; the fields are those of StateRate.msg."""

    path: str
    state: str
    rate: float
    failure_class: int
    successes: int
    failures: int
    recoveries: int
    has_preconditions: bool


class TransitionRow(NamedTuple):
    """How often one edge was taken; the fields are those of TransitionCount.msg."""

    path: str
    state: str
    outcome: str
    to: str
    count: int  # type: ignore[assignment]  # as the message says, not what a tuple does


def ledgers_of(machine: Any) -> Iterator[Any]:
    """Yield the ledger of a container and those of all wrapped containers below it, each once."""
    from .wrapping import containers_in
    for container in containers_in(machine):
        yield container._oracle


def rate_rows(machine: Any) -> List[StateRateRow]:
    """Return one row for each state."""
    rows = []
    for ledger in ledgers_of(machine):
        path = ledger.path
        for label in ledger.labels():
            record = ledger.record(label)
            successes, failures = record.totals
            rows.append(StateRateRow(path, label, record.rate, int(record.failure_class), successes, failures,
                                     record.recoveries, record.has_preconditions))
    return rows


def transition_rows(machine: Any) -> List[TransitionRow]:
    """Return one row for each edge that was taken, ORACLE's among them."""
    rows = []
    for ledger in ledgers_of(machine):
        path = ledger.path
        for label, record in list(ledger.records.items()):
            rows += [TransitionRow(path, label, outcome, target, count)
                     for (outcome, target), count in record.transitions().items()]
        rows += [TransitionRow(path, ledger.settings.oracle_label, target, target, count)
                 for target, count in list(ledger.oracle_edges.items())]
    return rows


class Face:
    """What adapters read of a container.

    The container has the same attributes itself, but a user's class may have taken their names for its own ends.
    """

    def __init__(self, ledger: Any) -> None:
        self._ledger = ledger

    @property
    def name(self) -> str:
        """Name of the machine where it is the top one, else its label."""
        name: str = self._ledger.below[-1] if self._ledger.below else self._ledger.name
        return name

    @property
    def path(self) -> str:
        """Container path, such as TOP/PICK."""
        path: str = self._ledger.path
        return path

    @property
    def settings(self) -> Settings:
        """Settings in force."""
        settings: Settings = self._ledger.settings
        return settings

    @property
    def events(self) -> EventSource:
        """The events of the whole tree; append to `events.observers` to be told."""
        events: EventSource = self._ledger.events
        return events

    @property
    def expert(self) -> Optional[Expert]:
        """Who is asked, by any container of the tree."""
        expert: Optional[Expert] = self._ledger.tree.expert
        return expert

    @expert.setter
    def expert(self, expert: Optional[Expert]) -> None:
        self._ledger.tree.expert = expert

    @property
    def trial_id(self) -> str:
        """Id of the present or latest trial, '' before the first."""
        trial_id: str = self._ledger.tree.trial_id
        return trial_id

    @property
    def is_top(self) -> bool:
        """Whether no wrapped container is above this one."""
        return self._ledger.parent is None

    @property
    def recovers(self) -> bool:
        """Whether failures are recovered from, not only observed."""
        return bool(self._ledger.tree.recover)

    def rates(self) -> List[StateRateRow]:
        """Return what was learned of every state, of this container and all below it."""
        return rate_rows(self._ledger.machine)

    def transition_counts(self) -> List[TransitionRow]:
        """Return how often each edge was taken, of this container and all below it."""
        return transition_rows(self._ledger.machine)
