"""The counts of Table I over the trials that a console has heard of.

Definitions: doc/statistics.md.
"""

from collections import Counter
from typing import Dict, Iterable, List, Mapping, Sequence, Tuple, Union

from smach_oracle.analysis.counting.trial_summary import TrialSummary
from smach_oracle.analysis.trial_counter import TrialCounter, TrialEnding

from ..feeds.told_trials import ToldTrial
from ..shapes.trials import CountsRowView, CountView, EndingsView

Counted = Union[TrialCounter, ToldTrial]


def has_oracle(counter: Counted) -> bool:
    """Whether a trial runs with an oracle. It does where nothing else is known yet."""
    return counter.recovers is not False


def counts_table(trials: Iterable[Counted]) -> List[CountsRowView]:
    """Return how many trials had each thing at least once, and how often it happened in all.

    Counted by experiment and by with or without oracle, over the trials that have ended.
    """
    groups: Dict[Tuple[str, bool], List[Counted]] = {}
    for trial in trials:
        if trial.ending is not TrialEnding.UNFINISHED:
            groups.setdefault((trial.experiment, has_oracle(trial)), []).append(trial)
    in_order = sorted(groups, key=lambda key: (key[0], not key[1]))
    return [_row(experiment, oracle, groups[experiment, oracle]) for experiment, oracle in in_order]


def _row(experiment: str, oracle: bool, trials: Sequence[Counted]) -> CountsRowView:
    return {
        'experiment': experiment,
        'oracle': oracle,
        'trials': len(trials),
        'endings': _endings(Counter(trial.ending for trial in trials)),
        'counts': {
            'failures': _count([trial.failures for trial in trials]),
            'recoveries': _count([trial.recoveries for trial in trials]),
            'questions': _count([trial.questions for trial in trials]),
            'answered': _count([trial.answered for trial in trials]),
        },
        'unwell_s': unwell(trials),
    }


def _endings(found: Mapping[TrialEnding, int]) -> EndingsView:
    view: EndingsView = {
        'success': found[TrialEnding.SUCCESS],
        'failure': found[TrialEnding.FAILURE],
        'preempted': found[TrialEnding.PREEMPTED],
    }
    if found[TrialEnding.OTHER]:
        view['other'] = found[TrialEnding.OTHER]
    return view


def unwell(trials: Iterable[Union[Counted, TrialSummary]]) -> float:
    """Return the time (s) for which all together waited until the robot was well."""
    return round(sum(trial.unwell_s for trial in trials), 1)


def _count(numbers: Sequence[int]) -> CountView:
    return {'trials': sum(1 for number in numbers if number), 'events': sum(numbers)}
