"""The time that an experiment takes: by the trials that it has had, else as measured before."""

import statistics
from typing import Dict, List, NamedTuple, Sequence

# wall s of a trial, two jobs at a time, before any has ended: a guess, from some on a busy machine
SECONDS = {'pick_and_place': 4.0, 'drink_retrieval': 15.0}
START_S = 15.0  # of the nodes of a job


class JobWork(NamedTuple):
    """The work that a job has done, and the work that is left."""

    task: str
    missing: int  # trials
    took_s: Sequence[float]  # wall s of each of its trials, as far as they are known


def paces(works: Sequence[JobWork]) -> Dict[str, float]:
    """Return wall s of a trial by task."""
    found = {}
    for task, usual in SECONDS.items():
        took = [each for work in works if work.task == task for each in work.took_s]
        found[task] = statistics.mean(took) if took else usual
    return found


def seconds_missing(works: Sequence[JobWork]) -> List[float]:
    """Return wall s that each job still takes by itself."""
    pace = paces(works)
    return [START_S + pace[work.task] * work.missing if work.missing else 0.0 for work in works]


def seconds_left(works: Sequence[JobWork], at_a_time: int) -> float:
    """Return wall s until all jobs are over, so many at a time."""
    missing = seconds_missing(works)
    return max([sum(missing) / at_a_time, *missing])


def duration(seconds: float) -> str:
    """Return a time in words, e.g. '3 h 05 min'."""
    if seconds < 120:
        return '{:.0f} s'.format(seconds)
    hours, minutes = divmod(round(seconds / 60), 60)
    return '{} h {:02} min'.format(hours, minutes) if hours else '{} min'.format(minutes)
