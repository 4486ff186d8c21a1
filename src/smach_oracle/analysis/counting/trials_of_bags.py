"""The trials that are in some bags."""

from typing import Dict, List, Mapping, NamedTuple, Optional, Tuple

from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.settings.failure_rule import FailureRule

from ..bag_events import BagContent, RecordedCause
from .trial_summary import TrialSummary, summarise


class TrialOfBags(NamedTuple):
    """One trial as some bags tell it."""

    trial_id: str
    bags: Tuple[str, ...]  # that have events of it
    events: List[Event]  # in the order of their numbers
    cause: Optional[RecordedCause]
    node: str

    def summary(self, rule: Optional[FailureRule]) -> TrialSummary:
        """Sum it up."""
        return summarise(self.events, self.bags, rule, self.cause, self.node)


def trials_of(contents: Mapping[str, BagContent]) -> List[TrialOfBags]:
    """Return the trials of some bags, by path. A bag may have many, and a trial may be in many."""
    if len(contents) == 1:
        ((path, content),) = contents.items()
        if len(content.nodes) == 1:  # as most have it
            ((trial_id, node),) = content.nodes.items()
            by_number = {event.seq: event for event in content.events}
            in_order = [by_number[seq] for seq in sorted(by_number)]
            return [TrialOfBags(trial_id, (path,), in_order, content.causes.get(trial_id), node)]
    events: Dict[str, Dict[int, Event]] = {}
    bags: Dict[str, Dict[str, None]] = {}
    causes: Dict[str, RecordedCause] = {}
    nodes: Dict[str, str] = {}
    for path, content in contents.items():
        for event in content.events:
            events.setdefault(event.trial_id, {})[event.seq] = event
            bags.setdefault(event.trial_id, {})[path] = None
        causes.update(content.causes)
        nodes.update(content.nodes)
    return [
        TrialOfBags(
            trial_id,
            tuple(bags[trial_id]),
            [by_number[seq] for seq in sorted(by_number)],
            causes.get(trial_id),
            nodes.get(trial_id, ''),
        )
        for trial_id, by_number in events.items()
    ]
