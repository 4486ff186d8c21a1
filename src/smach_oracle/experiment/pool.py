"""Jobs, some at a time: of one experiment, or of all parts of a protocol."""

import fcntl
import os
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.cluster import ClusterError, WorkerCluster
from smach_oracle.forking import unlock

from .estimate import seconds_missing
from .job import ExperimentJob
from .plan import EXPERIMENT_FILE, ExperimentError, ExperimentPlan, enter_folder
from .progress import PoolProgress, ProgressLine
from .protocols import Part
from .results import RESULTS_FILE
from .sharing import CLEAN_FILE, ENDED_FILE, Sharing
from .stop_signals import StopSignals

POLL_S = 0.5
BROKEN_AT_ONCE = 3  # jobs, before a trial has ended: then something is wrong with more than a job
# a protocol's folder may lie in a repository: commit what it goes on from, and not its bags
COMMITTED = ('*/', '.gitignore', RESULTS_FILE, EXPERIMENT_FILE, CLEAN_FILE, ENDED_FILE)
IGNORED = '\n'.join(['*', *('!' + name for name in COMMITTED), ''])


class PartJobs(NamedTuple):
    """A part of a protocol, and its jobs."""

    part: Part
    jobs: List[ExperimentJob]


class PoolResult(NamedTuple):
    """The parts of a protocol, and the jobs that did not come to their ends."""

    parts: List[PartJobs]
    broken: Dict[str, str]  # jobs that could not be brought to their ends, and why


def run(
    plan: ExperimentPlan,
    output: Path,
    at_a_time: int,
    hung_after_s: float,
    cluster: Optional[WorkerCluster] = None,
) -> List[ExperimentJob]:
    """Run the jobs of an experiment that are not over, some at a time, and return them all.

    :param cluster: whose machines run them. None means this one does.
    :raises ClusterError: where the cluster is gone, or does not see the folder.
    :raises ExperimentError: naming the job and its folder.
    :raises StopRequested: by Ctrl-C and the like, once everything is stopped.
    """
    jobs: List[ExperimentJob] = []
    progress = ProgressLine(sys.stdout)
    with StopSignals() as signals:
        try:
            if cluster is not None:
                cluster.check_folder(output)
            jobs += _make_jobs(plan, output, hung_after_s, cluster)
            _let_share([(plan, jobs)], output)
            run_jobs(jobs, at_a_time, signals, progress)
        finally:
            progress.end()
            stop_all(jobs)
    return jobs


def run_parts(
    parts: Sequence[Part],
    output: Path,
    at_a_time: int,
    hung_after_s: float,
    cluster: Optional[WorkerCluster] = None,
) -> PoolResult:
    """Run the jobs of all parts that are not over, the longest first.

    A job that cannot go on costs its replicate. The others go on.

    :param output: each part gets a folder in it.
    :param cluster: whose machines run them. None means this one does.
    :raises ClusterError: where the cluster is gone, or does not see the folder.
    :raises ExperimentError: where a folder cannot be gone on with, or job after job breaks.
    :raises StopRequested: by Ctrl-C and the like, once everything is stopped.
    """
    (output / '.gitignore').write_text(IGNORED, encoding='utf-8')
    made: List[PartJobs] = []
    broken: Dict[str, str] = {}
    progress = PoolProgress(sys.stdout, at_a_time)
    with StopSignals() as signals:
        try:
            if cluster is not None:
                cluster.check_folder(output)
            for part in parts:
                folder = output / part.name
                goes_on = enter_folder(folder, part.plan, hung_after_s)
                made.append(PartJobs(part, []))
                for job in _make_jobs(part.plan, folder, hung_after_s, cluster):
                    job.name = '{}/{}'.format(part.name, job.name)
                    made[-1].jobs.append(job)
                if goes_on:
                    made[-1].jobs[0].messages.insert(0, 'Going on in {}'.format(folder))
                signals.check()
            _let_share([(each.part.plan, each.jobs) for each in made], output)
            run_jobs(_longest_first(_all(made)), at_a_time, signals, progress, broken)
        finally:
            progress.end()
            stop_all(_all(made))
    return PoolResult(made, broken)


