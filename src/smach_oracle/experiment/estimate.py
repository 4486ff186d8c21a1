"""The time that an experiment takes: by the trials that it has had, else as measured before."""

import statistics
from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.analysis.trial_rows import TrialRow

from .sharing import RUN_AGAIN, is_run_again


class TrialSeconds(NamedTuple):
    """The wall s that trials of a task take, two jobs at a time, and how many of them fail."""

    clean: float  # of one in which nothing fails
    failing: float  # of one with a failure, under an oracle
    share: float  # of the trials, in which a state fails under the bare script


# as doc/protocol.md says, and the shares as in the fourth freeze
SECONDS = {
    'pick_and_place': TrialSeconds(2.8, 8.0, 0.27),
    'drink_retrieval': TrialSeconds(8.5, 15.0, 0.42),
    'inspection': TrialSeconds(8.6, 12.0, 0.8),
}
REPLAYED_S = 0.1  # of one that is shared
START_S = 15.0  # of the nodes of a job
ENOUGH = 20  # trials of the bare script, from which the share that fails is theirs
ALONE, BARE, SHARING = 'alone', 'bare', 'sharing'  # kinds of jobs


class JobWork(NamedTuple):
    """The work that a job has done, and the work that is left."""

    task: str
    missing: float  # trials that it has to run
    took_s: Sequence[float]  # wall s of each that it has run, as far as they are known
    kind: str = ALONE
    replays: float = 0.0  # trials that it has to count, and that the bare script runs


def usual_seconds(task: str, kind: str) -> float:
    """Return wall s of a trial that a job of a kind runs, as measured before."""
    usual = SECONDS[task]
    if kind == BARE:
        return usual.clean
    clean = (1.0 - usual.share) * (RUN_AGAIN if kind == SHARING else 1.0)
    total = usual.share * usual.failing + clean * usual.clean
    return total / (usual.share + clean)


def paces(works: Sequence[JobWork]) -> Dict[Tuple[str, str], float]:
    """Return wall s of a trial by task and kind of the job, of those that there are."""
    found = {}
    for place in sorted({(work.task, work.kind) for work in works}):
        took = [each for work in works if (work.task, work.kind) == place for each in work.took_s]
        found[place] = statistics.mean(took) if took else usual_seconds(*place)
    return found


def seconds_missing(
    works: Sequence[JobWork], pace: Optional[Mapping[Tuple[str, str], float]] = None
) -> List[float]:
    """Return wall s that each job still takes by itself.

    :param pace: as paces() returns it. None means that of these jobs.
    """
    pace = paces(works) if pace is None else pace
    return [
        START_S + pace[work.task, work.kind] * work.missing + REPLAYED_S * work.replays
        if work.missing + work.replays
        else 0.0
        for work in works
    ]


def seconds_left(works: Sequence[JobWork], at_a_time: int) -> float:
    """Return wall s until all jobs are over, so many at a time."""
    missing = seconds_missing(works)
    return max([sum(missing) / at_a_time, *missing])


def replayed(task: str, seeds: Iterable[int], bare: Sequence[TrialRow]) -> float:
    """Return how many trials a job replays, as far as the bare script's rows tell.

    Of a seed without a row it counts the share of the trials in which nothing fails.
    """
    clean = {row.seed: not row.failures and row.succeeded for row in bare}
    usual = sum(clean.values()) / len(clean) if len(clean) >= ENOUGH else 1 - SECONDS[task].share
    return sum(float(clean.get(seed, usual)) for seed in seeds if not is_run_again(seed))


def duration(seconds: float) -> str:
    """Return a time in words, e.g. '3 h 05 min'."""
    if seconds < 120:
        return '{:.0f} s'.format(seconds)
    hours, minutes = divmod(round(seconds / 60), 60)
    return '{} h {:02} min'.format(hours, minutes) if hours else '{} min'.format(minutes)
