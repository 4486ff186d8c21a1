"""Trials by experiment and variant, and the counts of each (definitions: doc/statistics.md).

A variant is one of the ways in which an experiment runs the same trials, such as with and without
the oracle.
"""

from operator import attrgetter
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from .counting.trial_summary import TrialSummary
from .intervals import Interval, replicate_interval, wilson_interval
from .trial_counter import PERSON_NEEDED, TrialEnding

KINDS = ((True, 'with oracle'), (False, 'without oracle'), (None, 'variant unknown'))
RECOVERIES = 'oracle recoveries'
QUESTIONS = 'questions to the expert'
ANSWERED = 'answered'
NOT_ANSWERED = 'not answered'
ENDED_IN_FAILURE = 'ended in failure'
OTHER_END = 'other end'
TRUE_SUCCESS = 'true success'
_BY_EVENTS: Tuple[Tuple[str, Callable[[TrialSummary], int]], ...] = (
    ('failures of states', attrgetter('failures')),
    (RECOVERIES, attrgetter('recoveries')),
    (QUESTIONS, attrgetter('questions')),
    (ANSWERED, attrgetter('answered')),
    (NOT_ANSWERED, lambda trial: trial.questions - trial.answered),
)
_ENDINGS = {
    TrialEnding.SUCCESS: 'ended in success',
    TrialEnding.FAILURE: ENDED_IN_FAILURE,
    TrialEnding.OTHER: OTHER_END,
    TrialEnding.PREEMPTED: 'preempted',
    TrialEnding.UNFINISHED: 'unfinished',
}
_BY_TRUTH: Tuple[Tuple[str, Callable[[TrialEnding, bool], bool]], ...] = (
    (TRUE_SUCCESS, lambda ending, true: true),
    ('false success', lambda ending, true: ending is TrialEnding.SUCCESS and not true),
    (
        'false failure',
        lambda ending, true: true and ending not in (TrialEnding.SUCCESS, TrialEnding.OTHER),
    ),
)

# a trial's settings in an order: key, value if it is a number, else its text
SettingsKey = Tuple[Tuple[str, float, str], ...]


class Count(NamedTuple):
    """The number of trials of a variant in which something happened, and how often."""

    name: str
    trials: int
    share: float  # of the trials in which it is known, 0 to 1
    interval: Interval  # 95% Wilson score interval of the share, over trials
    events: Optional[int]  # None where it happens at most once a trial
    # 95% t interval of the mean share, or None for fewer than two replicates
    over_replicates: Optional[Interval] = None


class VariantCounts(NamedTuple):
    """The counts of what happened in the trials of one variant of an experiment."""

    experiment: str
    name: str
    trials: int
    counts: Tuple[Count, ...]
    trials_with_gaps: int
    lost_events: int
    replicates: int = 1
    truth_known: int = 0  # trials whose true end a world has recorded
    resumed: int = 0  # trials that went on after their program was stopped
    down_s: float = 0.0  # in which it did not run, all together
    unjudged: int = 0  # trials of which nobody knows whether a person was needed

    def of(self, name: str) -> Count:
        """Return the count of that name."""
        return next(item for item in self.counts if item.name == name)

    def has(self, name: str) -> bool:
        """Whether there is a count of that name: of other ends only where there are some."""
        return any(item.name == name for item in self.counts)


class VariantTrials(NamedTuple):
    """The trials of one variant of an experiment."""

    experiment: str
    name: str
    recovers: Optional[bool]
    settings: Dict[str, Any]
    trials: Tuple[TrialSummary, ...]

    def replicates(self) -> List[Tuple[TrialSummary, ...]]:
        """Return its trials by the folder they were recorded in."""
        return _by_replicate(self.trials)


def _by_replicate(trials: Sequence[TrialSummary]) -> List[Tuple[TrialSummary, ...]]:
    parts: Dict[str, List[TrialSummary]] = {}
    for trial in trials:
        parts.setdefault(trial.replicate, []).append(trial)
    return [tuple(parts[folder]) for folder in sorted(parts)]


def find_variants(trials: Sequence[TrialSummary]) -> List[VariantTrials]:
    """Group trials by experiment (alphabetical), with or without oracle, and its settings."""
    variants = []
    for experiment in sorted({trial.experiment for trial in trials}):
        for recovers, name in KINDS:
            chosen = [
                trial
                for trial in trials
                if trial.experiment == experiment and trial.recovers is recovers
            ]
            variants += _by_settings(experiment, name, recovers, chosen)
    return variants


def variant_names(trials: Sequence[TrialSummary]) -> Dict[str, str]:
    """Return the name of the variant of each trial, by trial id."""
    return {
        trial.trial_id: variant.name
        for variant in find_variants(trials)
        for trial in variant.trials
    }


