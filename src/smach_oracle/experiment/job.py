"""One job: the trials of one replicate of one variant, in order.

It has a master, a world and learned rates of its own.
"""

import json
import time
from pathlib import Path
from typing import Any, Dict, List, Optional, Set, Tuple, Union

from smach_oracle.analysis.counting.trial_summary import TrialSummary
from smach_oracle.analysis.truth import SHARED
from smach_oracle.cluster import WorkerCluster
from smach_oracle.oracle.decision.policies import POLICIES

from .cluster_launch import ClusterLaunch
from .estimate import ALONE, SHARING, JobWork, replayed
from .estimate import BARE as BARE_JOB
from .lab import LAB_FILE, write_lab
from .launching import LOG_FILE, Launch, end_marked, last_words, size_of
from .one_line import write_config
from .plan import BARE, TASKS, ExperimentError, ExperimentPlan, Variant
from .records import RecordedTrial, ReplicateRecords
from .results import JobResults
from .sharing import CleanTrial, Sharing, clean_trials, difference, is_run_again, write_shared

LEFTOVER_GRACE_S = 15.0  # for processes that an earlier job left running
ATTEMPTS = 2  # at a trial that hangs, or in which something dies
# s without a sign of life, after which a trial is taken for hung. The longest of 1,612 trials took
# 92 s in all, beside other work. A machine would have to be ten times as slow
HUNG_AFTER_S = 900.0
LONGEST = 5  # times the time without a sign of life: what a trial may take that goes on and on
LOST_IN_A_ROW = 3  # trials, after which something is wrong with more than a trial


