"""Which checks run side by side, and in which order.

Rostests wait most of their time: for nodes that start, for time to pass, for masters that come
back. All others compute, and some of them wait as well: for processes that they kill, for the disk.
Three that wait run beside three that compute. Tests and linters that compute give way
(`processes.NICE`): a rostest then finds the machine almost idle. Hardly ever is a core idle. With
two that compute, a fifth of both cores was. A benchmark that loads both cores itself runs
alone, at the end, and so does one whose limits are near: neighbours in the cache cost it a tenth.
"""

import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import Dict, List, Mapping, Sequence, Tuple

from checks import Bench, Check
from report import Outcome, show

COMPUTES, WAITS, ALONE = 'computes', 'waits', 'alone'
# what each worker takes: the second kind where none of the first is left. So four compute side by
# side at most
WORKERS = (
    (COMPUTES, WAITS),
    (WAITS, COMPUTES),
    (COMPUTES, WAITS),
    (COMPUTES, WAITS),
    (WAITS,),
    (WAITS,),
)
MORE = (WAITS, COMPUTES)
# benchmarks that need no machine of their own: they count faults or memory, take processor time,
# hold the best of many rounds against a yardstick of the same run, or stay far from their limit on
# a busy machine: answers take 0.8 to 1.2 empty calls (limit 4), the PR2 is 4 to 5 times as fast as
# real time (limit 1), and a driven hand stands within 17 to 52 ms of its world's time (limit 100)
BESIDE_OTHERS = tuple(
    'benchmarks/' + name
    for name in (
        'answer_latency',
        'borders',
        'checkpoint',
        'count_bags',
        'introspection',
        'killed',
        'mark_latency',
        'oracle_decision',
        'oracle_memory',
        'oracle_overhead',
        'pr2_world',
        'random_trees',
        'recorder_throughput',
        'smach_engine',
        'teleoperation',
        'trial_speed',
    )
)
# those with most to compute, or to wait, are begun first: none of them is left alone at the end
LONGEST = (
    'unit/simulation',
    'unit/oracle',
    'unit/ros',
    'package/test_build.py',
    'unit/store',  # it waits for the disk: last of all it would leave a core idle for a minute
    'unit/borders',
    'unit/pr2',
    'unit/house',
    'benchmarks/trial_speed',
    'unit/analysis',
    'unit/scripted_operator',
    'mypy',
    'unit/expert',
    'rostest/task_experiment',
    'rostest/oracle_programs_built',
    'rostest/oracle_programs_nested',
    'rostest/oracle_programs_served',
    'rostest/oracle_programs_threads',
    'rostest/task_sharing',
    'rostest/console_teleoperation',
    'rostest/console_live',
    'rostest/lab_that_goes_on',
    'rostest/console_worn',
)


def kind_of(name: str) -> str:
    """Whether the check of this name computes or waits most of its time, or must run alone."""
    if 'rostest/' in name:
        return WAITS
    return COMPUTES if not name.startswith('benchmarks/') or name in BESIDE_OTHERS else ALONE


def rows_of(checks: Mapping[str, Check]) -> List[Tuple[Dict[str, Check], int]]:
    """Return checks in the order of their rows, and how many of each row run at a time."""
    alone = {name: check for name, check in checks.items() if kind_of(name) == ALONE}
    beside = {name: check for name, check in checks.items() if name not in alone}
    return [row for row in ((beside, len(WORKERS)), (alone, 1)) if row[0]]


class Queues:
    """Names of checks that are still to run, for several threads to take from."""

    def __init__(self, names: Sequence[str]) -> None:
        self._lock = Lock()
        self._left: Dict[str, List[str]] = {COMPUTES: [], WAITS: []}
        for name in [each for each in LONGEST if each in names] + list(names):
            left = self._left[WAITS if kind_of(name) == WAITS else COMPUTES]
            if name not in left:
                left.append(name)

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

    workers = (*WORKERS, *[MORE] * jobs)[:jobs]
    with ThreadPoolExecutor(jobs) as pool:
        ends = [pool.submit(work, kinds) for kinds in workers]
        try:
            for end in ends:
                end.result()
        except KeyboardInterrupt:
            bench.runner.stop()
            raise
    return outcomes
