"""Survival without a person: Kaplan and Meier's estimate of how long trials go on. Pure.

A stretch begins with the first trial of a folder, and after each trial in which a person was
needed. It ends with the next such trial. If the folder ends first, nobody knows how long it would
have gone on: it is censored.
"""

import math
from typing import Dict, List, NamedTuple, Optional, Sequence

from ..counting.trial_summary import TrialSummary
from ..intervals import Z_95, Interval

SECONDS_PER_HOUR = 3600.0


class PersonFree(NamedTuple):
    """Trials of one folder, one after the other, up to the next one that needed a person."""

    trials: int  # the one that needed a person is the last of them
    hours: float  # in which they ran
    is_ended: bool  # by a person. False: the record ends before


class Duration(NamedTuple):
    """A stretch in one unit."""

    length: float
    is_ended: bool


class SurvivalStep(NamedTuple):
    """The share of stretches that go on beyond a length."""

    length: float
    at_risk: int  # stretches that were at least so long
    ended: int  # of these, by a person, at this length
    share: float
    interval: Interval  # of 95%


def stretches(trials: Sequence[TrialSummary]) -> List[PersonFree]:
    """Return the stretches of the trials of each folder, in the order of their beginnings.

    A trial of which it is not known whether a person was needed counts as one without.
    """
    folders: Dict[str, List[TrialSummary]] = {}
    for trial in sorted(trials, key=lambda each: (each.start_time, each.trial_id)):
        folders.setdefault(trial.replicate, []).append(trial)
    found = []
    for folder in sorted(folders):
        number, hours = 0, 0.0
        for trial in folders[folder]:
            number += 1
            hours += hours_of(trial)
            if trial.person_needed:
                found.append(PersonFree(number, hours, True))
                number, hours = 0, 0.0
        if number:
            found.append(PersonFree(number, hours, False))
    return found


def hours_of(trial: TrialSummary) -> float:
    """Return for how long a trial's program ran, in hours. 0 where its times are not sound."""
    seconds = trial.duration_s - trial.down_s
    return max(0.0, seconds) / SECONDS_PER_HOUR if math.isfinite(seconds) else 0.0


def kaplan_meier(durations: Sequence[Duration]) -> List[SurvivalStep]:
    """Return a step for each length at which a stretch ended.

    The estimate is that of E. L. Kaplan and P. Meier (J. Am. Stat. Assoc. 53, 1958). The interval
    is that of Greenwood's variance on the scale of log(-log), which keeps it within 0 and 1
    (J. D. Kalbfleisch, R. L. Prentice, The Statistical Analysis of Failure Time Data, 1980). Where
    the share is 0 that has no width, and the interval goes from 0 to the last upper end.
    """
    steps: List[SurvivalStep] = []
    share, spread, upper = 1.0, 0.0, 1.0
    for length in sorted({each.length for each in durations if each.is_ended}):
        at_risk = sum(each.length >= length for each in durations)
        ended = sum(each.length == length and each.is_ended for each in durations)
        share *= 1.0 - ended / at_risk
        if ended == at_risk:
            share, interval = 0.0, (0.0, upper)
        else:
            spread += ended / (at_risk * (at_risk - ended))
            interval = _log_log(share, spread)
        upper = interval[1]
        steps.append(SurvivalStep(length, at_risk, ended, share, interval))
    return steps


def _log_log(share: float, spread: float) -> Interval:
    power = math.exp(Z_95 * math.sqrt(spread) / abs(math.log(share)))
    return share**power, share ** (1.0 / power)


def median_of(steps: Sequence[SurvivalStep]) -> Optional[float]:
    """Return the length that half of the stretches exceed. None: more than half go on."""
    return next((step.length for step in steps if step.share <= 0.5), None)
