"""A plugin for pytest: it collects the tests once, and runs those that it is asked for in a child
that is forked each time, with the change of a module that lies on the disk then.

Who asks listens on the socket of $ASKED_BY. A line of JSON has the `module` that has changed, the
`tests`, and `limit_s`, the time they have. The answer is a line, too: `is_taken`, false where the
change is in what runs as the module is imported, or a test has another name; then `is_fine`,
`is_hung`, and `by`, the test that has failed.
"""

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
from types import CodeType, FunctionType
from typing import Any, Dict, Iterator, List, Sequence, Tuple

import pytest

ASKED_BY = 'MUTANTS_ASKED_BY'
PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
FUNCTION = 0x2  # CO_NEWLOCALS of `inspect`: the code of a class has none
FINE = b'fine\n'

Change = Tuple[CodeType, CodeType]  # of a function, before and after


class ImportedChange(Exception):
    """Code differs that has run already, as its module was imported."""


def pytest_runtestloop(session: pytest.Session) -> bool:
    """Answer until nobody asks any more."""
    with socket.socket(socket.AF_UNIX) as asking:
        asking.connect(os.environ[ASKED_BY])
        forks = Forks(session)
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
            if path and path.endswith('.py') and path.startswith(os.getcwd()):
                with open(path, encoding='utf-8') as file:
                    self._codes[path] = compile(file.read(), path, 'exec')
        found = gc.get_objects()
        self._caches = [each for each in found if isinstance(each, functools._lru_cache_wrapper)]
        self._functions: Dict[CodeType, List[FunctionType]] = {}
        for each in found:
            if isinstance(each, FunctionType) and each.__code__.co_filename in self._codes:
                self._functions.setdefault(each.__code__, []).append(each)
        # whatever a child leaves is this process's child then
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)

    def answer(self, module: str, tests: Sequence[str], limit_s: float) -> Dict[str, Any]:
        """Run tests with the change that is on the disk."""
        try:
            changes = self._changes(module)
            chosen = list(itertools.chain.from_iterable(self._tests[name] for name in tests))
        except (ImportedChange, KeyError):
            return {'is_taken': False}
        reading, writing = os.pipe()
        if not os.fork():
            try:
                os.setsid()
                os.close(reading)
                os.write(writing, self._failed(chosen, changes) or FINE)
            finally:
                os._exit(0)
        os.close(writing)
        try:
            in_time = bool(select.select([reading], [], [], limit_s)[0])
            told = os.read(reading, 1 << 16) if in_time else b''
        finally:
            os.close(reading)
            _kill_children()
        return {
            'is_taken': True,
            'is_fine': told == FINE,
            'is_hung': not in_time,
            'by': '' if told == FINE else told.decode(),
        }

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
                return test.nodeid.encode()
        return b''

    def _changes(self, module: str) -> List[Change]:
        """:raises ImportedChange: where more differs than what functions do."""
        if module not in self._codes:
            raise ImportedChange
        with open(module, encoding='utf-8') as file:
            return list(_in_imported(self._codes[module], compile(file.read(), module, 'exec')))


def _in_imported(before: CodeType, after: CodeType) -> Iterator[Change]:
    """Yield the functions of a module or of a class in it."""
    if _done_by(before) != _done_by(after):
        raise ImportedChange
    for one, other in zip(_codes_in(before), _codes_in(after)):
        if not one.co_flags & FUNCTION:
            yield from _in_imported(one, other)
        elif one.co_freevars == other.co_freevars:
            yield from _in_function(one, other)
        else:  # it needs another closure, as where it calls super() no more
            raise ImportedChange


def _in_function(before: CodeType, after: CodeType) -> Iterator[Change]:
    """Yield a function, and those in it, which may live already: what a decorator has made."""
    yield before, after
    for one, other in zip(_codes_in(before), _codes_in(after)):
        if one.co_name == other.co_name and one.co_freevars == other.co_freevars:
            yield from _in_function(one, other)


def _codes_in(code: CodeType) -> List[CodeType]:
    return [each for each in code.co_consts if isinstance(each, CodeType)]


def _done_by(code: CodeType) -> Tuple[Any, ...]:
    """Return what code does, whatever its functions do and the numbers of its lines are."""
    constants = [each.co_name if isinstance(each, CodeType) else each for each in code.co_consts]
    return code.co_code, code.co_names, list(map(repr, constants))


def _kill_children() -> None:
    """Kill the children, and what they leave, until none is left."""
    children = '/proc/self/task/{}/children'.format(os.getpid())
    while True:
        with open(children, encoding='ascii') as file:
            for pid in file.read().split():
                os.kill(int(pid), signal.SIGKILL)
        try:
            os.waitpid(-1, 0)
        except ChildProcessError:
            return
