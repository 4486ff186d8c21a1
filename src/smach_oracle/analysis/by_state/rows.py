"""The counts of states as rows, for JSON and CSV."""

import csv
import statistics
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence

from ..counting.trial_summary import TrialSummary
from ..variants import find_variants
from .state_counts import ANSWERS, NO_ANSWERS, StatesOfTrials

SECONDS_PER_HOUR = 3600.0
# what is written next to a table of trials: by the name of its rows
FILES = ('states', 'failures', 'ways', 'costs')
_TIMES = ('to_claim', 'to_answer', 'to_resume')


class VariantStates(NamedTuple):
    """What happened in the states of one variant of an experiment."""

    experiment: str
    variant: str
    found: StatesOfTrials


def by_variant(
    trials: Sequence[TrialSummary], states: Mapping[str, StatesOfTrials]
) -> List[VariantStates]:
    """Return the counts of each experiment and variant, in the order of the tables."""
    rows = []
    for variant in find_variants(trials):
        found = StatesOfTrials()
        for trial in variant.trials:
            if trial.trial_id in states:
                found.add(states[trial.trial_id])
        rows.append(VariantStates(variant.experiment, variant.name, found))
    return rows


def per(above: float, below: float) -> Optional[float]:
    """Return a ratio, None where there is nothing to divide by."""
    return above / below if below else None


def costs_of(found: StatesOfTrials) -> Dict[str, Optional[float]]:
    """Return what recoveries and questions cost, a trial and a robot hour, and the expert's times.

    None where there was no question, no choice, or no time.
    """
    hours = found.robot_s / SECONDS_PER_HOUR
    told: Dict[str, Optional[float]] = {}
    for name in ('extra_s', 'extra_visits', 'expert_s'):
        told[name + '_a_trial'] = per(getattr(found, name), found.trials)
        told[name + '_a_robot_hour'] = per(getattr(found, name), hours)
    for name in _TIMES:
        times = getattr(found.times, name)
        told[name + '_s_median'] = statistics.median(times) if times else None
        told[name + '_s_most'] = max(times) if times else None
    choices = found.choices
    told['choices'] = choices.gone
    told['led_on'], told['led_on_not_known'] = choices.helped, choices.not_known
    return {name: value if value is None else round(value, 3) for name, value in told.items()}


def rows_of(variants: Sequence[VariantStates]) -> Dict[str, List[Dict[str, Any]]]:
    """Return the rows of each of FILES, as plain data."""
    rows: Dict[str, List[Dict[str, Any]]] = {name: [] for name in FILES}
    for experiment, variant, found in variants:
        of_it = {'experiment': experiment, 'variant': variant}
        rows['costs'].append(
            dict(of_it, trials=found.trials, robot_s=round(found.robot_s, 3), **costs_of(found))
        )
        for name in sorted(found.states):
            counts = found.states[name]
            of_state = dict(of_it, state=name)
            rows['states'].append(
                dict(
                    of_state,
                    visits=counts.visits,
                    failures=counts.failures,
                    not_recovered=counts.not_recovered,
                    questions=counts.questions,
                    **{key: counts.answers.get(key, 0) for key in ANSWERS + NO_ANSWERS},
                    seconds=round(counts.seconds, 3),
                    lost_s=round(counts.lost_s, 3),
                    lost_visits=counts.lost_visits,
                )
            )
            for (kind, outcome, text), number in sorted(counts.reasons.items()):
                reason = dict(kind=kind, outcome=outcome, reason=text, failures=number)
                rows['failures'].append(dict(of_state, **reason))
            for words, count in sorted(counts.ways.items()):
                rows['ways'].append(
                    dict(
                        of_state,
                        way=words,
                        gone=count.gone,
                        helped=count.helped,
                        in_vain=count.in_vain,
                        not_known=count.not_known,
                        seconds=round(count.seconds, 3),
                    )
                )
    return rows


def write_csv_files(path: str, variants: Sequence[VariantStates]) -> List[str]:
    """Write a file for each of FILES next to that of the trials, and return the paths.

    :raises OSError: where one cannot be written.
    """
    place, written = Path(path), []
    for name, rows in rows_of(variants).items():
        target = place.with_name('{}_{}{}'.format(place.stem, name, place.suffix or '.csv'))
        with target.open('w', encoding='utf-8', newline='') as stream:
            heads = list(rows[0]) if rows else ['experiment', 'variant']
            writer = csv.DictWriter(stream, heads, lineterminator='\n')
            writer.writeheader()
            writer.writerows(rows)
        written.append(str(target))
    return written
