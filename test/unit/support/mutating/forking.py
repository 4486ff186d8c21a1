"""A plugin for pytest: it collects the tests once, and runs those that it is asked for in a child
that is forked each time, with the change of a module that lies on the disk then.

The one that asks listens on the socket of $ASKED_BY. A line of JSON has the `module` that has
changed, the `tests`, and `limit_s`, the time they have. The answer is a line, too. `is_taken` is
false where the change is in what has run already, as the tests were collected, or where a test has
another name. `is_fine`, `is_hung` and `by`, the test that has failed, follow where it is true.
"""

import contextlib
import ctypes
import functools
import gc
import itertools
import json
import os
import select
import signal
import socket
import sys
import tempfile
import time
from types import CodeType, FrameType, FunctionType
from typing import Any, Dict, Iterator, List, Sequence, Set, Tuple

import pytest

ASKED_BY = 'MUTANTS_ASKED_BY'
PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
FUNCTION = 0x2  # CO_NEWLOCALS of `inspect`: the code of a class has none
FINE = b'fine\n'
GRACE_S = 5.0  # in which a child removes its files

Change = Tuple[CodeType, CodeType]  # of a function, before and after

HERE = os.getcwd()
has_run: Set[CodeType] = set()  # as the tests were collected


class ChangeRan(Exception):
    """Code differs that has run already."""


def _note(frame: FrameType, event: str, _: object) -> None:
    if event == 'call' and frame.f_code.co_filename.startswith(HERE):
        has_run.add(frame.f_code)


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests() -> None:
    """Note what runs from now on: conftest.py is imported next. Who only imports this is spared."""
    sys.setprofile(_note)


def pytest_collection_finish(session: pytest.Session) -> None:
    """All is imported."""
    sys.setprofile(None)


def pytest_runtestloop(session: pytest.Session) -> bool:
    """Answer until nobody asks any more."""
    if session.testsfailed:
        raise session.Interrupted('a file of tests was not collected')
    forks = Forks(session)  # who is connected may change a file
    with socket.socket(socket.AF_UNIX) as asking:
        asking.connect(os.environ[ASKED_BY])
        with asking.makefile('rw') as lines:
            for line in lines:
                print(json.dumps(forks.answer(**json.loads(line))), file=lines, flush=True)
    return True


class Forks:
    """The tests, and the functions of the modules as they were imported."""

    def __init__(self, session: pytest.Session) -> None:
        self._session = session
        self._tests: Dict[str, List[pytest.Item]] = {}  # by name, and by file
        for each in session.items:
            self._tests[each.nodeid] = [each]
            self._tests.setdefault(each.nodeid.split('::')[0], []).append(each)
        self._codes: Dict[str, CodeType] = {}
        for path in {getattr(each, '__file__', None) for each in list(sys.modules.values())}:
            if path and path.endswith('.py') and path.startswith(HERE):
                with open(path, encoding='utf-8') as file:
                    self._codes[path] = compile(file.read(), path, 'exec')
        found = gc.get_objects()
        self._caches = [each for each in found if isinstance(each, functools._lru_cache_wrapper)]
        self._functions: Dict[CodeType, List[FunctionType]] = {}
        for each in found:
            if isinstance(each, FunctionType) and each.__code__.co_filename in self._codes:
                self._functions.setdefault(each.__code__, []).append(each)
        gc.freeze()  # a child finds new objects alone
        # whatever a child leaves is this process's child then
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)

    def answer(self, module: str, tests: Sequence[str], limit_s: float) -> Dict[str, Any]:
        """Run tests with the change that is on the disk."""
        try:
            changes = self._changes(module)
            named = itertools.chain.from_iterable(self._tests[name] for name in tests)
            chosen = list(dict.fromkeys(named))
        except (ChangeRan, KeyError):
            return {'is_taken': False}
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            os.close(reading)
            self._run_in_child(chosen, changes, writing)
        os.close(writing)
        try:
            in_time = bool(select.select([reading], [], [], limit_s)[0])
            told = os.read(reading, 1 << 16) if in_time else b''
        finally:
            os.close(reading)
            _end(child, in_time)
        return {
            'is_taken': True,
            'is_fine': told == FINE,
            'is_hung': not in_time,
            'by': '' if told == FINE else told.decode(),
        }

    def _run_in_child(self, tests: List[pytest.Item], changes: List[Change], writing: int) -> None:
        """Run tests, and end the process."""
        child = 0
        try:
            os.setsid()
            child = os.getpid()
            told = self._failed(tests, changes) or FINE
            if os.getpid() == child:  # else a test has forked, and its child came here
                os.write(writing, told)
        finally:
            try:
                if os.getpid() == child:
                    _remove_folders()
            finally:
                os._exit(0)

    def _failed(self, tests: List[pytest.Item], changes: List[Change]) -> bytes:
        """Change the functions, and return the name of the first test that fails."""
        nowhere = os.open(os.devnull, os.O_RDWR)
        for number in (1, 2):
            os.dup2(nowhere, number)
        for before, after in changes:
            for function in self._functions.get(before, ()):
                function.__code__ = after
        for cache in self._caches:
            cache.cache_clear()
        for test, following in zip(tests, [*tests[1:], None]):
            test.ihook.pytest_runtest_protocol(item=test, nextitem=following)
            if self._session.testsfailed:
                with contextlib.suppress(Exception):  # of plugins, which have done theirs already
                    # what the others would have shared is torn down
                    test.ihook.pytest_runtest_teardown(item=test, nextitem=None)
                return test.nodeid.encode()
        return b''

    def _changes(self, module: str) -> List[Change]:
        """:raises ChangeRan: where the change is in what has run already."""
        if module not in self._codes:
            raise ChangeRan
        with open(module, encoding='utf-8') as file:
            return list(_in_imported(self._codes[module], compile(file.read(), module, 'exec')))


