"""Many machines under many policies, in several processes at a time."""

import concurrent.futures
import contextlib
import multiprocessing
import threading
import time
from typing import Any, Iterable, List, Mapping, NamedTuple, Optional, Tuple

import smach

from .orders import Arm
from .running import NO_SETTINGS, Trial, run_machine


class Ran(NamedTuple):
    """One machine under one policy."""

    seed: int
    trials: Tuple[Trial, ...]
    cpu_s: float


class Runner(contextlib.ExitStack):
    """Runs machines. What becomes of them depends on their seeds, and not on the number of jobs."""

    def __init__(self, jobs: int) -> None:
        super().__init__()
        be_quiet()
        self._pool: Optional[concurrent.futures.Executor] = None
        if jobs > 1:
            self._pool = self.enter_context(
                concurrent.futures.ProcessPoolExecutor(
                    jobs, multiprocessing.get_context('fork'), be_quiet
                )
            )

    def run(
        self,
        arm: str,
        seeds: Iterable[int],
        trials: int,
        settings: Mapping[str, Any] = NO_SETTINGS,
    ) -> List[Ran]:
        """Run the machines of these seeds under a policy, and return them in that order."""
        work = [(arm, seed, trials, settings) for seed in seeds]
        if self._pool is None:
            return [run_one(each) for each in work]
        return list(self._pool.map(run_one, work))


def be_quiet() -> None:
    """Have SMACH log nothing. Upstream's Concurrence lets its threads raise."""

    def silent(*said: object) -> None:
        """A logger that nobody hears."""

    smach.set_loggers(silent, silent, silent, silent)
    threading.excepthook = silent


def run_one(work: Tuple[str, int, int, Mapping[str, Any]]) -> Ran:
    """Run one machine: the policy by name, its seed, the number of trials, and settings."""
    arm, seed, trials, settings = work
    begin_s = time.process_time()
    ran = run_machine(seed, Arm(arm), trials, settings=settings)
    return Ran(seed, ran, time.process_time() - begin_s)
