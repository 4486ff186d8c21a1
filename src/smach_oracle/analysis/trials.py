"""What happened in each trial, told from its events (definitions: doc/statistics.md)."""
import os
from collections import Counter
from enum import Enum
from typing import Any, Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from ..oracle.events import NO_OUTCOME, Event, EventKind
from ..oracle.naming import PREEMPTED, FailingNames
from .bag_events import BagError, Cause, Skipped
from .reading import read_bags
from .truth import Truth, TruthFiles

DEFAULT_FAILING = FailingNames()
STOPPED_BY = ('KeyboardInterrupt:', 'SystemExit:')  # how the texts of exceptions begin that are nobody's failure
AUTONOMOUS_DECISIONS = ('revisit', 'step_back')


class Ending(Enum):
    """How a trial ended."""

    SUCCESS = 'success'
    FAILURE = 'failure'
    PREEMPTED = 'preempted'  # by request, or by a shutdown or Ctrl-C
    UNFINISHED = 'unfinished'  # its record ends before it


class TrialSummary(NamedTuple):
    """One trial: one execution of a top machine."""

    trial_id: str
    experiment: str  # path of the top machine
    recovers: Optional[bool]  # with (True) or without the oracle; None: the record does not tell
    start_time: float  # s since the epoch, the machine's own clock
    duration_s: float  # from the first to the last recorded event
    ending: Ending
    outcome: str  # of the top machine; '' where it ended in an exception or is unfinished
    failures: int
    recoveries: int  # of the oracle, without the expert
    questions: int  # to the expert
    answered: int  # of these
    failures_by_state: Tuple[Tuple[str, int], ...]  # 'PATH/STATE', sorted
    lost_events: int  # gaps in the numbering
    bags: Tuple[str, ...]
    settings: Tuple[Tuple[str, Any], ...] = ()  # of the oracle, sorted; () where the record does not tell
    cause: Optional[Cause] = None  # what a simulated world was given to fail with
    truth: Optional[Truth] = None  # what a simulated world says of the end

    @property
    def replicate(self) -> str:
        """The folder it was recorded in: trials that learn from each other share one."""
        return os.path.dirname(self.bags[0]) if self.bags else ''

    @property
    def succeeded(self) -> bool:
        """Whether the machine says so."""
        return self.ending is Ending.SUCCESS


class Trials(NamedTuple):
    """All that was found in some folders."""

    trials: List[TrialSummary]  # in the order of their beginning
    skipped: List[Skipped]


def load_trials(places: Sequence[str], failing: FailingNames = DEFAULT_FAILING) -> Trials:
    """Read all bags in folders (and below). A bag that cannot be used is named with the reason, not fatal.

    Raises BagError where there is nothing to read: no such folder, no bags, or none with a trial in it.
    """
    gathered = _Gathered()
    skipped: List[Skipped] = []
    count = 0
    for path, content in read_bags(places, skipped):
        count += 1
        gathered.add(path, content.events, content.causes)
    if not gathered.events:
        reasons = '\n'.join('  {}: {}'.format(item.path, item.reason) for item in skipped)
        raise BagError('{}: nothing was recorded in {} bag(s)\n{}'.format(', '.join(places), count + len(skipped),
                                                                         reasons))
    trials = gathered.summaries(failing)
    return Trials(sorted(trials, key=lambda trial: (trial.start_time, trial.trial_id)), skipped)


class _Gathered:
    """What was found of each trial: it may be spread over several bags, and be in more than one."""

    def __init__(self) -> None:
        self.events: Dict[str, Dict[int, Event]] = {}
        self._bags: Dict[str, Dict[str, None]] = {}
        self._causes: Dict[str, Cause] = {}

    def add(self, path: str, events: Iterable[Event], causes: Mapping[str, Cause]) -> None:
        for event in events:
            self.events.setdefault(event.trial_id, {})[event.seq] = event
            self._bags.setdefault(event.trial_id, {})[path] = None
        self._causes.update(causes)

    def summaries(self, failing: FailingNames) -> List[TrialSummary]:
        truths = TruthFiles()
        found = []
        for trial_id, by_number in self.events.items():
            trial = summarise(list(by_number.values()), tuple(self._bags[trial_id]), failing)
            cause = self._causes.get(trial_id)
            truth = truths.of(trial.replicate, cause.seed if cause else None)
            found.append(trial._replace(cause=cause, truth=truth))
        return found


