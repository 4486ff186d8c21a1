"""The trials of a node as it tells them, for a console that has not heard all of them. Pure."""

import math
from typing import List, NamedTuple, Optional

from smach_oracle.msg import NodeTrials, TrialCounts
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.oracle.settings.failure_rule import RULE, FailureRule, rule_in
from smach_oracle.trial_counter import TrialEnding

from .views import LATEST_S, parsed

MOST_TRIALS = 100  # of a node
_LONGEST_NAME = 300
_ENDINGS = {ending.value: ending for ending in TrialEnding}


class ToldTrial(NamedTuple):
    """A trial as its node counts it. The fields are those of TrialCounter."""

    trial_id: str
    experiment: str
    nth: int  # of its machine, in its process
    start_time: float
    duration_s: float
    last_seq: int
    lost_events: int
    recovers: bool
    failures: int
    recoveries: int
    questions: int
    answered: int
    unwell_s: float
    running: bool
    ending: TrialEnding
    rule: Optional[FailureRule]
    outcome: str


def told_trials(message: NodeTrials) -> List[ToldTrial]:
    """Return the trials of a message that have an id."""
    return [_told(each) for each in message.trials[:MOST_TRIALS] if each.trial_id]


def _told(counts: TrialCounts) -> ToldTrial:
    over = TrialEnding.UNFINISHED if counts.running else _ENDINGS.get(counts.ending)
    return ToldTrial(
        counts.trial_id,
        shortened(counts.machine, _LONGEST_NAME),
        counts.nth,
        _time_s(counts.start),
        _time_s(counts.duration_s),
        counts.seq,
        counts.lost,
        counts.recovers,
        counts.failures,
        counts.recoveries,
        counts.questions,
        counts.answered,
        _time_s(counts.unwell_s),
        counts.running,
        over or TrialEnding.UNFINISHED,
        rule_in({RULE: parsed(counts.failure_rule)}),
        shortened(counts.outcome, _LONGEST_NAME),
    )


def _time_s(value: float) -> float:
    """A time or span that makes sense, else 0."""
    return float(value) if math.isfinite(value) and 0 <= value <= LATEST_S else 0.0
