"""Trials by experiment and arm, and what is counted of each group (definitions: doc/statistics.md)."""
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from .intervals import Interval, replicate_interval, wilson_interval
from .trials import Ending, TrialSummary

ARMS = ((True, 'with oracle'), (False, 'without oracle'), (None, 'arm unknown'))
RECOVERIES = 'oracle recoveries'
QUESTIONS = 'questions to the expert'
ANSWERED = 'answered'
NOT_ANSWERED = 'not answered'
ENDED_IN_FAILURE = 'ended in failure'
TRUE_SUCCESS = 'true success'
_BY_EVENTS: Tuple[Tuple[str, Callable[[TrialSummary], int]], ...] = (
    ('failures of states', lambda trial: trial.failures),
    (RECOVERIES, lambda trial: trial.recoveries),
    (QUESTIONS, lambda trial: trial.questions),
    (ANSWERED, lambda trial: trial.answered),
    (NOT_ANSWERED, lambda trial: trial.questions - trial.answered),
)
_ENDINGS = {Ending.SUCCESS: 'ended in success', Ending.FAILURE: ENDED_IN_FAILURE, Ending.PREEMPTED: 'preempted',
            Ending.UNFINISHED: 'unfinished'}
_BY_TRUTH: Tuple[Tuple[str, Callable[[bool, bool], bool]], ...] = (
    (TRUE_SUCCESS, lambda said, true: true),
    ('false success', lambda said, true: said and not true),
    ('false failure', lambda said, true: true and not said),
)


class Count(NamedTuple):
    """How many trials of a group something happened in, and how often."""

    name: str
    trials: int
    share: float  # of the trials in which it is known, 0 to 1
    interval: Interval  # 95% Wilson score interval of the share, over trials
    events: Optional[int]  # None where it happens at most once a trial
    over_replicates: Optional[Interval] = None  # 95% t interval of the mean share; None for fewer than two replicates


class Group(NamedTuple):
    """The trials of one experiment in one arm."""

    experiment: str
    arm: str
    runs: int
    counts: Tuple[Count, ...]
    trials_with_gaps: int
    lost_events: int
    replicates: int = 1
    truth_known: int = 0  # trials of which a world has told how they truly ended

    def of(self, name: str) -> Count:
        """The count of that name."""
        return next(item for item in self.counts if item.name == name)


class Arm(NamedTuple):
    """The trials that a group is made of."""

    experiment: str
    name: str
    recovers: Optional[bool]
    settings: Dict[str, Any]
    trials: Tuple[TrialSummary, ...]

    def replicates(self) -> List[Tuple[TrialSummary, ...]]:
        """Its trials by the folder they were recorded in."""
        return split_by(self.trials, lambda trial: trial.replicate)


def split_by(trials: Sequence[TrialSummary], key: Callable[[TrialSummary], Any]) -> List[Tuple[TrialSummary, ...]]:
    """The trials in parts, in the order of a key that can be sorted."""
    parts: Dict[Any, List[TrialSummary]] = {}
    for trial in trials:
        parts.setdefault(key(trial), []).append(trial)
    return [tuple(parts[value]) for value in sorted(parts)]


def find_arms(trials: Sequence[TrialSummary]) -> List[Arm]:
    """Trials by experiment (in alphabetical order), with or without oracle, and the oracle's settings."""
    arms = []
    for experiment in split_by(trials, lambda trial: trial.experiment):
        for recovers, name in ARMS:
            chosen = [trial for trial in experiment if trial.recovers is recovers]
            variants = split_by(chosen, _settings_key) if recovers else [tuple(chosen)]
            differing = _differing([dict(variant[0].settings) for variant in variants if variant])
            for variant in filter(None, variants):
                settings = dict(variant[0].settings)
                told = ['{} {}'.format(key, settings.get(key, 'unknown')) for key in differing]
                arms.append(Arm(variant[0].experiment, ', '.join([name] + told), recovers, settings, variant))
    return arms


def time_series(trials: Sequence[TrialSummary]) -> List[Tuple[Tuple[str, ...], Tuple[TrialSummary, ...]]]:
    """Trials for a figure each: one replicate of one oracle, with the trials without oracle of its place in order.

    Returns with each what tells it from the others: experiment, oracle, replicate, as far as there are several.
    """
    series = []
    arms = find_arms(trials)
    for experiment in sorted({arm.experiment for arm in arms}):
        mine = [arm for arm in arms if arm.experiment == experiment]
        beside = [part for arm in mine if arm.recovers is False for part in arm.replicates()]
        with_oracle = [(arm.name, arm.replicates()) for arm in mine if arm.recovers is not False]
        for name, parts in with_oracle or [('', [()] * len(beside))]:
            for number, part in enumerate(parts):
                told = ((experiment,) if len({arm.experiment for arm in arms}) > 1 else ()) + (
                    (name,) if len(with_oracle) > 1 else ()) + (
                    ('replicate', str(number)) if len(parts) > 1 else ())
                without = beside[number] if number < len(beside) else ()
                series.append((told, tuple(part) + tuple(without)))
    return series


def _settings_key(trial: TrialSummary) -> Tuple[Tuple[str, float, str], ...]:
    """Numbers in the order of their size, everything else in that of the alphabet."""
    return tuple((key, value, '') if isinstance(value, (int, float)) else (key, 0.0, str(value))
                 for key, value in trial.settings)


def _differing(settings: Sequence[Dict[str, Any]]) -> List[str]:
    keys = sorted({key for each in settings for key in each})
    return [key for key in keys if len({repr(each.get(key)) for each in settings}) > 1]


def make_groups(trials: Sequence[TrialSummary]) -> List[Group]:
    """Count, by experiment and arm."""
    return [make_group(arm) for arm in find_arms(trials)]


def make_group(arm: Arm) -> Group:
    """Count what happened in the trials of an arm."""
    parts, known = arm.replicates(), [trial for trial in arm.trials if trial.truth is not None]
    counts = [_by_events(name, number, arm.trials, parts) for name, number in _BY_EVENTS]
    counts += [make_count(name, _ended(ending), arm.trials, parts) for ending, name in _ENDINGS.items()]
    if known:
        known_parts = split_by(known, lambda trial: trial.replicate)
        counts += [make_count(name, _found(holds), known, known_parts) for name, holds in _BY_TRUTH]
    return Group(arm.experiment, arm.name, len(arm.trials), tuple(counts),
                 sum(1 for trial in arm.trials if trial.lost_events), sum(trial.lost_events for trial in arm.trials),
                 len(parts), len(known))


def _by_events(name: str, number: Callable[[TrialSummary], int], trials: Sequence[TrialSummary],
               parts: Sequence[Sequence[TrialSummary]]) -> Count:
    count = make_count(name, lambda trial: number(trial) > 0, trials, parts)
    return count._replace(events=sum(map(number, trials)))


def _ended(ending: Ending) -> Callable[[TrialSummary], bool]:
    return lambda trial: trial.ending is ending


def _found(holds: Callable[[bool, bool], bool]) -> Callable[[TrialSummary], bool]:
    return lambda trial: trial.truth is not None and holds(trial.succeeded, trial.truth.success)


def make_count(name: str, happened: Callable[[TrialSummary], bool], trials: Sequence[TrialSummary],
               parts: Sequence[Sequence[TrialSummary]]) -> Count:
    """In how many of at least one trial something happened; `parts`: the same trials by replicate."""
    number = sum(map(happened, trials))
    shares = [sum(map(happened, part)) / len(part) for part in parts]
    return Count(name, number, number / len(trials), wilson_interval(number, len(trials)), None,
                 replicate_interval(shares))
