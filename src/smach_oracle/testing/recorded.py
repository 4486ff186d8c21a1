"""Trials that ran elsewhere, such as under `oracle_run`, from their bags. It needs rosbag."""

import json
from functools import reduce
from pathlib import Path
from typing import Dict, Iterable, List, Optional

import rosbag

from smach_oracle.msg import OracleEvent
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import TrialEnd, ended_by
from smach_oracle.oracle.settings.failing_outcomes import FailingNames
from smach_oracle.oracle.settings.failure_rule import FORMER_RULE, rule_after

from .observed_trial import ObservedTrial, TrialEvidence

_EVENTS = '/oracle/events'


def recorded_trials(
    path: str, failing_outcomes: Optional[Iterable[str]] = None
) -> List[ObservedTrial]:
    """Return the trials of a bag, or of all bags in a folder, by the time of their beginning.

    The bags of a trial are joined by its id. Bags that are still written are left out. An
    exception that ended a trial is a RuntimeError with its text.

    :param failing_outcomes: those that are failures. None means by the rule that each trial names.
    :raises OSError: where there is no such bag or folder.
    :raises rosbag.ROSBagException: where a bag cannot be read.
    """
    place = Path(path)
    bags = sorted(place.glob('*.bag')) if place.is_dir() else [place]
    failing = None if failing_outcomes is None else FailingNames(failing_outcomes)
    by_trial: Dict[str, Dict[int, Event]] = {}  # events by their numbers
    for bag in bags:
        for event in _events_in(bag):
            by_trial.setdefault(event.trial_id, {})[event.seq] = event
    trials = [
        _trial_of([by_number[seq] for seq in sorted(by_number)], failing)
        for by_number in by_trial.values()
    ]
    return sorted(trials, key=lambda trial: trial.events[0].wall_time)


def _events_in(path: Path) -> List[Event]:
    with rosbag.Bag(str(path)) as bag:
        topics = [topic for topic in bag.get_type_and_topic_info()[1] if topic.endswith(_EVENTS)]
        messages = bag.read_messages(topics) if topics else ()
        return [_event_of(message) for _, message, _ in messages]


def _trial_of(events: List[Event], failing: Optional[FailingNames]) -> ObservedTrial:
    end = events[-1] if events[-1].kind is EventKind.TRIAL_END else None
    entered = any(event.kind is EventKind.STATE_START for event in events)
    error: Optional[BaseException] = None
    if end is not None and ended_by(end, entered) in (TrialEnd.ERROR, TrialEnd.STOPPED):
        error = RuntimeError(end.text)
    outcome = end.outcome if end is not None and end.outcome else None
    if failing is None:
        failing = reduce(rule_after, (event.data for event in events), FORMER_RULE).failing
    return ObservedTrial(TrialEvidence(outcome, error, events, failing=failing))


def _event_of(message: OracleEvent) -> Event:
    return Event(
        EventKind(message.kind),
        message.trial_id,
        message.seq,
        message.wall_time,
        message.path,
        message.state,
        message.outcome,
        message.target,
        message.failure_kind,
        message.failure_class,
        message.rate,
        message.continuous,
        message.query_id,
        message.by,
        message.text,
        json.loads(message.data) if message.data else None,
    )