def _by_settings(
    experiment: str, name: str, recovers: Optional[bool], trials: Sequence[TrialSummary]
) -> List[VariantTrials]:
    """One variant for each settings of the oracle, named by what differs, one without oracle."""
    parts: Dict[SettingsKey, List[TrialSummary]] = {}
    same: Dict[int, List[TrialSummary]] = {}  # that share one tuple of settings, as most do
    for trial in trials:
        part = same.get(id(trial.settings))
        if part is None:
            part = parts.setdefault(_settings_key(trial) if recovers else (), [])
            same[id(trial.settings)] = part
        part.append(trial)
    in_order = [(dict(parts[key][0].settings), tuple(parts[key])) for key in sorted(parts)]
    differing = _differing([settings for settings, _ in in_order])
    return [
        VariantTrials(
            experiment, ', '.join([name] + _named(settings, differing)), recovers, settings, part
        )
        for settings, part in in_order
    ]


def _named(settings: Dict[str, Any], keys: Sequence[str]) -> List[str]:
    return ['{} {}'.format(key, settings.get(key, 'unknown')) for key in keys]


def time_series(
    trials: Sequence[TrialSummary],
) -> List[Tuple[Tuple[str, ...], Tuple[TrialSummary, ...]]]:
    """Return the trials of each figure: a replicate of an oracle, and trials without an oracle.

    Returns with each the words that distinguish it from the others: experiment, oracle, replicate,
    as far as there are several.
    """
    series = []
    variants = find_variants(trials)
    experiments = sorted({variant.experiment for variant in variants})
    for experiment in experiments:
        mine = [variant for variant in variants if variant.experiment == experiment]
        beside = [
            part for variant in mine if variant.recovers is False for part in variant.replicates()
        ]
        with_oracle = [
            (variant.name, variant.replicates())
            for variant in mine
            if variant.recovers is not False
        ]
        for name, parts in with_oracle or [('', [()] * len(beside))]:
            for number, part in enumerate(parts):
                words = (
                    ((experiment,) if len(experiments) > 1 else ())
                    + ((name,) if len(with_oracle) > 1 else ())
                    + (('replicate', str(number)) if len(parts) > 1 else ())
                )
                without = beside[number] if number < len(beside) else ()
                series.append((words, tuple(part) + tuple(without)))
    return series


def _settings_key(trial: TrialSummary) -> SettingsKey:
    """Numbers in the order of their size, everything else in that of the alphabet."""
    return tuple(
        (key, value, '') if isinstance(value, (int, float)) else (key, 0.0, str(value))
        for key, value in trial.settings
    )


def _differing(settings: Sequence[Dict[str, Any]]) -> List[str]:
    keys = sorted({key for each in settings for key in each})
    return [key for key in keys if len({repr(each.get(key)) for each in settings}) > 1]


def count_variants(trials: Sequence[TrialSummary]) -> List[VariantCounts]:
    """Count the trials of each experiment and variant."""
    return [count_variant(variant) for variant in find_variants(trials)]


def count_variant(variant: VariantTrials) -> VariantCounts:
    """Count what happened in the trials of a variant."""
    trials, parts = variant.trials, variant.replicates()
    known = [trial for trial in trials if trial.truth is not None]
    counts = [_by_events(name, number, trials, parts) for name, number in _BY_EVENTS]
    ended = [[trial.ending for trial in part] for part in parts]
    for ending, name in _ENDINGS.items():
        by_part = [part.count(ending) for part in ended]
        if ending is not TrialEnding.OTHER or any(by_part):
            counts.append(_count(name, by_part, trials, parts))
    if known:
        counts += [
            make_count(name, _found(holds), known, _by_replicate(known))
            for name, holds in _BY_TRUTH
        ]
    counts.append(
        make_count(PERSON_NEEDED, lambda trial: trial.person_needed is True, trials, parts)
    )
    return VariantCounts(
        variant.experiment,
        variant.name,
        len(trials),
        tuple(counts),
        sum(1 for trial in trials if trial.lost_events),
        sum(trial.lost_events for trial in trials),
        len(parts),
        len(known),
        sum(1 for trial in trials if trial.resumed),
        sum(trial.down_s for trial in trials),
        sum(trial.person_needed is None for trial in trials),
    )


def _by_events(
    name: str,
    number: Callable[[TrialSummary], int],
    trials: Sequence[TrialSummary],
    parts: Sequence[Sequence[TrialSummary]],
) -> Count:
    numbers = [list(map(number, part)) for part in parts]
    count = _count(name, [len(part) - part.count(0) for part in numbers], trials, parts)
    return count._replace(events=sum(sum(part) for part in numbers))


def _found(holds: Callable[[TrialEnding, bool], bool]) -> Callable[[TrialSummary], bool]:
    return lambda trial: trial.truth is not None and holds(trial.ending, trial.truth.success)


def make_count(
    name: str,
    happened: Callable[[TrialSummary], bool],
    trials: Sequence[TrialSummary],
    parts: Sequence[Sequence[TrialSummary]],
) -> Count:
    """Count the trials in which something happened.

    There is at least one. `parts`: the same by replicate.
    """
    return _count(name, [sum(map(happened, part)) for part in parts], trials, parts)


def _count(
    name: str,
    by_part: Sequence[int],
    trials: Sequence[TrialSummary],
    parts: Sequence[Sequence[TrialSummary]],
) -> Count:
    number = sum(by_part)
    shares = [one / len(part) for one, part in zip(by_part, parts)]
    return Count(
        name,
        number,
        number / len(trials),
        wilson_interval(number, len(trials)),
        None,
        replicate_interval(shares),
    )
