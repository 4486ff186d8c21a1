"""Run the checks, say what each found and how long it took, and end with `N passed, N failed`.

The lines above that one tell what was found on upstream's SMACH, and count the checks that needed
a second attempt.

Called by scripts/test, in the environment of scripts/ros_env.
"""

import argparse
import fnmatch
import signal
import sys
import time
from pathlib import Path
from typing import Dict, List, Optional

import interpreter
from checks import (
    Bench,
    Check,
    benchmark_checks,
    lint_checks,
    pytest_checks,
    rostest_checks,
    upstream_checks,
)
from processes import Runner
from report import Outcome, on_upstream, second_attempts, write_junit
from schedule import WORKERS, rows_of, run_side_by_side
from upstream import UpstreamError, environment

GROUPS = ('bench', 'lint', 'package', 'ros', 'unit', 'upstream')
ROOT = Path(__file__).resolve().parents[2]


def find_checks(group: str, upstream: Optional[Path], python: Optional[Path]) -> Dict[str, Check]:
    """The checks of one group, by name."""
    if python is not None:
        return pytest_checks(ROOT, 'unit', python=str(python), env=interpreter.environment(python))
    if group == 'upstream':
        return upstream_checks(ROOT, upstream) if upstream is not None else {}
    if group == 'lint':
        return lint_checks(ROOT)
    if group == 'unit':
        return pytest_checks(ROOT, 'unit')
    if group == 'ros':
        return rostest_checks(ROOT)
    if group == 'package':
        return pytest_checks(ROOT, 'package')
    return benchmark_checks(ROOT)


def select(checks: Dict[str, Check], pattern: str) -> Dict[str, Check]:
    """The checks whose name contains `pattern`, or matches it where it has wildcards."""
    return {
        name: check
        for name, check in checks.items()
        if fnmatch.fnmatch(name, '*{}*'.format(pattern))
    }


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='scripts/test', description='Set up, then check everything.'
    )
    parser.add_argument(
        'group',
        nargs='?',
        choices=[*GROUPS, 'all'],
        default='all',
        help='lint: style, types, launch files; unit: no ROS master; ros: rostests; '
        'upstream: on the engine of --upstream; package: build and install; bench: limits on '
        'speed (default: all)',
    )
    parser.add_argument(
        'pattern',
        nargs='?',
        default='',
        help='only checks with this in their name; * is a wildcard',
    )
    parser.add_argument(
        '--jobs',
        type=int,
        help='checks at a time (default: {}, benchmarks of wall-clock time 1)'.format(len(WORKERS)),
    )
    parser.add_argument(
        '--upstream',
        metavar='PATH',
        type=Path,
        help='a checkout of ros/executive_smach, branch noetic-devel: the tests of the executive, '
        'of SMACH and of wrapped machines run on it too',
    )
    parser.add_argument(
        '--python',
        metavar='PATH',
        type=Path,
        help='run the unit tests under this interpreter, 3.8 or later, in a venv of its own '
        '(.venv-X.Y.Z), made of requirements-noetic.txt and requirements-noetic-dev.txt',
    )
    arguments = parser.parse_args()
    if arguments.python is not None:
        if arguments.group not in ('all', 'unit') or arguments.upstream is not None:
            parser.error('--python runs the unit tests alone')
        arguments.group = 'unit'
        try:
            arguments.python = interpreter.make_venv(ROOT, arguments.python)
        except interpreter.InterpreterError as err:
            parser.error('--python: {}'.format(err))
    if arguments.group == 'upstream' and arguments.upstream is None:
        parser.error('upstream needs --upstream PATH')
    if arguments.upstream is not None:
        arguments.upstream = arguments.upstream.resolve()
        try:
            environment(arguments.upstream)
        except UpstreamError as err:
            parser.error('--upstream: {}'.format(err))
    return arguments


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def main() -> int:
    arguments = parse_arguments()
    # SIGINT too: a shell that starts this in the background has it ignored, here and in all that is
    # started from here
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    bench = Bench(ROOT, ROOT / 'build' / 'test_results', Runner())
    bench.results.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    outcomes: List[Outcome] = []
    try:
        checks: Dict[str, Check] = {}
        for group in GROUPS:
            if arguments.group in ('all', group):
                checks.update(find_checks(group, arguments.upstream, arguments.python))
        for row, jobs in rows_of(select(checks, arguments.pattern)):
            jobs = arguments.jobs or jobs
            print('--- {} checks, {} at a time'.format(len(row), jobs))
            outcomes += run_side_by_side(row, bench, jobs)
    except KeyboardInterrupt:
        print('interrupted; what ran has been stopped')
        return 130
    return _summarise(outcomes, bench, time.monotonic() - started)


def _summarise(outcomes: List[Outcome], bench: Bench, seconds: float) -> int:
    write_junit(outcomes, bench.results / 'all.xml')
    bad = [outcome.name for outcome in outcomes if not outcome.ok]
    print('--- {:.0f} s; results and logs in {}'.format(seconds, bench.results))
    if bad:
        print('failed: {}'.format(', '.join(bad)))
    skipped = sum(outcome.skipped for outcome in outcomes)
    if skipped:
        print('{} skipped'.format(skipped))
    passed, failed = (
        sum(getattr(outcome, name) for outcome in outcomes) for name in ('passed', 'failed')
    )
    # a check without a single case counts as a failure, and so does a selection that selects
    # nothing
    failed += sum(1 for outcome in outcomes if not outcome.ok and not outcome.failed) + (
        not outcomes
    )
    print(on_upstream(outcomes))
    print(second_attempts(outcomes))
    print('{} passed, {} failed'.format(passed, failed))
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
