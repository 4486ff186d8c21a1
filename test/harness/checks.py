"""The checks of scripts/test, by group. Each takes a `Bench` and returns an `Outcome`."""

import fnmatch
import os
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Callable, Dict, List, Optional

from processes import Runner
from report import Outcome, read_junit, tail_of
from upstream import ROSTESTS, UNIT_TESTS, environment

PACKAGE = 'smach_oracle'
PYTHON_SOURCES = ['src', 'scripts', 'test', 'benchmarks', 'examples', 'cmake', 'setup.py']
# mypy spends a quarter of its time in the garbage collector. Without it, mypy needs 0.7 GB more
MYPY = 'import gc; gc.disable(); from mypy.__main__ import console_entry; console_entry()'
VERMIN = 'from vermin import main; main()'
# roslaunch wants one function of distutils. Until 3.12 Python has a distutils of its own. That of
# setuptools comes first, and brings 0.15 s of imports to each rostest and each launch file
OWN_DISTUTILS = {'SETUPTOOLS_USE_DISTUTILS': 'stdlib'} if sys.version_info < (3, 12) else {}
# a rostest ends by itself before, at its time-limit: only so does it tell which case hung
MAX_ROSTEST_S = 600.0
# of one folder, which only a hang reaches. The longest take 200 s of processor time, and give way:
# at a load of 20, two of them had a fifth of a core and took more than 900 s
MAX_PYTEST_S = 1800.0


@dataclass
class Bench:
    """Where the checks work: the checkout, the folder for results, and what runs their commands."""

    root: Path
    results: Path
    runner: Runner

    def run(
        self,
        name: str,
        command: List[str],
        timeout_s: float,
        env: Optional[Dict[str, str]] = None,
        gives_way: bool = False,
    ) -> Outcome:
        """Run one command that passes or fails as a whole."""
        log = self.results / 'log' / (name.replace('/', '_').replace(' ', '_') + '.log')
        started = time.monotonic()
        ended = self.runner.run(command, log, timeout_s, self.root, env, gives_way)
        outcome = Outcome(
            name,
            seconds=time.monotonic() - started,
            processor_s=ended.processor_s,
            log=str(log),
        )
        if ended.problem:
            outcome.failed = 1
            outcome.detail = '{}\n{}'.format(tail_of(log), ended.problem)
        else:
            outcome.passed = 1
        return outcome


Check = Callable[[Bench], Outcome]
Attempt = Callable[[], Outcome]


def _command(name: str, command: List[str], bench: Bench, timeout_s: float = 300.0) -> Outcome:
    return bench.run(name, command, timeout_s, gives_way=True)


def lint_checks(root: Path) -> Dict[str, Check]:
    """Linters, imports, types, pages, words, Python 3.8, catkin_lint, launches."""
    # mypy looks at a file again where it, or what it imports, has changed since
    types = [sys.executable, '-c', MYPY, '--cache-dir', str(root / 'build' / 'mypy')]
    checks = {
        'ruff': ['ruff', 'check', '--no-cache', '--output-format', 'concise', '.'],
        'format': ['ruff', 'format', '--no-cache', '--check', '.'],
        'imports': ['env', 'PYTHONPATH=src', 'lint-imports', '--no-cache'],
        'mypy': types,
        'python 3.8': [
            sys.executable,
            '-c',
            VERMIN,
            '--target=3.8-',
            '--no-tips',
            '--violations',
            '--no-parse-comments',
        ]
        + PYTHON_SOURCES,
        'pages and links': [sys.executable, 'doc/site/build.py', '--check'],
        'words': [sys.executable, 'test/unit/house/plain_words.py'],
        'javascript types': ['tsc', '-p', 'jsconfig.json'],
        'catkin_lint': ['catkin_lint', '--offline', '--strict', '-W2', str(root)],
    }
    for launch in sorted((root / 'launch').glob('*.launch')):
        checks['launch/' + launch.name] = [
            'env',
            *map('='.join, OWN_DISTUTILS.items()),
            _roslaunch_check(),
            *('-o', os.devnull, str(launch)),
        ]
    return {name: partial(_command, name, command) for name, command in checks.items()}


def _roslaunch_check() -> str:
    import rospkg

    return os.path.join(rospkg.RosPack().get_path('roslaunch'), 'scripts', 'roslaunch-check')


def pytest_checks(
    root: Path,
    folder: str,
    python: str = sys.executable,
    env: Optional[Dict[str, str]] = None,
) -> Dict[str, Check]:
    """pytest on test/FOLDER, as one check for each folder and file in it.

    :param python: the interpreter that it runs under, with the variables `env`.
    """
    top = root / 'test' / folder
    parts = sorted({path.relative_to(top).parts[0] for path in top.rglob('test_*.py')})
    names = ['{}/{}'.format(folder, part) for part in parts]
    return {name: partial(_pytest, name, env=env, python=python) for name in names}


