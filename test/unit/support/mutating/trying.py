"""Mutants put in and tried: which of them does no test see?"""

import collections
import queue
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import (
    Callable,
    DefaultDict,
    Dict,
    Generator,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Sequence,
    Tuple,
    TypeVar,
)

from processes import Runner

from .collected import TestsNotRun
from .copies import Copy, Reach
from .mutations import Mutant, mutants_of

ATTEMPTS = 3  # of tests that should pass, on a machine that does other work, too
SPARE_S, SLOWER = 60.0, 4.0  # tests that take longer than this hang
FEW = 25  # tests of the first run, and of a file among the first
RUN_S = 4.0  # that the tests of the second run take, at least; of each further one twice as long
START_S = 0.3  # that a run of few tests takes beside them

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


class Trial(NamedTuple):
    """What became of a mutant."""

    mutant: Mutant
    verdict: str  # killed, hung, survived, or unreached: no test comes to its statement
    by: str  # the test that has killed it
    tests: int  # that come to its statement
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
            copy = Copy(project.root, folder / str(number), self._runner, project.tests)
            self._copies.put(copy)
            self._tests = copy.files_of_tests()

    def look(self) -> Generator[List[Reach], None, None]:
        """Yield which lines the tests of each file reach.

        :raises TestsNotRun: where one fails although nothing was changed.
        """
        return self._each(lambda copy, test: _measure(copy, test, self._mutated), self._tests)

    def try_all(
        self, mutants: Sequence[Mutant], reaches: List[Reach]
    ) -> Generator[Trial, None, None]:
        """Try each mutant, and yield what has become of it."""
        try:
            yield from self._each(
                lambda copy, mutant: _try(copy, self._mutated, mutant, reaches), mutants
            )
        finally:
            for copy in list(self._copies.queue):
                copy.close()

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


def _measure(copy: Copy, file: str, below: str) -> List[Reach]:
    for _ in range(ATTEMPTS):
        ending, reaches = copy.measure(file, below)
        if ending.is_fine:
            return reaches
    raise TestsNotRun('{} fails without a mutant:\n{}'.format(file, copy.last_words()))


def _try(copy: Copy, below: str, mutant: Mutant, reaches: List[Reach]) -> Trial:
    """Put a mutant in, run the tests that reach it, and take it out."""
    first, last = mutant.statement
    wanted = {(mutant.module, line) for line in range(first, last + 1)}
    tests = [each for each in reaches if each.lines & wanted]
    of_files = collections.Counter(each.file for each in reaches)
    path = copy.folder / below / mutant.module
    original = path.read_text('utf-8')
    took_s = 0.0
    copy.collect()
    try:
        for run in _in_runs(tests, of_files):
            while run:
                path.write_text(mutant.applied(original), 'utf-8')
                verdict, by, run_s = _verdict_of(copy, path, run)
                took_s += run_s
                path.write_text(original, 'utf-8')
                if not verdict:
                    break
                if not _verdict_of(copy, path, _up_to(by, run))[0]:
                    return Trial(mutant, verdict, by, len(tests), took_s)
                # tests that were never together before may disturb each other: without that one
                run = _without(by, run)
    finally:
        path.write_text(original, 'utf-8')
    return Trial(mutant, 'survived' if tests else 'unreached', '', len(tests), took_s)


def _in_runs(tests: List[Reach], of_files: Mapping[str, int]) -> Iterator[List[Reach]]:
    """Yield the tests in runs, those first that are the most likely to see a fault.

    These are the quickest of all, and then those of files of which the largest part comes to the
    statement, in little time. Of a file with many tests only its quickest come so early.

    :param of_files: the number of tests of each file.
    """
    quickest = sorted(tests, key=lambda each: each.took_s)
    yield sorted(quickest[:FEW])
    reaching = collections.Counter(each.file for each in tests)
    parts: DefaultDict[Tuple[str, int], List[Reach]] = collections.defaultdict(list)
    seen: Dict[str, int] = collections.Counter()
    for each in quickest[FEW:]:
        parts[each.file, seen[each.file] // FEW].append(each)
        seen[each.file] += 1

    def rank(part: Tuple[str, int]) -> Tuple[int, float]:
        file, number = part
        share = reaching[file] / of_files[file]
        return number, -share / (START_S + _took_s(parts[part]))

    run: List[Reach] = []
    least_s = RUN_S
    for part in sorted(parts, key=rank):
        run += parts[part]
        if _took_s(run) > least_s:
            yield sorted(run)
            run, least_s = [], 2 * least_s
    if run:
        yield sorted(run)


def _took_s(tests: Sequence[Reach]) -> float:
    return sum(each.took_s for each in tests)


def _up_to(last: str, tests: List[Reach]) -> List[Reach]:
    """Return the tests that ran before one, and that one; all of them where it is none of them."""
    named = [each.test for each in tests]
    return tests[: named.index(last) + 1] if last in named else tests


def _without(test: str, tests: List[Reach]) -> List[Reach]:
    """Return the tests without one, or without its file; none of them where it is none of them."""
    rest = [each for each in tests if each.test not in (test, test.split('::')[0])]
    return rest if len(rest) < len(tests) else []


def _verdict_of(copy: Copy, module: Path, tests: Sequence[Reach]) -> Tuple[str, str, float]:
    """Return whether tests kill the mutant that is in, which one did, and how long they took.

    What fails once and then passes has failed for another reason.
    """
    limit_s = SPARE_S + SLOWER * _took_s(tests)
    named = [each.test for each in tests]
    took_s, failed = 0.0, 0
    for _ in range(ATTEMPTS):
        ending = copy.run_changed(module, named, limit_s)
        took_s += ending.took_s
        if ending.is_hung:
            return 'hung', ending.by, took_s
        failed += not ending.is_fine
        if failed == 2:
            return 'killed', ending.by, took_s
        if ending.is_fine and not failed:
            break
    return '', '', took_s
