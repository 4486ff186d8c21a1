"""Which checks run side by side, and in which order.

Rostests wait most of their time: for nodes that start, for time to pass, for masters that come
back. All others compute. On two cores one that computes runs beside two that wait. Benchmarks run
alone, at the end.
"""

import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import Dict, List, Mapping, NamedTuple, Sequence, Tuple

from checks import Bench, Check
from report import Outcome, show

COMPUTES, WAITS = 'computes', 'waits'
# what each worker takes: the second kind where none of the first is left. So two compute side by
# side at most
THREE_WORKERS = ((COMPUTES, WAITS), (WAITS, COMPUTES), (WAITS,))
MORE = (WAITS, COMPUTES)


class Row(NamedTuple):
    """Groups of checks that run side by side."""

    groups: Tuple[str, ...]
    jobs: int  # checks at a time


ROWS = (Row(('lint', 'unit', 'ros', 'package', 'upstream'), 3), Row(('bench',), 1))
GROUPS = sorted(group for row in ROWS for group in row.groups)
# those with most to compute are begun first, so that none of them is left alone at the end
LONGEST = (
    'unit/simulation',
    'unit/oracle',
    'unit/ros',
    'package/test_build.py',
    'unit/borders',
    'unit/pr2',
    'unit/house',
    'unit/analysis',
    'unit/scripted_operator',
    'mypy',
    'unit/expert',
    'rostest/task_cluster',
    'rostest/task_experiment',
    'rostest/console_teleoperation',
)


def kind_of(name: str) -> str:
    """Whether the check of this name computes or waits most of its time."""
    return WAITS if 'rostest/' in name else COMPUTES


class Queues:
    """Names of checks that are still to run, for several threads to take from."""

    def __init__(self, names: Sequence[str]) -> None:
        self._lock = Lock()
        self._left: Dict[str, List[str]] = {COMPUTES: [], WAITS: []}
        for name in [each for each in LONGEST if each in names] + list(names):
            if name not in self._left[kind_of(name)]:
                self._left[kind_of(name)].append(name)

    def take(self, kinds: Sequence[str]) -> str:
        """Return the next check of the first of these kinds that has any left, else ''."""
        with self._lock:
            return next((self._left[kind].pop(0) for kind in kinds if self._left[kind]), '')


def run_side_by_side(checks: Mapping[str, Check], bench: Bench, jobs: int) -> List[Outcome]:
    """Run checks, showing each as it ends.

    :param jobs: how many at a time.
    """
    queues, lock = Queues(list(checks)), Lock()
    outcomes: List[Outcome] = []

    def work(kinds: Sequence[str]) -> None:
        for name in iter(lambda: queues.take(kinds), ''):
            outcome = checks[name](bench)
            if bench.runner.stopped:
                return
            with lock:
                outcomes.append(outcome)
                show(outcome)
                sys.stdout.flush()

    workers = (*THREE_WORKERS, *[MORE] * jobs)[:jobs]
    with ThreadPoolExecutor(jobs) as pool:
        ends = [pool.submit(work, kinds) for kinds in workers]
        try:
            for end in ends:
                end.result()
        except KeyboardInterrupt:
            bench.runner.stop()
            raise
    return outcomes
