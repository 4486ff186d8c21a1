"""The events of many trials, read from their bags where they are asked for.

A report goes through its trials in their order. So it needs the events of few of them at a time.
"""

from collections import OrderedDict
from typing import Dict, Iterator, List, Mapping, Sequence, Tuple, Union, overload

from smach_oracle.oracle.records.events import Event

from ..bag_events import BagError, EventReader
from ..counting.trial_summary import TrialSummary
from ..trials import read_again

MOST_HELD = 300  # trials, and all of the bags that were read last


class EventsAgain(Mapping[str, List[Event]]):
    """The events of each trial by its id, in the order of their numbers.

    Those of the trials that were read last are held. What else is asked for is read again.
    """

    def __init__(self, trials: Sequence[TrialSummary]) -> None:
        self._bags = {trial.trial_id: trial.bags for trial in trials}
        self._together: Dict[Tuple[str, ...], List[str]] = {}  # trials of the same bags
        for trial_id, bags in self._bags.items():
            self._together.setdefault(bags, []).append(trial_id)
        self._held: 'OrderedDict[str, List[Event]]' = OrderedDict()
        self._reader = EventReader()

    def __getitem__(self, trial_id: str) -> List[Event]:
        """:raises BagError: where a bag cannot be read any more, or has not the trial any more."""
        if trial_id not in self._held:
            self._read(self._bags[trial_id])
        try:
            return self._held[trial_id]
        except KeyError:
            bags = ', '.join(self._bags[trial_id])
            raise BagError('{}: it has no trial {} any more'.format(bags, trial_id)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._bags)

    def __len__(self) -> int:
        return len(self._bags)

    def _read(self, bags: Tuple[str, ...]) -> None:
        wanted = self._together[bags]
        for trial in read_again(dict.fromkeys(wanted, bags), self._reader):
            self._held[trial.trial_id] = trial.events
            self._held.move_to_end(trial.trial_id)
        while len(self._held) > max(MOST_HELD, len(wanted)):
            self._held.popitem(last=False)


class EventsInTurn(Sequence[Sequence[Event]]):
    """The events of some trials, one after the other."""

    def __init__(self, events: Mapping[str, Sequence[Event]], trial_ids: Sequence[str]) -> None:
        """`events`: by trial id."""
        self._events = events
        self._trial_ids = trial_ids

    @overload
    def __getitem__(self, at: int) -> Sequence[Event]: ...

    @overload
    def __getitem__(self, at: slice) -> 'EventsInTurn': ...

    def __getitem__(self, at: Union[int, slice]) -> Union[Sequence[Event], 'EventsInTurn']:
        if isinstance(at, slice):
            return EventsInTurn(self._events, self._trial_ids[at])
        return self._events[self._trial_ids[at]]

    def __len__(self) -> int:
        return len(self._trial_ids)
