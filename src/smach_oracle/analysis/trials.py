"""Summaries of trials, made from the events in bags (definitions: doc/statistics.md)."""

import os
from typing import (
    TYPE_CHECKING,
    Any,
    Callable,
    Dict,
    Iterable,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Set,
    Tuple,
    TypeVar,
)

from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.settings.failure_rule import FORMER_RULE, FailureRule

from .bag_events import BagContent, BagError, EventReader, RecordedCause, SkippedBag
from .reading import read_bags
from .trial_counter import TrialCounter, TrialEnding
from .truth import Truth, TruthFiles

if TYPE_CHECKING:
    from .by_state.state_counts import StatesOfTrials

Taken = TypeVar('Taken')


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
    states: Mapping[str, 'StatesOfTrials']  # by trial id


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
    return _load(places, rule, lambda events: None)[0]


def load_by_state(places: Sequence[str], rule: Optional[FailureRule] = None) -> TrialsByState:
    """Read the same, and count what happened in the states of each trial. As `load_trials`."""
    from .by_state.follower import states_of  # only where it is asked for: it takes a while

    return TrialsByState(*_load(places, rule, lambda events: states_of(events, rule)))


def load_with_events(places: Sequence[str], rule: Optional[FailureRule] = None) -> TrialsWithEvents:
    """Read the same, and keep the events. As `load_trials`."""
    return TrialsWithEvents(*_load(places, rule, lambda events: events))


def _load(
    places: Sequence[str], rule: Optional[FailureRule], take: Callable[[List[Event]], Taken]
) -> Tuple[Trials, Dict[str, Taken]]:
    """Read the trials, and what is taken of the events of each, by trial id.

    A trial is summed up as soon as its bag is read, and its events are let go.
    """
    skipped: List[SkippedBag] = []
    summaries: Dict[str, TrialSummary] = {}
    taken: Dict[str, Taken] = {}
    bags = 0
    spread: Dict[str, Tuple[str, ...]] = {}  # trials that are in several bags, and these

    def add(trial: _TrialOfBags) -> None:
        summaries[trial.trial_id] = trial.summary(rule)
        taken[trial.trial_id] = take(trial.events)

    for path, content in read_bags(places, skipped):
        bags += 1
        for trial in _trials_of({path: content}):
            known = summaries.get(trial.trial_id)
            if known is None:
                add(trial)
            else:
                spread[trial.trial_id] = (*spread.get(trial.trial_id, known.bags), path)
    for trial in _read_again(spread):
        add(trial)
    if not summaries:
        reasons = '\n'.join('  {}: {}'.format(item.path, item.reason) for item in skipped)
        raise BagError(
            '{}: nothing was recorded in {} bag(s)\n{}'.format(
                ', '.join(places), bags + len(skipped), reasons
            )
        )
    found = sorted(
        _judged(summaries.values()), key=lambda trial: (trial.start_time, trial.trial_id)
    )
    return Trials(found, skipped), taken


def _judged(trials: Iterable[TrialSummary]) -> Iterator[TrialSummary]:
    """Yield the trials, each with its truth."""
    truths = TruthFiles()
    for trial in trials:
        truth = truths.of(trial.replicate, trial.cause.seed if trial.cause else None)
        yield trial._replace(truth=truth) if truth else trial


class _TrialOfBags(NamedTuple):
    """One trial as some bags tell it."""

    trial_id: str
    bags: Tuple[str, ...]  # that have events of it
    events: List[Event]  # in the order of their numbers
    cause: Optional[RecordedCause]
    node: str

    def summary(self, rule: Optional[FailureRule]) -> TrialSummary:
        trial = summarise(self.events, self.bags, rule)
        return trial._replace(cause=self.cause, node=self.node)


def _trials_of(contents: Mapping[str, BagContent]) -> List[_TrialOfBags]:
    """Return the trials of some bags, by path. A bag may have many, and a trial may be in many."""
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
        _TrialOfBags(
            trial_id,
            tuple(bags[trial_id]),
            [by_number[seq] for seq in sorted(by_number)],
            causes.get(trial_id),
            nodes.get(trial_id, ''),
        )
        for trial_id, by_number in events.items()
    ]


def _read_again(bags_of: Mapping[str, Tuple[str, ...]]) -> Iterator[_TrialOfBags]:
    """Yield some trials, given the bags of each, which are read again. Those of one bag together.

    :raises BagError: where a bag cannot be read any more.
    """
    reader = EventReader()
    by_bags: Dict[Tuple[str, ...], Set[str]] = {}
    for trial_id, bags in bags_of.items():
        by_bags.setdefault(bags, set()).add(trial_id)
    for bags, trial_ids in by_bags.items():
        contents = {}
        for path in bags:
            try:
                contents[path] = reader.read(path)
            except BagError as err:
                raise BagError('{}: {}'.format(path, err)) from err
        for trial in _trials_of(contents):
            if trial.trial_id in trial_ids:
                yield trial


def events_of(trials: Iterable[TrialSummary]) -> Iterator[Tuple[TrialSummary, List[Event]]]:
    """Yield some trials, each with its events in order. Their bags are read again for that.

    The trials come in their order, but those of the same bags together.

    :raises BagError: where a bag cannot be read any more.
    """
    known = {trial.trial_id: trial for trial in trials}
    for trial in _read_again({trial_id: each.bags for trial_id, each in known.items()}):
        yield known[trial.trial_id], trial.events


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