class ExperimentJob:
    """Runs until all its trials are complete or lost. A trial may fail without failing the job."""

    def __init__(
        self,
        plan: ExperimentPlan,
        variant: Variant,
        replicate: int,
        output: Path,
        hung_after_s: float,
        cluster: Optional[WorkerCluster] = None,
    ) -> None:
        """Look through the folder.

        :param cluster: that runs its launches. None means this machine does.
        :raises ExperimentError: where the folder cannot be gone on with.
        :raises OSError: where it cannot be read or written.
        """
        self.variant = variant
        self.name = '{}/replicate_{}'.format(variant.name, replicate)
        self.trials = plan.trials
        # of the trials that are over, by the path of their bags
        self.summaries: Dict[str, TrialSummary] = {}
        self.messages: List[str] = []  # for the person at the terminal
        # on which its processes stay. None means any
        self.core: Optional[int] = None
        self._plan = plan
        self._seed = plan.first_seed(replicate)
        self._hung_after_s = hung_after_s
        self._records = ReplicateRecords(
            output / variant.name / 'replicate_{}'.format(replicate), self._seed, plan.trials
        )
        self._results = JobResults(
            output,
            plan.task,
            variant.name,
            replicate,
            self._seed,
            plan.lasting,
            plan.slot_h,
            plan.extra_causes,
        )
        # trials whose bags are whole, and of which the world has not told yet
        self._untold: List[RecordedTrial] = []
        self._cluster = cluster
        self._launch: Union[Launch, ClusterLaunch, None] = None
        self._attempts: Dict[int, int] = {}
        self._sharing: Optional[Sharing] = None
        self._bare: Optional['ExperimentJob'] = None  # that runs the trials which it shares
        self._clean: Dict[int, CleanTrial] = {}  # trials of that by seed, in which nothing failed
        self._compared: Set[int] = set()  # seeds of those that were run here as well
        # the latest trial's end, the latest line that the log grew by
        self._ended_at = self._sign_at = 0.0
        self._logged = 0  # bytes
        left = end_marked(str(self._records.folder), LEFTOVER_GRACE_S)
        if left:
            self.messages.append(
                '{}: ended {} processes that an earlier run had left'.format(self.name, left)
            )
        self._look_through()

    @property
    def over(self) -> bool:
        """Whether all trials are complete or lost."""
        return self._next >= self.trials

    @property
    def lost(self) -> Dict[int, str]:
        """Seeds of the trials that could not be run, and why."""
        return {self._seed + number: why for number, why in self._lost.items()}

    @property
    def finished(self) -> int:
        """The number of trials that are over, lost ones among them."""
        return min(self.trials, self._kept + len(self.summaries) + len(self._lost))

    @property
    def pairs(self) -> Tuple[object, ...]:
        """Return what jobs have in common that run the same trials."""
        plan = self._plan
        return plan.task, self._seed, self.trials, plan.lasting, plan.extra_causes

    @property
    def ready(self) -> bool:
        """Whether it can start: the job is over that runs the trials which it shares."""
        return self._bare is None or self._bare.over

    def work(self) -> JobWork:
        """Return what it has done and has to do."""
        run_here = [row for row in self._results.rows() if not row.shared]
        took = [row.wall_s for row in run_here if row.wall_s is not None]
        missing = self.trials - self.finished
        if self._bare is None:
            kind = ALONE if self.variant.recovers else BARE_JOB
            return JobWork(self._plan.task, missing, took, kind)
        left = range(self._seed + self.trials - missing, self._seed + self.trials)
        shared = replayed(self._plan.task, left, self._bare._results.rows())
        return JobWork(self._plan.task, missing - shared, took, SHARING, shared)

    def share(self, sharing: Sharing, bare: 'ExperimentJob') -> None:
        """Have it share the trials of a bare job in which nothing fails. It has not started.

        :raises ExperimentError, OSError: as the constructor does.
        """
        self._sharing, self._bare = sharing, bare
        if sharing.ended:
            self._stop_sharing()

    def _stop_sharing(self) -> None:
        """Have it run each trial itself, also those that it has shared."""
        self._bare, self._clean, self._records.takes_shared = None, {}, False
        self._look_through()

    def heed(self) -> None:
        """Run what was shared itself, once the sharing has ended.

        :raises ExperimentError, OSError: as the constructor does.
        """
        if self._sharing is not None and self._sharing.ended and self._bare is not None:
            runs = self._launch is not None
            self.stop()
            self._stop_sharing()
            if runs and not self.over:
                self.start()

    def _look_through(self) -> None:
        progress = self._records.tidy_up(self._results.kept(self._records.takes_shared))
        self._untold, self._kept = [], progress.kept
        self._results.forget_from(progress.next_trial)
        self._results.add(
            [self._records.with_truth(trial) for trial in progress.done],
            progress.lost,
            self._records.truth,
        )
        self.summaries = {trial.summary.bags[0]: trial.summary for trial in progress.done}
        self._next, self._lost = progress.next_trial, progress.lost
        if progress.dropped:
            self.messages.append(
                '{}: trial {} was interrupted and is run again'.format(self.name, self._next + 1)
            )

    def start(self) -> None:
        """Launch the trials that are missing.

        :raises OSError: where that cannot be done.
        :raises ClusterError: where the cluster is gone.
        """
        self._ended_at = self._sign_at = time.monotonic()
        if self._plan.slot_h is not None:
            write_lab(
                self._records.folder, self._seed, self._plan.slot_h, self._results.last_left()
            )
        folder, launch_file = self._records.folder, TASKS[self._plan.task].launch_file
        if self._cluster is None:
            self._launch = Launch(folder, launch_file, self._arguments(), self.core)
        else:
            self._launch = ClusterLaunch(self._cluster, folder, launch_file, self._arguments())

    def _arguments(self) -> Dict[str, Any]:
        settings = dict(self.variant.settings, rates_file=str(self._records.rates))
        name = settings.get('policy')
        if name in POLICIES and POLICIES[name].draws:  # by the trial, also after an interruption
            settings['policy'] = {'name': name, 'seed': self._seed + self._next}
        given = TASKS[self._plan.task].arguments()
        if self._plan.lasting is not None:
            given['lasting'] = self._plan.lasting
        if self._plan.hours is not None:
            given['lab'] = self._records.folder / LAB_FILE
        if self._plan.extra_causes:
            given['extra_causes'] = 'true'
        shared = self._to_replay()
        if shared:
            given['shared'] = write_shared(self._records.folder, shared)
        if self.variant.one_line:
            given['config'] = write_config(self._records.folder, self._plan.task)
        return {
            **given,
            'trials': self.trials - self._next,
            'seed': self._seed + self._next,
            'record': self._records.folder,
            'truth': self._records.truth,
            'with_oracle': str(self.variant.recovers).lower(),
            'answer_delay': self._plan.answer_delay,
            'benign': str(self._plan.benign).lower(),
            'oracle': json.dumps(settings),
        }

    def _to_replay(self) -> List[CleanTrial]:
        if self._bare is None:
            return []
        self._clean = self._clean or clean_trials(self._bare._records)
        ours = range(self._seed + self._next, self._seed + self.trials)
        return [
            self._clean[seed] for seed in ours if seed in self._clean and not is_run_again(seed)
        ]

    def _compare(self) -> None:
        """End the sharing where a trial that could be shared went otherwise here."""
        for path, summary in self.summaries.items():
            seed = None if summary.cause is None else summary.cause.seed
            if seed is None or seed not in self._clean or seed in self._compared:
                continue
            truth, content = self._records.truth_lines().get(seed), self._records.events_of(path)
            if truth is None or content is None:  # the world has not told of it yet
                continue
            self._compared.add(seed)
            why = '' if truth.get(SHARED) else difference(self._clean[seed], content.events, truth)
            if why and self._sharing is not None and not self._sharing.ended:
                text = '{}: seed {} went otherwise than under {}: {}'.format(
                    self.name, seed, BARE, why
                )
                self._sharing.end(text)
                self.messages.append(
                    text + '. The sharing ends, and each job runs again what it has shared'
                )

    def watch(self) -> None:
        """Take in new trials. Start again after a trial in which something hung or died.

        :raises ExperimentError: where this does not help.
        """
        if self._launch is None:
            return
        self._take_in()
        if self._launch.running():
            hung = self._hung()
            if hung:
                self._again(hung)
        else:
            self._again('it ended before its trials were over')

    def _hung(self) -> str:
        """Return why the processes are taken for hung, or ''.

        A trial may take long on a machine with much to do.
        """
        logged, now = size_of(self._records.folder / LOG_FILE), time.monotonic()
        if isinstance(self._launch, ClusterLaunch) and self._launch.waits:
            self._ended_at = self._sign_at = now
        if logged != self._logged:
            self._logged, self._sign_at = logged, now
        if now - self._sign_at > self._hung_after_s:
            return 'nothing has happened for {:.0f} s'.format(self._hung_after_s)
        if now - self._ended_at > LONGEST * self._hung_after_s:
            return 'no trial has ended for {:.0f} s'.format(LONGEST * self._hung_after_s)
        return ''

    def _take_in(self) -> None:
        for path in self._records.closed_bags():
            if path not in self.summaries:
                recorded = self._records.read(path)
                if recorded is not None:
                    self.summaries[path] = recorded.summary
                    self._untold.append(recorded)
                    self._ended_at = self._sign_at = time.monotonic()
        told = [trial for trial in self._untold if self._records.is_complete(trial)]
        if told:  # the world reports a trial when the next one begins
            self._untold = [trial for trial in self._untold if trial not in told]
            self._results.add(
                [self._records.with_truth(trial) for trial in told], {}, self._records.truth
            )
            self._compare()

    def _again(self, why: str) -> None:
        self.stop()
        if self.over:
            return
        number = self._next
        self._attempts[number] = self._attempts.get(number, 0) + 1
        text = '{}: seed {}: {}; see {}'.format(
            self.name, self._seed + number, why, self._records.folder / LOG_FILE
        )
        if self._attempts[number] >= ATTEMPTS:
            self._give_up_trial(number, why, text)
        else:
            self.messages.append(text + '; started again')
        if not self.over:
            self.start()

    def _give_up_trial(self, number: int, why: str, text: str) -> None:
        before = set(range(number - LOST_IN_A_ROW + 1, number))
        if not (self.summaries or self._kept) or before <= set(self._lost) and len(before) < number:
            raise ExperimentError(text + last_words(self._records.folder / LOG_FILE))
        self._records.mark_lost(number, why)
        self.messages.append(text + '; LOST')
        self._look_through()

    def request_stop(self) -> None:
        """Ask the processes to end."""
        if self._launch is not None:
            self._launch.request_stop()

    def stop(self) -> None:
        """End the processes, and keep what is complete.

        :raises ExperimentError: where the folder does not fit the plan any more.
        :raises OSError: where it cannot be read or written.
        """
        if self._launch is None:
            return
        self._launch.stop()
        self._launch = None
        self._look_through()
        self._compare()