def summarise(events: Iterable[Event], bags: Tuple[str, ...] = (),
              failing: FailingNames = DEFAULT_FAILING) -> TrialSummary:
    """Sum up the events of one trial, at least one, in any order."""
    ordered = sorted(events, key=lambda event: event.seq)
    first, last = ordered[0], ordered[-1]
    start = _first(ordered, EventKind.TRIAL_START)
    end = _first(ordered, EventKind.TRIAL_END)
    asked = {event.query_id for event in ordered if event.kind == EventKind.QUERY_OPENED}
    answered = {event.query_id for event in ordered if event.kind == EventKind.QUERY_ANSWERED}
    failures = Counter('{}/{}'.format(event.path, event.state) for event in ordered if event.kind == EventKind.FAILURE)
    times = [event.wall_time for event in ordered]
    return TrialSummary(
        trial_id=first.trial_id, experiment=(start or first).path.strip('/').split('/')[0],
        recovers=_recovers(start, ordered), start_time=first.wall_time, duration_s=max(times) - min(times),
        ending=_ending(end, ordered, failing), outcome=end.outcome if end else '',
        failures=sum(failures.values()), recoveries=count_recoveries(ordered),
        questions=len(asked), answered=len(asked & answered), failures_by_state=tuple(sorted(failures.items())),
        lost_events=last.seq + 1 - len(ordered), bags=bags, settings=_settings(start))


def _settings(start: Optional[Event]) -> Tuple[Tuple[str, Any], ...]:
    stated = start.data.get('settings') if start and isinstance(start.data, Mapping) else None
    return tuple(sorted(stated.items())) if isinstance(stated, Mapping) else ()


def count_recoveries(ordered: Iterable[Event]) -> int:
    """How often the oracle recovered without the expert: a decision to revisit or to step back, carried out.

    A decision is carried out by the next JUMP of the same container. A question in between takes it over.
    """
    decided: Dict[str, bool] = {}
    recoveries = 0
    for event in ordered:
        if event.kind == EventKind.DECISION:
            decided[event.path] = event.outcome in AUTONOMOUS_DECISIONS
        elif event.kind in (EventKind.QUERY_OPENED, EventKind.FAILURE, EventKind.GIVE_UP):
            decided[event.path] = False
        elif event.kind == EventKind.JUMP:
            recoveries += decided.pop(event.path, False)
    return recoveries


def _first(ordered: Iterable[Event], kind: EventKind) -> Optional[Event]:
    return next((event for event in ordered if event.kind == kind), None)


def _recovers(start: Optional[Event], ordered: Iterable[Event]) -> Optional[bool]:
    """With or without the oracle: what TRIAL_START says, else whether the oracle was seen at work."""
    stated = start.data.get('recovers') if start and isinstance(start.data, Mapping) else None
    if isinstance(stated, bool):
        return stated
    return True if _first(ordered, EventKind.DECISION) else None


def _ending(end: Optional[Event], ordered: Sequence[Event], failing: FailingNames) -> Ending:
    if end is None:
        return Ending.UNFINISHED
    if end.outcome.lower() == PREEMPTED or (not end.outcome and _was_stopped(end, ordered)):
        return Ending.PREEMPTED
    failed = not end.outcome or end.outcome in failing  # no outcome: it ended in an exception
    return Ending.FAILURE if failed else Ending.SUCCESS


def _was_stopped(end: Event, ordered: Sequence[Event]) -> bool:
    """Whether a shutdown or Ctrl-C ended it; an inconsistent machine has no outcome either, but enters no state."""
    began = _first(ordered, EventKind.STATE_START) is not None
    return end.text.startswith(STOPPED_BY) or (end.text == NO_OUTCOME and began)
