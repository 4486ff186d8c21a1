"""The counts of one trial (definitions: doc/statistics.md)."""

import os
from operator import attrgetter
from typing import Any, Dict, Iterable, Mapping, NamedTuple, Optional, Tuple

from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.settings.failure_rule import FORMER_RULE, FailureRule

from ..bag_events import RecordedCause
from ..trial_counter import TrialCounter, TrialEnding
from ..truth import Truth

_NUMBER = attrgetter('seq')
_MOST_TOLD = 100
_told: Dict[int, '_ToldAtStart'] = {}  # by the identity of the data, which it holds


class TrialSummary(NamedTuple):
    """One trial: one execution of a top machine."""

    trial_id: str
    experiment: str  # path of the top machine
    recovers: Optional[bool]  # with (True) or without the oracle. None means it is not recorded
    start_time: float  # s since the epoch, the machine's own clock
    duration_s: float  # from the first to the last recorded event
    ending: TrialEnding
    outcome: str  # of the top machine, or '' where it ended in an exception or is unfinished
    failures: int
    recoveries: int  # of the oracle, without the expert
    questions: int  # to the expert
    answered: int  # of these
    failures_by_state: Tuple[Tuple[str, int], ...]  # 'PATH/STATE', sorted
    lost_events: int  # gaps in the numbering
    bags: Tuple[str, ...]
    # of the oracle, sorted, or () where they are not recorded
    settings: Tuple[Tuple[str, Any], ...] = ()
    cause: Optional[RecordedCause] = None  # what a simulated world was given to fail with
    truth: Optional[Truth] = None  # how it ended, by the judge of a simulated world
    unwell_s: float = 0.0  # in which it waited until the robot was well
    resumed: int = 0  # how often it went on after its program was stopped
    down_s: float = 0.0  # of `duration_s`: in which its program did not run
    rule: FailureRule = FORMER_RULE  # by which its end is a success or a failure
    node: str = ''  # whose it is, by the topic of its events. '' means not known
    # where it ran: version, host, digests. Sorted, or () where that is not recorded
    origin: Tuple[Tuple[str, str], ...] = ()
    # plain values of the userdata with which it began, sorted, or () where they are not recorded
    inputs: Tuple[Tuple[str, Any], ...] = ()

    @property
    def replicate(self) -> str:
        """Return the folder of its bag: trials that learn from each other share one."""
        return os.path.dirname(self.bags[0]) if self.bags else ''

    @property
    def succeeded(self) -> bool:
        """Whether the machine ended in success, by its outcome."""
        return self.ending is TrialEnding.SUCCESS

    @property
    def truly_succeeded(self) -> Optional[bool]:
        """Whether machine and judge say success, of the object that was meant.

        Where the machine's outcome says neither success nor failure, the judge alone says it. None:
        nobody has judged it, and the machine does not say that it failed.
        """
        if self.ending not in (TrialEnding.SUCCESS, TrialEnding.OTHER):
            return False
        if self.truth is None:
            return None
        return self.truth.success and not self.truth.wrong_object

    @property
    def person_needed(self) -> Optional[bool]:
        """Whether a question was asked, or the trial did not truly succeed. None: not known."""
        if self.questions:
            return True
        return None if self.truly_succeeded is None else not self.truly_succeeded


class _ToldAtStart(NamedTuple):
    """The fields that the data of a TRIAL_START tell."""

    data: Mapping[str, Any]
    settings: Tuple[Tuple[str, Any], ...]
    origin: Tuple[Tuple[str, str], ...]
    inputs: Tuple[Tuple[str, Any], ...]


def summarise(
    events: Iterable[Event],
    bags: Tuple[str, ...] = (),
    rule: Optional[FailureRule] = None,
    cause: Optional[RecordedCause] = None,
    node: str = '',
) -> TrialSummary:
    """Sum up the events of one trial, at least one, in any order. `rule`: as in `load_trials`."""
    counter = TrialCounter(rule)
    for event in sorted(events, key=_NUMBER):
        counter.add(event)
    told = _told_by(counter)
    return TrialSummary(
        counter.trial_id,
        counter.experiment,
        counter.recovers,
        counter.start_time,
        counter.duration_s,
        counter.ending,
        counter.outcome,
        counter.failures,
        counter.recoveries,
        counter.questions,
        counter.answered,
        counter.failures_by_state,
        counter.lost_events,
        bags,
        told.settings,
        cause,
        None,
        counter.unwell_s,
        counter.resumed,
        counter.down_s,
        counter.rule,
        node,
        told.origin,
        told.inputs,
    )


def _told_by(counter: TrialCounter) -> _ToldAtStart:
    """Return what the start of a trial told. Trials with the same data share it.

    The data are told apart by identity: `1`, `1.0` and `True` are equal, and not the same.
    """
    data = counter.start
    told = _told.get(id(data))
    if told is None or told.data is not data:
        told = _ToldAtStart(data, counter.settings, counter.origin, counter.inputs)
        if len(_told) == _MOST_TOLD:
            _told.clear()
        _told[id(data)] = told
    return told
