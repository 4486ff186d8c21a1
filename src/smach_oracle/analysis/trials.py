"""Summaries of trials, made from the events in bags (definitions: doc/statistics.md)."""

import os
from typing import (
    Any,
    Dict,
    Iterable,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
)

from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.settings.failure_rule import FORMER_RULE, FailureRule

from .bag_events import BagContent, BagError, EventReader, RecordedCause, SkippedBag
from .by_state.follower import states_of
from .by_state.state_counts import StatesOfTrials
from .reading import read_bags
from .trial_counter import TrialCounter, TrialEnding
from .truth import Truth, TruthFiles


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


class Trials(NamedTuple):
    """All that was found in some folders."""

    trials: List[TrialSummary]  # in the order of their beginning
    skipped: List[SkippedBag]


class TrialsByState(NamedTuple):
    """All that was found in some folders, and what happened in the states of each trial."""

    found: Trials
    states: Mapping[str, StatesOfTrials]  # by trial id


class TrialsWithEvents(NamedTuple):
    """All that was found in some folders, and the events of each trial."""

    found: Trials
    events: Mapping[str, List[Event]]  # by trial id, in the order of their numbers


def load_trials(places: Sequence[str], rule: Optional[FailureRule] = None) -> Trials:
    """Read all bags in folders and below. Those that cannot be used are listed with the reason.

    :param rule: for all trials. None means that each is counted by the rule of its record.

    :raises BagError: where there is nothing to read: no such folder, no bags, or none with a trial
        in it.
    """
    skipped: List[SkippedBag] = []
    return _trials_in(_gathered(places, skipped), rule, skipped)


def load_by_state(places: Sequence[str], rule: Optional[FailureRule] = None) -> TrialsByState:
    """Read the same, and count what happened in the states of each trial. As `load_trials`."""
    skipped: List[SkippedBag] = []
    gathered = _gathered(places, skipped)
    return TrialsByState(_trials_in(gathered, rule, skipped), gathered.states(rule))


def load_with_events(places: Sequence[str], rule: Optional[FailureRule] = None) -> TrialsWithEvents:
    """Read the same, and keep the events. As `load_trials`."""
    skipped: List[SkippedBag] = []
    gathered = _gathered(places, skipped)
    return TrialsWithEvents(_trials_in(gathered, rule, skipped), gathered.in_order())


def _gathered(places: Sequence[str], skipped: List[SkippedBag]) -> '_TrialEvents':
    gathered = _TrialEvents()
    count = 0
    for path, content in read_bags(places, skipped):
        count += 1
        gathered.add(path, content)
    if not gathered.events:
        reasons = '\n'.join('  {}: {}'.format(item.path, item.reason) for item in skipped)
        raise BagError(
            '{}: nothing was recorded in {} bag(s)\n{}'.format(
                ', '.join(places), count + len(skipped), reasons
            )
        )
    return gathered


def _trials_in(
    gathered: '_TrialEvents', rule: Optional[FailureRule], skipped: List[SkippedBag]
) -> Trials:
    trials = gathered.summaries(rule)
    return Trials(sorted(trials, key=lambda trial: (trial.start_time, trial.trial_id)), skipped)