def _all(made: Sequence[PartJobs]) -> List[ExperimentJob]:
    return [job for each in made for job in each.jobs]


def _make_jobs(
    plan: ExperimentPlan, output: Path, hung_after_s: float, cluster: Optional[WorkerCluster]
) -> Iterator[ExperimentJob]:
    for replicate in range(plan.replicates):
        for variant in plan.variants:
            yield ExperimentJob(plan, variant, replicate, output, hung_after_s, cluster)


def _let_share(
    made: Sequence[Tuple[ExperimentPlan, Sequence[ExperimentJob]]], output: Path
) -> None:
    """Let jobs share the trials of the bare job of the same seeds, where their plan has it so."""
    # a world that goes on is not as it was for another variant
    jobs = [job for plan, mine in made if plan.shares and plan.hours is None for job in mine]
    bare = {job.pairs: job for job in jobs if not job.variant.recovers}
    sharing = Sharing(output) if bare else None
    for job in jobs:
        if sharing is not None and job.variant.recovers and job.pairs in bare:
            job.share(sharing, bare[job.pairs])


def _longest_first(jobs: Sequence[ExperimentJob]) -> List[ExperimentJob]:
    """Return the jobs so that none of the longest is alone at the end."""
    missing = dict(zip(map(id, jobs), seconds_missing([job.work() for job in jobs])))
    return sorted(jobs, key=lambda job: -missing[id(job)])


def stop_all(jobs: Sequence[ExperimentJob]) -> None:
    """End the processes of every job. Of several errors the first is raised, after all."""
    for job in jobs:
        job.request_stop()
    errors: List[Exception] = []
    for job in jobs:
        try:
            job.stop()
        except (ClusterError, ExperimentError, OSError) as err:  # e.g. the disk is full
            errors.append(err)
    if errors:
        raise errors[0]


def run_jobs(
    jobs: Sequence[ExperimentJob],
    at_a_time: int,
    signals: StopSignals,
    progress: ProgressLine,
    broken: Optional[Dict[str, str]] = None,
) -> None:
    """Start the jobs one after the other and wait for their ends.

    :param broken: gets the jobs that cannot go on, and why. None means the first such is raised.
    :raises ExperimentError: likewise, and where jobs break before any trial has ended.
    """
    waiting = [job for job in jobs if not job.over]
    active: List[ExperimentJob] = []
    before = sum(job.finished for job in jobs)
    progress.show(jobs)
    while waiting or active:
        while waiting and len(active) < at_a_time:
            # a job that waits for one which was left shares what is there of it
            ready = [job for job in waiting if job.ready] or ([] if active else waiting)
            if not ready:
                break
            waiting.remove(ready[0])
            ready[0].core = _free_core(active, at_a_time)
            active.append(ready[0])
            active[-1].start()
        time.sleep(POLL_S)
        signals.check()
        for job in active:
            try:
                job.watch()
            except ExperimentError as err:
                if broken is None or (
                    len(broken) + 1 >= BROKEN_AT_ONCE
                    and sum(each.finished for each in jobs) == before
                ):
                    raise
                broken[job.name] = str(err)
                job.messages.append('{}; the replicate is left'.format(err))
        active = [job for job in active if not job.over and job.name not in (broken or ())]
        for job in jobs:
            job.heed()
        left = {id(job) for job in [*active, *waiting]}
        waiting += [
            job
            for job in jobs
            if not job.over and id(job) not in left and job.name not in (broken or ())
        ]
        progress.show(jobs)


def _free_core(active: Sequence[ExperimentJob], at_a_time: int) -> Optional[int]:
    """Return a core for a job, where there is one for each.

    The processes of a job mostly wait for each other. Kept on one core they wake each other faster.
    """
    free = sorted(os.sched_getaffinity(0) - {job.core for job in active})
    return free[0] if at_a_time == len(os.sched_getaffinity(0)) and free else None


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Keep a second experiment out of the folder.

    :raises ExperimentError: where one is at work there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / '.lock').open('w') as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as err:
            raise ExperimentError('{}: another run_trials is at work there'.format(folder)) from err
        try:
            yield
        finally:
            unlock(lock.fileno())
