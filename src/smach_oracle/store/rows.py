"""The rows of a store, as plain tuples: those to write, and those that were read."""

from typing import Iterable, NamedTuple, Optional, Tuple

from .codecs import Encoded
from .names import ANSWERED, BROKEN


class Fact(NamedTuple):
    """One thing that has a new value: `name` of the container at `path`. None means it is gone."""

    path: str
    name: str
    value: Optional[Encoded]


class NewMoment(NamedTuple):
    """The values that are committed at once.

    `seq`: number of the trial's last event. `kind`: its name. `label`: a state of `path`.
    `after`: number of the moment that it follows, where that is not the latest one of its trial.
    """

    at: float  # s since the epoch
    seq: int
    kind: str
    path: str
    label: str
    facts: Tuple[Fact, ...]
    after: Optional[int] = None


class StoredTrial(NamedTuple):
    """One trial of a machine. `moments` is the number of its moments."""

    number: int  # in the store
    machine: str
    trial_id: str
    structure: str  # id
    begun: float  # s since the epoch
    ended: Optional[float]  # None: it has not ended
    outcome: str
    moments: int


class StoredMoment(NamedTuple):
    """One moment as a list shows it."""

    number: int  # in the store
    at: float  # s since the epoch
    seq: int
    kind: str
    path: str
    label: str
    after: Optional[int] = None  # the one that it follows, where that is not the one before it


def is_in_doubt(moments: Iterable[StoredMoment]) -> bool:
    """Whether states may have run in a trial that are not stored, and nobody has answered since."""
    told = [each.kind for each in moments if each.kind in (BROKEN, ANSWERED)]
    return told[-1:] == [BROKEN]


class StoredValue(NamedTuple):
    """A value as it is stored. Both are None where the fact is gone."""

    text: Optional[str]
    whole: Optional[bytes]

    @property
    def is_there(self) -> bool:
        """Whether there is a value."""
        return self.text is not None or self.whole is not None


class StoredFact(NamedTuple):
    """One fact, with the moment in which it was written."""

    moment: int
    kind: str  # of the moment, as its next two
    moment_path: str
    label: str
    path: str
    name: str
    value: StoredValue


class LogLine(NamedTuple):
    """One change that somebody has made to a store by hand."""

    at: float  # s since the epoch
    who: str
    what: str
