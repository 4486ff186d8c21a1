"""Copies of the tree: tests run there, so that the checkout stays as it is."""

import os
import shutil
import sys
import time
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Sequence, Set, Tuple

from processes import Runner

LEFT_OUT = shutil.ignore_patterns('build', '.venv', '.git', '__pycache__')
PYTEST = ('-m', 'pytest', '-q', '-x', '-p', 'no:cacheprovider')
LOG = 'pytest.log'
# a mutant may collect without end. No test needs as much
MEMORY = ('prlimit', '--as={}'.format(4 << 30))
TOO_LATE = 'not done after'  # a word of `Runner`
NOT_RUN = ('exit status 4', 'exit status 5')  # pytest's: wrong arguments, and no tests
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


class TestsNotRun(Exception):
    """pytest could not run the tests. The text has its output."""


class Ending(NamedTuple):
    """How a run of tests has ended."""

    is_fine: bool
    is_hung: bool
    took_s: float


class Copy:
    """A copy of a tree."""

    def __init__(self, root: Path, folder: Path, runner: Runner) -> None:
        """:param folder: where it is made. What is measured lies next to it."""
        self.folder = folder
        self._runner = runner
        self._measured = folder.with_name(folder.name + '.measured')
        shutil.copytree(str(root), str(folder), ignore=LEFT_OUT)

    def run(self, tests: Sequence[str], limit_s: float, env: Dict[str, str]) -> Ending:
        """Run files of tests up to the first failure. Nothing of them is left running.

        :raises TestsNotRun: where pytest finds none, or is not installed.
        :raises KeyboardInterrupt: where the runner was stopped.
        """
        path = os.pathsep.join(
            filter(
                None,
                (env.get('PYTHONPATH'), str(self.folder / 'src'), os.environ.get('PYTHONPATH')),
            )
        )
        begun_s = time.monotonic()
        problem = self._runner.run(
            [*MEMORY, sys.executable, *PYTEST, *tests],
            self.folder / LOG,
            limit_s,
            self.folder,
            dict(env, PYTHONPATH=path, PYTHONDONTWRITEBYTECODE='1', PYTHONHASHSEED='0'),
        ).problem
        if problem == 'interrupted':
            raise KeyboardInterrupt
        if problem in NOT_RUN:
            raise TestsNotRun(self.last_words())
        return Ending(not problem, problem.startswith(TOO_LATE), time.monotonic() - begun_s)

    def measure(self, test: str, below: str, limit_s: float) -> Tuple[Ending, Set[Tuple[str, int]]]:
        """Run a file of tests, and return which lines of which modules it reaches.

        :param below: folder with the modules. Their paths are given from there.
        """
        shutil.rmtree(str(self._measured), ignore_errors=True)
        self._measured.mkdir()
        settings = self._measured / 'settings'
        settings.write_text(
            '[run]\nparallel = True\nsource = {}\ndata_file = {}\n'.format(
                self.folder / below, self._measured / 'lines'
            )
        )
        (self._measured / 'sitecustomize.py').write_text(MEASURES)
        ending = self.run(
            [test],
            limit_s,
            {'COVERAGE_PROCESS_START': str(settings), 'PYTHONPATH': str(self._measured)},
        )
        return ending, set(self._lines(self.folder / below))

    def _lines(self, below: Path) -> Iterator[Tuple[str, int]]:
        from coverage import CoverageData
        from coverage.exceptions import CoverageException

        for path in self._measured.glob('lines.*'):
            data = CoverageData(str(path))
            try:
                data.read()
            except CoverageException:  # its process was killed as it wrote
                continue
            for module in data.measured_files():
                for line in data.lines(module) or ():
                    yield str(Path(module).relative_to(below)), line

    def last_words(self) -> str:
        """Return the end of the output of the latest run."""
        return (self.folder / LOG).read_text(errors='replace')[-2000:]

    def files_of_tests(self, below: str) -> List[str]:
        """Return the files of tests below a folder."""
        return [
            str(path.relative_to(self.folder))
            for path in sorted((self.folder / below).rglob('test_*.py'))
        ]