class _TrialEvents:
    """The findings about each trial: they may be spread over several bags, or be in several."""

    def __init__(self) -> None:
        self.events: Dict[str, Dict[int, Event]] = {}
        self._bags: Dict[str, Dict[str, None]] = {}
        self._causes: Dict[str, RecordedCause] = {}
        self._nodes: Dict[str, str] = {}

    def add(self, path: str, content: BagContent) -> None:
        for event in content.events:
            self.events.setdefault(event.trial_id, {})[event.seq] = event
            self._bags.setdefault(event.trial_id, {})[path] = None
        self._causes.update(content.causes)
        self._nodes.update(content.nodes)

    def summaries(self, rule: Optional[FailureRule]) -> List[TrialSummary]:
        truths = TruthFiles()
        found = []
        for trial_id, by_number in self.events.items():
            trial = summarise(list(by_number.values()), tuple(self._bags[trial_id]), rule)
            cause = self._causes.get(trial_id)
            truth = truths.of(trial.replicate, cause.seed if cause else None)
            found.append(
                trial._replace(cause=cause, truth=truth, node=self._nodes.get(trial_id, ''))
            )
        return found

    def states(self, rule: Optional[FailureRule]) -> Dict[str, StatesOfTrials]:
        return {
            trial_id: states_of([by_number[seq] for seq in sorted(by_number)], rule)
            for trial_id, by_number in self.events.items()
        }

    def in_order(self) -> Dict[str, List[Event]]:
        return {
            trial_id: [by_number[seq] for seq in sorted(by_number)]
            for trial_id, by_number in self.events.items()
        }


def summarise(
    events: Iterable[Event], bags: Tuple[str, ...] = (), rule: Optional[FailureRule] = None
) -> TrialSummary:
    """Sum up the events of one trial, at least one, in any order. `rule`: as in `load_trials`."""
    counter = TrialCounter(rule)
    for event in sorted(events, key=lambda event: event.seq):
        counter.add(event)
    return TrialSummary(
        trial_id=counter.trial_id,
        experiment=counter.experiment,
        recovers=counter.recovers,
        start_time=counter.start_time,
        duration_s=counter.duration_s,
        ending=counter.ending,
        outcome=counter.outcome,
        failures=counter.failures,
        recoveries=counter.recoveries,
        questions=counter.questions,
        answered=counter.answered,
        failures_by_state=counter.failures_by_state,
        lost_events=counter.lost_events,
        bags=bags,
        settings=counter.settings,
        unwell_s=counter.unwell_s,
        resumed=counter.resumed,
        down_s=counter.down_s,
        rule=counter.rule,
        origin=counter.origin,
        inputs=counter.inputs,
    )


def events_of(trials: Iterable[TrialSummary]) -> Iterator[Tuple[TrialSummary, List[Event]]]:
    """Yield some trials, each with its events in order. Their bags are read again for that.

    The trials come in their order, but those of the same bags together.

    :raises BagError: where a bag cannot be read any more.
    """
    reader = EventReader()
    by_bags: Dict[Tuple[str, ...], List[TrialSummary]] = {}
    for trial in trials:
        by_bags.setdefault(trial.bags, []).append(trial)
    for bags, of_these in by_bags.items():
        by_number: Dict[str, Dict[int, Event]] = {trial.trial_id: {} for trial in of_these}
        for path in bags:
            try:
                content = reader.read(path)
            except BagError as err:
                raise BagError('{}: {}'.format(path, err)) from err
            for event in content.events:
                if event.trial_id in by_number:
                    by_number[event.trial_id][event.seq] = event
        for trial in of_these:
            events = by_number[trial.trial_id]
            yield trial, [events[seq] for seq in sorted(events)]


def load_replicates(
    places: Sequence[str], skipped: List[SkippedBag]
) -> Dict[str, List[List[Event]]]:
    """Return the trials with an oracle, by the folder they were recorded in, in order.

    Bags that cannot be used go to `skipped`.

    :raises BagError: where there are none, or no folder.
    """
    found: Dict[str, List[List[Event]]] = {}
    for path, content in read_bags(places, skipped):
        trials: Dict[str, List[Event]] = {}
        for event in content.events:
            trials.setdefault(event.trial_id, []).append(event)
        for events in trials.values():
            summary = summarise(events, (path,))
            if summary.recovers and not summary.lost_events:
                found.setdefault(summary.replicate, []).append(
                    sorted(events, key=lambda event: event.seq)
                )
    return {
        folder: sorted(trials, key=lambda events: events[0].wall_time)
        for folder, trials in found.items()
    }
