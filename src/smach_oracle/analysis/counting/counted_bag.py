"""The trials of one bag, counted."""

from typing import TYPE_CHECKING, Any, Callable, List, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.settings.failure_rule import FailureRule

from ..bag_events import BagError, EventReader
from .trial_summary import TrialSummary
from .trials_of_bags import trials_of

if TYPE_CHECKING:
    from .summary_text import SummaryText


class CountedBag(NamedTuple):
    """The trials of one bag, or why it cannot be used."""

    path: str
    trials: Sequence[Tuple[TrialSummary, Any]] = ()  # each with what was taken of it
    reason: str = ''
    text: Optional['SummaryText'] = None  # of its summaries, where that is known


class Counting(NamedTuple):
    """The way to count.

    `rule`: for all trials. None means that each is counted by the rule of its record.
    `take`: what is taken of the events of each trial, beside its summary. With several processes,
    the function and what it returns go from one to the other by pickle.
    """

    rule: Optional[FailureRule] = None
    take: Optional[Callable[[List[Event]], Any]] = None
    processes: int = 1


# begins to count some bags, and returns what waits for the counts, in the order of the bags
BeginCount = Callable[[Sequence[str]], Callable[[], List[CountedBag]]]


def count_bag(path: str, reader: EventReader, counting: Counting) -> CountedBag:
    """Count the trials of a bag."""
    try:
        content = reader.read(path)
    except BagError as err:
        return CountedBag(path, (), str(err))
    take = counting.take
    return CountedBag(
        path,
        [
            (trial.summary(counting.rule), take and take(trial.events))
            for trial in trials_of({path: content})
        ],
    )
