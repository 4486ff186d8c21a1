"""Copies of the tree: tests run there, so that the checkout stays as it is."""

import collections
import json
import math
import os
import re
import shutil
import sys
import time
from pathlib import Path
from typing import DefaultDict, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

from processes import Runner

from .collected import Collected, Ending, TestsNotRun

LEFT_OUT = shutil.ignore_patterns('build', '.venv', '.git', '__pycache__')
PYTEST = ('-m', 'pytest', '-q', '-x', '-p', 'no:cacheprovider')
LOG = 'pytest.log'
MEASURING_S = 600.0
# a mutant may collect without end. No test needs as much
MEMORY = ('prlimit', '--as={}'.format(4 << 30))
TOO_LATE = 'not done after'  # a word of `Runner`
NOT_RUN = ('exit status 4', 'exit status 5')  # pytest's: wrong arguments, and no tests
FAILED = re.compile('^(?:FAILED|ERROR) (.+?)(?: - .*)?$', re.MULTILINE)
# in each process that the tests start or fork, one that ends by os._exit among them
MEASURES = """import os
import coverage

measured, leave = coverage.process_startup(), os._exit

def save_and_leave(status):
    try:
        measured.save()
    finally:  # also where a test has taken away the right to write
        leave(status)

if measured is not None:
    os._exit = save_and_leave
"""
# a plugin for pytest: says to which test a line belongs, and how long each takes. What a file makes
# once for its tests belongs to none of them
BY_TEST = """import json
import math
import os
import time

import coverage
import pytest

contexts, times = [''], {}

def enter(context):
    contexts.append(context)
    coverage.Coverage.current().switch_context(context)

def leave():
    contexts.pop()
    coverage.Coverage.current().switch_context(contexts[-1])

@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item):
    enter(item.nodeid)
    begun_s = time.monotonic()
    yield
    times[item.nodeid] = time.monotonic() - begun_s
    leave()

@pytest.hookimpl(hookwrapper=True)
def pytest_fixture_setup(fixturedef):
    enter(contexts[-1] if fixturedef.scope == 'function' else '')
    yield
    leave()

def pytest_sessionfinish():
    with open(os.environ['TIMES_OF_TESTS'], 'w') as file:
        json.dump(times, file)
"""
Line = Tuple[str, int]  # module, number


class Reach(NamedTuple):
    """A test, or a file of tests: the lines that it reaches, and how long it takes."""

    test: str  # pytest's name of it
    lines: Set[Line]
    took_s: float

    @property
    def file(self) -> str:
        """Its file."""
        return self.test.split('::')[0]


