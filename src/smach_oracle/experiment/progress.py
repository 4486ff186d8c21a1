"""The progress of an experiment: a line rewritten on a terminal, one now and then elsewhere."""

import time
from typing import IO, List, Sequence

from smach_oracle.analysis.counting.trial_summary import TrialSummary
from smach_oracle.analysis.trial_counter import TrialEnding

from .estimate import duration, seconds_left
from .job import ExperimentJob

LOG_EVERY_S = 10.0


class ProgressLine:
    """The line, and messages above it."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream
        self._terminal = stream.isatty()
        self._last = ''
        self._printed = 0.0
        self._began = time.monotonic()
        self._finished_before: List[int] = []

    def show(self, jobs: Sequence[ExperimentJob]) -> None:
        """Trials so far, what came of them, and the time left."""
        for job in jobs:
            for message in job.messages:
                self._write(message + '\n')
            job.messages.clear()
        finished = [job.finished for job in jobs]
        self._finished_before = self._finished_before or finished
        text = self._describe(jobs)
        now = time.monotonic()
        if text == self._last or (not self._terminal and now - self._printed < LOG_EVERY_S):
            return
        self._last, self._printed = text, now
        left = self._left(jobs, now - self._began, sum(finished) - sum(self._finished_before))
        self._write(text + left + ('' if self._terminal else '\n'))

    def _describe(self, jobs: Sequence[ExperimentJob]) -> str:
        return '   '.join(describe_variants(jobs))

    def _left(self, jobs: Sequence[ExperimentJob], elapsed_s: float, done: int) -> str:
        return time_left(elapsed_s, done, sum(job.trials - job.finished for job in jobs))

    def _write(self, text: str) -> None:
        self._stream.write('\r\033[K' + text if self._terminal else text)
        self._stream.flush()

    def end(self) -> None:
        """Leave the line."""
        if self._terminal:
            self._stream.write('\n')


class PoolProgress(ProgressLine):
    """The line for the jobs of many experiments, of different length."""

    def __init__(self, stream: IO[str], at_a_time: int) -> None:
        super().__init__(stream)
        self._at_a_time = at_a_time

    def _describe(self, jobs: Sequence[ExperimentJob]) -> str:
        lost = sum(len(job.lost) for job in jobs)
        return '{}/{} trials, {}/{} replicates over{}'.format(
            sum(job.finished for job in jobs),
            sum(job.trials for job in jobs),
            sum(job.over for job in jobs),
            len(jobs),
            ', {} lost'.format(lost) if lost else '',
        )

    def _left(self, jobs: Sequence[ExperimentJob], elapsed_s: float, done: int) -> str:
        left_s = seconds_left([job.work() for job in jobs], self._at_a_time)
        return '   about {} left'.format(duration(left_s)) if left_s else ''


def time_left(elapsed_s: float, done: int, missing: int) -> str:
    """E.g. "   12 min left", or nothing where nothing can be said yet."""
    if not done or not missing:
        return ''
    left_s = elapsed_s / done * missing
    return (
        '   {:.0f} min left'.format(left_s / 60)
        if left_s >= 120
        else '   {:.0f} s left'.format(left_s)
    )


def describe_variants(jobs: Sequence[ExperimentJob]) -> List[str]:
    """E.g. "with oracle 40/150: 11 with failures, 10 recovered, 2 asked, 0 failed"."""
    texts = []
    for name in dict.fromkeys(job.variant.name for job in jobs):
        mine = [job for job in jobs if job.variant.name == name]
        trials = [trial for job in mine for trial in job.summaries.values()]
        lost = sum(len(job.lost) for job in mine)
        texts.append(
            '{} {}/{}{}{}'.format(
                name.replace('_', ' '),
                sum(job.finished for job in mine),
                sum(job.trials for job in mine),
                ': ' + describe_trials(trials, mine[0].variant.recovers) if trials else '',
                ', {} lost'.format(lost) if lost else '',
            )
        )
    return texts


def describe_trials(trials: Sequence[TrialSummary], recovers: bool) -> str:
    """Say what came of some trials, in numbers of trials."""
    failed = '{} failed'.format(sum(trial.ending is TrialEnding.FAILURE for trial in trials))
    others = sum(trial.ending is TrialEnding.OTHER for trial in trials)
    if others:
        failed += ', {} with another end'.format(others)
    if not recovers:
        return failed
    return '{} with failures, {} recovered, {} asked, {}'.format(
        sum(trial.failures > 0 for trial in trials),
        sum(trial.recoveries > 0 for trial in trials),
        sum(trial.questions > 0 for trial in trials),
        failed,
    )
