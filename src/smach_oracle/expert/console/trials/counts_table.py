"""The counts of Table I over the trials that a console has heard of.

Definitions: doc/statistics.md.
"""

from collections import Counter
from typing import Any, Dict, Iterable, List, Sequence, Tuple, Union

from smach_oracle.analysis.counting.trial_summary import TrialSummary
from smach_oracle.analysis.trial_counter import TrialCounter, TrialEnding

from ..feeds.told_trials import ToldTrial

ENDINGS = (TrialEnding.SUCCESS, TrialEnding.FAILURE, TrialEnding.OTHER, TrialEnding.PREEMPTED)
COUNTED = ('failures', 'recoveries', 'questions', 'answered')


Counted = Union[TrialCounter, ToldTrial]


def has_oracle(counter: Counted) -> bool:
    """Whether a trial runs with an oracle. It does where nothing else is known yet."""
    return counter.recovers is not False


def counts_table(trials: Iterable[Counted]) -> List[Dict[str, Any]]:
    """Return how many trials had each thing at least once, and how often it happened in all.

    Counted by experiment and by with or without oracle, over the trials that have ended.
    """
    groups: Dict[Tuple[str, bool], List[Counted]] = {}
    for trial in trials:
        if trial.ending is not TrialEnding.UNFINISHED:
            groups.setdefault((trial.experiment, has_oracle(trial)), []).append(trial)
    in_order = sorted(groups, key=lambda key: (key[0], not key[1]))
    return [_row(experiment, oracle, groups[experiment, oracle]) for experiment, oracle in in_order]


def _row(experiment: str, oracle: bool, trials: Sequence[Counted]) -> Dict[str, Any]:
    endings = Counter(trial.ending for trial in trials)
    return {
        'experiment': experiment,
        'oracle': oracle,
        'trials': len(trials),
        'endings': {
            ending.value: endings[ending]
            for ending in ENDINGS
            if ending is not TrialEnding.OTHER or endings[ending]
        },
        'counts': {name: _count([getattr(trial, name) for trial in trials]) for name in COUNTED},
        'unwell_s': unwell(trials),
    }


def unwell(trials: Iterable[Union[Counted, TrialSummary]]) -> float:
    """Return the time (s) for which all together waited until the robot was well."""
    return round(sum(trial.unwell_s for trial in trials), 1)


def _count(numbers: Sequence[int]) -> Dict[str, int]:
    return {'trials': sum(1 for number in numbers if number), 'events': sum(numbers)}
