"""Mutants put in and tried: which of them does no test see?"""

import queue
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Callable, Generator, List, NamedTuple, Sequence, Set, Tuple, TypeVar

from processes import Runner

from .copies import Copy, TestsNotRun
from .mutations import Mutant, mutants_of

ATTEMPTS = 3  # of tests that should pass, on a machine that does other work, too
MEASURING_S = 600.0
SPARE_S, SLOWER = 60.0, 6.0  # a file of tests that takes longer than this hangs

Item = TypeVar('Item')
Found = TypeVar('Found')


class Project(NamedTuple):
    """A tree, and the folders in it that have the modules and their tests."""

    root: Path
    mutated: str
    tests: str

    def mutants(self) -> List[Mutant]:
        """Return every mutant of its modules."""
        modules = self.root / self.mutated
        return [
            mutant
            for path in sorted(modules.rglob('*.py'))
            for mutant in mutants_of(path.read_text('utf-8'), str(path.relative_to(modules)))
        ]


class Reach(NamedTuple):
    """A file of tests: the lines that it reaches, as module and number, and how long it takes."""

    test: str
    lines: Set[Tuple[str, int]]
    took_s: float

    @property
    def limit_s(self) -> float:
        """How long the file may take before it counts as hung."""
        return SPARE_S + SLOWER * self.took_s


class Trial(NamedTuple):
    """What became of a mutant."""

    mutant: Mutant
    verdict: str  # killed, hung, survived, or unreached: no test comes to its statement
    by: str  # the file of tests that has killed it
    tests: int  # files of tests that come to its statement
    took_s: float

    @property
    def is_alive(self) -> bool:
        """Whether no test sees it."""
        return self.verdict in ('survived', 'unreached')


class Workshop:
    """Copies of the tree, in each of which one mutant at a time is tried."""

    def __init__(self, project: Project, folder: Path, jobs: int) -> None:
        """:param folder: for the copies, one for each of the jobs."""
        self._mutated = project.mutated
        self._runner = Runner()
        self._jobs = jobs
        self._copies: 'queue.Queue[Copy]' = queue.Queue()
        for number in range(jobs):
            copy = Copy(project.root, folder / str(number), self._runner)
            self._copies.put(copy)
            self._tests = copy.files_of_tests(project.tests)

    def look(self) -> Generator[Reach, None, None]:
        """Yield which lines each file of tests reaches.

        :raises TestsNotRun: where one fails although nothing was changed.
        """
        return self._each(lambda copy, test: _measure(copy, test, self._mutated), self._tests)

    def try_all(
        self, mutants: Sequence[Mutant], reaches: List[Reach]
    ) -> Generator[Trial, None, None]:
        """Try each mutant, and yield what has become of it."""
        return self._each(lambda copy, mutant: _try(copy, self._mutated, mutant, reaches), mutants)

    def _each(
        self, work: Callable[[Copy, Item], Found], items: Sequence[Item]
    ) -> Generator[Found, None, None]:
        """Work on each item in a copy. Whatever ends that early leaves no process behind."""

        def in_copy(item: Item) -> Found:
            copy = self._copies.get()
            try:
                return work(copy, item)
            finally:
                self._copies.put(copy)

        with ThreadPoolExecutor(self._jobs) as pool:
            futures = [pool.submit(in_copy, item) for item in items]
            try:
                for future in as_completed(futures):
                    yield future.result()
            except BaseException:
                self._runner.stop()
                raise


def _measure(copy: Copy, test: str, below: str) -> Reach:
    for _ in range(ATTEMPTS):
        ending, lines = copy.measure(test, below, MEASURING_S)
        if ending.is_fine:
            return Reach(test, lines, ending.took_s)
    raise TestsNotRun('{} fails without a mutant:\n{}'.format(test, copy.last_words()))


def _try(copy: Copy, below: str, mutant: Mutant, reaches: List[Reach]) -> Trial:
    """Put a mutant in, run the tests that reach it, the quickest first, and take it out."""
    first, last = mutant.statement
    wanted = {(mutant.module, line) for line in range(first, last + 1)}
    tests = sorted((each for each in reaches if each.lines & wanted), key=lambda each: each.took_s)
    path = copy.folder / below / mutant.module
    original = path.read_text('utf-8')
    path.write_text(mutant.applied(original), 'utf-8')
    took_s = 0.0
    try:
        for reach in tests:
            verdict, test_s = _verdict_of(copy, reach)
            took_s += test_s
            if verdict:
                return Trial(mutant, verdict, reach.test, len(tests), took_s)
    finally:
        path.write_text(original, 'utf-8')
    return Trial(mutant, 'survived' if tests else 'unreached', '', len(tests), took_s)


def _verdict_of(copy: Copy, reach: Reach) -> Tuple[str, float]:
    """Return whether a file of tests kills the mutant that is in, and how long it took.

    A test that fails once and then passes has failed for another reason.
    """
    took_s, failed = 0.0, 0
    for _ in range(ATTEMPTS):
        ending = copy.run([reach.test], reach.limit_s, {})
        took_s += ending.took_s
        if ending.is_hung:
            return 'hung', took_s
        failed += not ending.is_fine
        if failed == 2:
            return 'killed', took_s
        if ending.is_fine and not failed:
            break
    return '', took_s
