"""Executions of states whose time is watched, as the machines see them that run inside."""

import contextlib
import contextvars
import threading
from time import monotonic
from typing import Any, Iterable, Iterator, Set, Tuple

from .engine_probe import EngineProbe

# asked for again at once, where it cannot have been long
_LEAST_S = 0.05


class LimitedRun:
    """One execution of a state that has a time limit, or is asked about when it takes long.

    Its time stands still while a person is asked about something inside. Once it is abandoned, the
    machines inside stop at their next state boundary. Safe to use from several threads.
    """

    def __init__(self) -> None:
        self.abandoned = False
        self._inside: Set[EngineProbe] = set()
        self._lock = threading.Lock()
        self._questions = 0  # open now
        self._since_s = 0.0
        self._stood_s = 0.0

    def hold(self, engine: EngineProbe) -> None:
        """Be told of a machine that executes inside: it looks closely once this is abandoned."""
        with self._lock:
            self._inside.add(engine)
            engine.attentive = engine.attentive or self.abandoned

    def abandon(self) -> None:
        """Let the machines inside look whether they are to stop."""
        with self._lock:
            self.abandoned = True
            for engine in self._inside:
                engine.attentive = True

    @contextlib.contextmanager
    def stands_still(self) -> Iterator[None]:
        """Let its time stand still. Several may do so at once."""
        with self._lock:
            self._note()
            self._questions += 1
        try:
            yield
        finally:
            with self._lock:
                self._note()
                self._questions -= 1

    def take_stood_s(self) -> float:
        """Return for how many seconds its time has stood still since this was last asked.

        It is 0.0 where it has not, and never while it stands.
        """
        with self._lock:
            self._note()
            stood_s, self._stood_s = self._stood_s, 0.0
            return max(stood_s, _LEAST_S) if self._questions else stood_s

    def _note(self) -> None:
        now_s = monotonic()
        if self._questions:
            self._stood_s += now_s - self._since_s
        self._since_s = now_s

    def __reduce__(self) -> Tuple[Any, ...]:
        """An execution does not travel with a copied or pickled machine."""
        return LimitedRun, ()


class WatchedRun(LimitedRun):
    """One execution of a state without a time limit, which is asked about when it takes long."""


_AROUND: 'contextvars.ContextVar[Tuple[LimitedRun, ...]]' = contextvars.ContextVar(
    'smach_oracle_limited_runs', default=()
)


def runs_of_thread() -> Tuple[LimitedRun, ...]:
    """Return the executions inside which this thread runs, the innermost last."""
    return _AROUND.get()


def enter(run: LimitedRun) -> None:
    """Be inside `run` from now on. It is to be called in a context of its own."""
    _AROUND.set(_AROUND.get() + (run,))


@contextlib.contextmanager
def inside(run: LimitedRun) -> Iterator[None]:
    """Be inside `run` within it, in the caller's own thread."""
    token = _AROUND.set(_AROUND.get() + (run,))
    try:
        yield
    finally:
        _AROUND.reset(token)


@contextlib.contextmanager
def standing_still(runs: Iterable[LimitedRun]) -> Iterator[None]:
    """Let the time of several executions stand still."""
    with contextlib.ExitStack() as stack:
        for run in runs:
            stack.enter_context(run.stands_still())
        yield
