"""Executions of states whose time is watched, as the machines see them that run inside."""

import contextlib
import contextvars
import threading
from typing import Any, ContextManager, Iterable, Iterator, Optional, Set, Tuple

from ..scope.clock import Clock, PausableClock, paused
from ..scope.reason import Reason
from ..scope.scope import Scope
from ..smach_private import EngineProbe


class LimitedRun(Scope):
    """One execution of a state that has a time limit, or is asked about when it takes long.

    Its time is paused while a person is asked about something inside. Once it is abandoned, the
    machines inside stop at their next state boundary. Safe to use from several threads.
    """

    def __init__(self, clock: Optional[Clock] = None) -> None:
        super().__init__(clock=clock)
        self.time = PausableClock(self.clock)
        self._inside: Set[EngineProbe] = set()
        self._lock = threading.Lock()

    def hold(self, engine: EngineProbe) -> None:
        """Be told of a machine that executes inside: it looks closely once this is abandoned."""
        with self._lock:
            self._inside.add(engine)
            engine.attentive = engine.attentive or self.told is not None

    def abandon(self) -> None:
        """Let the machines inside look whether they are to stop."""
        self.cancel(Reason.LEFT_BEHIND)
        with self._lock:
            for engine in self._inside:
                engine.attentive = True

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


@contextlib.contextmanager
def inside(run: LimitedRun) -> Iterator[None]:
    """Be inside `run` within it, in the caller's own thread."""
    token = _AROUND.set(_AROUND.get() + (run,))
    try:
        yield
    finally:
        _AROUND.reset(token)


def standing_still(runs: Iterable[LimitedRun]) -> ContextManager[None]:
    """Let the time of several executions stand still."""
    return paused(run.time for run in runs)