def _pytest(
    name: str,
    bench: Bench,
    shown: str = '',
    env: Optional[Dict[str, str]] = None,
    python: str = sys.executable,
) -> Outcome:
    shown = shown or name
    result = bench.results / '{}.xml'.format(shown.replace('/', '-'))
    command = [
        python,
        '-m',
        'pytest',
        '-q',
        '--tb=short',
        '--junit-xml',
        str(result),
        'test/' + name,
    ]
    return _with_junit(bench.run(shown, command, MAX_PYTEST_S, env, gives_way=True), [result])


def _with_junit(outcome: Outcome, results: List[Path]) -> Outcome:
    """Replace the count of one command by the counts of the cases it reported."""
    counted = Outcome(
        outcome.name, seconds=outcome.seconds, processor_s=outcome.processor_s, log=outcome.log
    )
    read_junit([path for path in results if path.exists()], counted)
    if outcome.failed and not counted.failed:
        # it died, or failed outside every case
        counted.failed += 1
        counted.detail += outcome.detail
    return counted


def rostest_checks(root: Path) -> Dict[str, Check]:
    """Every test/rostest/*.test, each with a master of its own on a free port."""
    tests = sorted((root / 'test' / 'rostest').glob('*.test'))
    return {'rostest/' + path.stem: partial(_rostest, path) for path in tests}


def upstream_checks(root: Path, checkout: Path) -> Dict[str, Check]:
    """What touches the executive or smach_ros, on upstream's.

    :raises UpstreamError: where `checkout` has no such packages.
    """
    env = environment(checkout)
    checks: Dict[str, Check] = {}
    for folder in UNIT_TESTS:
        name = 'unit/' + folder
        checks['upstream/' + name] = partial(_pytest, name, shown='upstream/' + name, env=env)
    for path in sorted((root / 'test' / 'rostest').glob('*.test')):
        if any(fnmatch.fnmatch(path.stem, pattern) for pattern in ROSTESTS):
            name = 'upstream/rostest/' + path.stem
            checks[name] = partial(_rostest, path, shown=name, env=env)
    return checks


def _rostest(
    path: Path, bench: Bench, shown: str = '', env: Optional[Dict[str, str]] = None
) -> Outcome:
    """As rostest's own attribute `retry`: a machine busy with other tests is no failure."""
    shown = shown or 'rostest/' + path.stem
    return _at_most_twice(partial(_run_rostest, path, bench, shown, env), bench)


def _at_most_twice(attempt: Attempt, bench: Bench) -> Outcome:
    """Try again once where the first attempt failed. That is shown with its reason, and counted."""
    first = attempt()
    if first.ok or bench.runner.stopped:
        return first
    first_log = _kept(Path(first.log)) if first.log else ''
    _kept(bench.results / first.name)  # what its nodes have logged
    second = attempt()
    second.attempts = 2
    second.seconds += first.seconds
    second.processor_s += first.processor_s
    second.note = '{} at the second attempt; the first:\n{}\nlog: {}'.format(
        'passed' if second.ok else 'failed', first.detail.rstrip(), first_log
    )
    return second


def _kept(path: Path) -> Path:
    """Keep a file or folder of a first attempt beside that of the second. Return where it is."""
    if not path.exists():
        return path
    kept = path.with_suffix('.first' + path.suffix)
    if path.is_dir():
        shutil.rmtree(str(kept), ignore_errors=True)
    path.rename(kept)
    return kept


def _run_rostest(
    path: Path, bench: Bench, shown: str, more_env: Optional[Dict[str, str]]
) -> Outcome:
    command = ['rostest', '--package', PACKAGE, '--pkgdir', str(bench.root), str(path)]
    folder = bench.results / shown
    # rostest hands the place of the results on unquoted: it must not have a space in it
    scratch = Path(tempfile.mkdtemp(prefix='rostest-'))
    env = {
        'ROS_TEST_RESULTS_DIR': str(scratch),
        'ROS_LOG_DIR': str(scratch / 'log'),
        'ROS_HOME': str(scratch / 'home'),
        **OWN_DISTUTILS,
    }
    outcome = bench.run(shown, command, MAX_ROSTEST_S, dict(env, **(more_env or {})))
    shutil.rmtree(str(folder), ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(str(scratch), str(folder))
    # rostest's own file repeats as one case each what the tests' files have in full
    return _with_junit(outcome, sorted(folder.glob('**/rosunit-*.xml')))


def benchmark_checks(root: Path) -> Dict[str, Check]:
    """Benchmarks that know `--check`: they measure briefly and fail where a limit is missed."""
    files = [
        path
        for path in sorted((root / 'benchmarks').glob('*.py'))
        if "'--check'" in path.read_text('utf-8')
    ]
    return {'benchmarks/' + path.stem: partial(_benchmark, path) for path in files}


def _benchmark(path: Path, bench: Bench) -> Outcome:
    """A limit on time holds if it holds once: what else the machine does can only make a program
    slower.
    """
    command = [sys.executable, str(path), '--check']
    return _at_most_twice(partial(bench.run, 'benchmarks/' + path.stem, command, 300.0), bench)
