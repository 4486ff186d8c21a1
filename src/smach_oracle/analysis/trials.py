"""Summaries of trials, made from the events in bags (definitions: doc/statistics.md)."""

from functools import partial
from typing import (
    TYPE_CHECKING,
    Any,
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
)

from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.settings.failure_rule import FailureRule

from .bag_events import BagError, EventReader, SkippedBag
from .counting.bag_counts import count_bags
from .counting.counted_bag import Counting
from .counting.trial_summary import TrialSummary
from .counting.trials_of_bags import TrialOfBags, trials_of
from .reading import bags_in, read_bags, reasons_of
from .truth import TruthFiles

if TYPE_CHECKING:
    from smach_oracle.cluster import WorkerCluster

    from .by_state.state_counts import StatesOfTrials


class Trials(NamedTuple):
    """All that was found in some folders."""

    trials: List[TrialSummary]  # in the order of their beginning
    skipped: List[SkippedBag]


class TrialsByState(NamedTuple):
    """All that was found in some folders, and what happened in the states of each trial."""

    found: Trials
    states: Mapping[str, 'StatesOfTrials']  # by trial id


def load_trials(
    places: Sequence[str],
    rule: Optional[FailureRule] = None,
    processes: int = 1,
    cluster: Optional['WorkerCluster'] = None,
) -> Trials:
    """Read all bags in folders and below. Those that cannot be used are listed with the reason.

    What was counted before is taken from the user's cache folder: `counting.kept_counts`.

    :param rule: for all trials. None means that each is counted by the rule of its record.
    :param processes: that count many bags. More than one is for a process without other threads.
    :param cluster: that counts in place of them.

    :raises ClusterError: where the cluster sees other folders.
    :raises BagError: where there is nothing to read: no such folder, no bags, or none with a trial
        in it.
    """
    return _load(places, Counting(rule, None, processes), cluster)[0]


def load_by_state(
    places: Sequence[str],
    rule: Optional[FailureRule] = None,
    processes: int = 1,
    cluster: Optional['WorkerCluster'] = None,
) -> TrialsByState:
    """Read the same, and count what happened in the states of each trial. As `load_trials`."""
    from .by_state.follower import states_of  # only where it is asked for: it takes a while

    counting = Counting(rule, partial(states_of, rule=rule), processes)
    return TrialsByState(*_load(places, counting, cluster))


def _load(
    places: Sequence[str], counting: Counting, cluster: Optional['WorkerCluster'] = None
) -> Tuple[Trials, Dict[str, Any]]:
    """Read the trials, and what is taken of the events of each, by trial id.

    A trial is summed up as soon as its bag is read, and its events are let go.
    """
    skipped: List[SkippedBag] = []
    summaries: Dict[str, TrialSummary] = {}
    taken: Dict[str, Any] = {}
    bags = 0
    spread: Dict[str, Tuple[str, ...]] = {}  # trials that are in several bags, and these
    for bag in count_bags(bags_in(places, skipped), counting, cluster):
        bags += 1
        if bag.reason:
            skipped.append(SkippedBag(bag.path, bag.reason))
        for summary, part in bag.trials:
            known = summaries.get(summary.trial_id)
            if known is None:
                summaries[summary.trial_id], taken[summary.trial_id] = summary, part
            else:
                spread[known.trial_id] = (*spread.get(known.trial_id, known.bags), bag.path)
    for trial in read_again(spread):
        summaries[trial.trial_id] = trial.summary(counting.rule)
        taken[trial.trial_id] = counting.take and counting.take(trial.events)
    if not summaries:
        raise BagError(
            '{}: nothing was recorded in {} bag(s){}'.format(
                ', '.join(places), bags, reasons_of(skipped)
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
        truth = trial.cause and truths.of(trial.replicate, trial.cause.seed)
        yield trial._replace(truth=truth) if truth else trial


def read_again(
    bags_of: Mapping[str, Tuple[str, ...]], reader: Optional[EventReader] = None
) -> Iterator[TrialOfBags]:
    """Yield some trials, given the bags of each, which are read again. Those of one bag together.

    :param reader: one that has read others of these bags is quicker.
    :raises BagError: where a bag cannot be read any more.
    """
    reader = reader or EventReader()
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
        for trial in trials_of(contents):
            if trial.trial_id in trial_ids:
                yield trial


def events_of(trials: Iterable[TrialSummary]) -> Iterator[Tuple[TrialSummary, List[Event]]]:
    """Yield some trials, each with its events in order. Their bags are read again for that.

    The trials come in their order, but those of the same bags together.

    :raises BagError: where a bag cannot be read any more.
    """
    known = {trial.trial_id: trial for trial in trials}
    for trial in read_again({trial_id: each.bags for trial_id, each in known.items()}):
        yield known[trial.trial_id], trial.events


def load_replicates(
    places: Sequence[str], skipped: List[SkippedBag]
) -> Dict[str, List[TrialOfBags]]:
    """Return the trials with an oracle, by the folder they were recorded in, in order.

    Bags that cannot be used go to `skipped`, and so do trials that lack events.

    :raises BagError: where there are none, or no folder.
    """
    found: Dict[str, List[TrialOfBags]] = {}
    for trial in trials_of(dict(read_bags(places, skipped))):
        summary = trial.summary(None)
        lost = summary.lost_events
        if lost and summary.recovers is not False:
            skipped.append(
                SkippedBag(
                    summary.bags[0],
                    'trial {}: {} of its events {} lost, or in a bag that is not here'.format(
                        summary.trial_id, lost, 'is' if lost == 1 else 'are'
                    ),
                )
            )
        elif summary.recovers:
            found.setdefault(summary.replicate, []).append(trial)
    return {
        folder: sorted(trials, key=lambda trial: trial.events[0].wall_time)
        for folder, trials in found.items()
    }