class Copy:
    """A copy of a tree."""

    def __init__(self, root: Path, folder: Path, runner: Runner, tests: str) -> None:
        """:param folder: where it is made. What is measured lies next to it.
        :param tests: folder in it that has the tests.
        """
        self.folder = folder
        self._runner = runner
        self._tests = tests
        self._measured = self._beside('measured')
        self._collected: Optional[Collected] = None
        shutil.copytree(str(root), str(folder), ignore=LEFT_OUT)

    def run(self, tests: Sequence[str], limit_s: float, env: Dict[str, str]) -> Ending:
        """Run files of tests up to the first failure. Nothing of them is left running.

        :raises TestsNotRun: where pytest finds none, or is not installed.
        :raises KeyboardInterrupt: where the runner was stopped.
        """
        begun_s = time.monotonic()
        problem = self._pytest(tests, self.folder / LOG, limit_s, env)
        if problem == 'interrupted':
            raise KeyboardInterrupt
        if problem in NOT_RUN:
            raise TestsNotRun(self.last_words())
        return Ending(
            not problem,
            problem.startswith(TOO_LATE),
            time.monotonic() - begun_s,
            self._first_failed() if problem else '',
        )

    def _pytest(
        self, arguments: Sequence[str], log: Path, limit_s: float, env: Dict[str, str]
    ) -> str:
        """Run pytest, and return what went wrong."""
        paths = (env.get('PYTHONPATH'), str(self.folder / 'src'), os.environ.get('PYTHONPATH'))
        path = os.pathsep.join(filter(None, paths))
        return self._runner.run(
            [*MEMORY, sys.executable, *PYTEST, *arguments],
            log,
            limit_s,
            self.folder,
            dict(env, PYTHONPATH=path, PYTHONDONTWRITEBYTECODE='1', PYTHONHASHSEED='0'),
        ).problem

    def run_changed(self, module: Path, tests: Sequence[str], limit_s: float) -> Ending:
        """Run tests with the change of a module that is on the disk, as `run` does, and quickly
        where the change is in functions that have not run on import. `collect` comes before.
        """
        assert self._collected is not None
        ending = self._collected.run(module, tests, limit_s)
        if ending is not None:
            return ending
        try:
            return self.run(tests, limit_s, {})
        except TestsNotRun:  # the module does not load, or its tests have other names
            files = sorted({test.split('::')[0] for test in tests})
            return self.run(files, MEASURING_S, {})

    def collect(self) -> None:
        """Hold all tests collected from now on. Nothing may be changed yet: all runs see it.

        :raises TestsNotRun: where pytest ends before it has collected.
        """
        if self._collected is None:
            self._collected = Collected(self._collect, self._beside('collected'))

    def _collect(self, env: Dict[str, str]) -> str:
        """Hold the tests for `_collected`. Return what went wrong in the end."""
        log = self.folder / 'collected.log'
        problem = self._pytest(
            ['-p', 'forking', '--basetemp', str(self._beside('temporary')), self._tests],
            log,
            math.inf,
            env,
        )
        return '{}\n{}'.format(problem, _end_of(log))

    def close(self) -> None:
        """End what it has started."""
        if self._collected is not None:
            self._collected.close()
            self._collected = None

    def measure(self, file: str, below: str) -> Tuple[Ending, List[Reach]]:
        """Run a file of tests, and return which lines of which modules each test reaches. Lines
        that a child process reaches, and what the tests share, are those of the file as a whole.

        :param below: folder with the modules. Their paths are given from there.
        """
        shutil.rmtree(str(self._measured), ignore_errors=True)
        self._measured.mkdir()
        settings, times = self._measured / 'settings', self._measured / 'times'
        settings.write_text(
            '[run]\nparallel = True\nsource = {}\ndata_file = {}\n'.format(
                self.folder / below, self._measured / 'lines'
            )
        )
        (self._measured / 'sitecustomize.py').write_text(MEASURES)
        (self._measured / 'by_test.py').write_text(BY_TEST)
        ending = self.run(
            ['-p', 'by_test', file],
            MEASURING_S,
            {
                'COVERAGE_PROCESS_START': str(settings),
                'TIMES_OF_TESTS': str(times),
                'PYTHONPATH': str(self._measured),
            },
        )
        if not ending.is_fine:
            return ending, []
        lines = self._lines(self.folder / below)
        took_s = json.loads(times.read_text())
        return ending, [
            Reach(test or file, lines[test], took_s.get(test, ending.took_s)) for test in lines
        ]

    def _lines(self, below: Path) -> Dict[str, Set[Line]]:
        """Return the lines by test. Those under '' belong to the file as a whole."""
        from coverage import CoverageData
        from coverage.exceptions import CoverageException

        found: DefaultDict[str, Set[Line]] = collections.defaultdict(set)
        for path in self._measured.glob('lines.*'):
            data = CoverageData(str(path))
            try:
                data.read()
            except CoverageException:  # its process was killed as it wrote
                continue
            for module in data.measured_files():
                name = str(Path(module).relative_to(below))
                for number, tests in data.contexts_by_lineno(module).items():
                    for test in tests:
                        found[test].add((name, number))
        return found

    def _beside(self, name: str) -> Path:
        return self.folder.with_name('{}.{}'.format(self.folder.name, name))

    def last_words(self) -> str:
        """Return the end of the output of the latest run."""
        return _end_of(self.folder / LOG)

    def _first_failed(self) -> str:
        """Return the name of the test that failed in the latest run, or '' where none is named."""
        found = FAILED.search((self.folder / LOG).read_text(errors='replace'))
        return found.group(1) if found else ''

    def files_of_tests(self) -> List[str]:
        """Return the files of tests."""
        return [
            str(path.relative_to(self.folder))
            for path in sorted((self.folder / self._tests).rglob('test_*.py'))
        ]


def _end_of(log: Path) -> str:
    return log.read_text(errors='replace')[-2000:]