def _in_imported(before: CodeType, after: CodeType) -> Iterator[Change]:
    """Yield the functions of a module or of a class in it."""
    if _done_by(before) != _done_by(after):
        raise ChangeRan
    for one, other in zip(_codes_in(before), _codes_in(after)):
        if not one.co_flags & FUNCTION:
            yield from _in_imported(one, other)
        elif not (one in has_run and _is_changed(one, other)):
            yield from _in_function(one, other)
        else:
            raise ChangeRan


def _in_function(before: CodeType, after: CodeType) -> Iterator[Change]:
    """Yield a function, and those in it, of which some may live already."""
    if before.co_freevars != after.co_freevars:  # it needs another closure
        raise ChangeRan
    yield before, after
    for one, other in zip(_codes_in(before), _codes_in(after)):
        if one.co_name == other.co_name and one.co_freevars == other.co_freevars:
            yield from _in_function(one, other)


def _is_changed(before: CodeType, after: CodeType) -> bool:
    """Whether a function does something else, or one in it."""
    inner = list(zip(_codes_in(before), _codes_in(after)))
    return _done_by(before) != _done_by(after) or any(itertools.starmap(_is_changed, inner))


def _codes_in(code: CodeType) -> List[CodeType]:
    return [each for each in code.co_consts if isinstance(each, CodeType)]


def _done_by(code: CodeType) -> Tuple[Any, ...]:
    """Return what code does, whatever its functions do and the numbers of its lines are."""
    constants = [each.co_name if isinstance(each, CodeType) else each for each in code.co_consts]
    return (
        code.co_code,
        code.co_names,
        code.co_varnames,
        code.co_freevars,
        list(map(repr, constants)),
    )


def _remove_folders() -> None:
    """Remove what the tests of a child keep until their process ends."""
    for each in gc.get_objects():
        if issubclass(type(each), tempfile.TemporaryDirectory):
            each.cleanup()


def _end(child: int, in_time: bool) -> None:
    """Let a child end, and kill what is left then, and what that leaves, until none is left."""
    if not in_time:
        os.kill(child, signal.SIGINT)
    deadline_s = time.monotonic() + GRACE_S
    while time.monotonic() < deadline_s and os.waitpid(child, os.WNOHANG) == (0, 0):
        time.sleep(0.005)  # the system has no wait for a child with a limit
    children = '/proc/self/task/{}/children'.format(os.getpid())
    while True:
        with open(children, encoding='ascii') as file:
            for pid in file.read().split():
                os.kill(int(pid), signal.SIGKILL)
        try:
            os.waitpid(-1, 0)
        except ChildProcessError:
            return
