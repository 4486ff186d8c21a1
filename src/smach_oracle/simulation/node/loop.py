"""The one thread that owns the physics: it does jobs, moves the robot, and keeps the time."""

import queue
import threading
import time
from concurrent.futures import Future, wait
from typing import Callable, Dict, Optional, TypeVar

from ..physics.passing import pass_time
from ..physics.world import World
from .motion_table import MotionTable
from .settings import WorldSettings
from .sim_clock import SimClock

PERIOD_S = 1.0 / 60.0  # of simulated time, that a control period takes
IDLE_TICK_S = 0.05  # wall time between two looks while nothing happens
LATE_S = 0.25  # wall time behind which a paced world no longer tries to catch up
T = TypeVar('T')


class WorldStopped(Exception):
    """The world has shut down and does no more jobs."""


class Stopwatch:
    """Wall time and processor time (s) of one thread, by what they went into."""

    def __init__(self) -> None:
        self.spent: Dict[str, float] = {}  # wall s
        self.used: Dict[str, float] = {}  # processor s
        self._since, self._used_since = time.monotonic(), time.thread_time()

    def add_time(self, what: str) -> None:
        """The time since the last call went into `what`."""
        now, used = time.monotonic(), time.thread_time()
        self.spent[what] = self.spent.get(what, 0.0) + now - self._since
        self.used[what] = self.used.get(what, 0.0) + used - self._used_since
        self._since, self._used_since = now, used

    def restart(self) -> None:
        """Begin again, in the thread whose time it takes."""
        self.spent, self.used = {}, {}
        self._since, self._used_since = time.monotonic(), time.thread_time()


class WorldLoop:
    """Steps the world, and does jobs between two control periods, all in one thread.

    :param after_tick: called after each control period. It publishes what is due.
    """

    def __init__(
        self,
        motions: MotionTable,
        clock: SimClock,
        settings: WorldSettings,
        after_tick: Callable[[], None],
    ) -> None:
        self._motions = motions
        self._clock = clock
        self._settings = settings
        self._after_tick = after_tick
        self._jobs: 'queue.Queue[Callable[[], None]]' = queue.Queue()
        self._stopping = threading.Event()
        self._thread: Optional[threading.Thread] = None
        self._busy_until = time.monotonic()
        self.watch = Stopwatch()

    def call(self, function: Callable[[], T]) -> T:
        """Call a function in the world's thread and return what it returns.

        :raises WorldStopped: where the world shuts down first. What `function` raises is raised
            here.
        """
        result: 'Future[T]' = Future()
        self._jobs.put(lambda: _fulfil(result, function))
        while not result.done():
            if self._stopping.is_set():
                raise WorldStopped('the world is shutting down')
            wait([result], timeout=0.1)
        return result.result()

    def post(self, job: Callable[[], None]) -> None:
        """Have the world's thread call `job` soon, and return at once."""
        self._jobs.put(job)

    def pass_time(self, seconds: float) -> None:
        """Let motions and physics go on for so long at once, for the world's own thread."""
        for _ in range(round(seconds / PERIOD_S)):
            self._clock.advance(PERIOD_S, self._motions.tick())

    def pass_by(self, world: World, seconds: float) -> None:
        """Let time pass in the world that the motions move, for the world's own thread.

        What is due is published on the way. In a world that runs at a pace it does nothing.
        """
        if self._settings.lock_step:
            pass_time(
                world,
                round(seconds / PERIOD_S),
                self._tick,
                lambda periods: self._clock.skip(periods * PERIOD_S),
                lambda: bool(self._motions),
            )

    def run(self, closed: Callable[[], None]) -> None:
        """Run until stop(). What a motion or a job raises ends it.

        :param closed: called at the end, in this thread.
        """
        self._thread = threading.current_thread()
        self.watch.restart()
        try:
            if self._settings.lock_step:
                self._run_in_lock_step()
            else:
                self._run_paced()
        finally:
            self._stopping.set()
            closed()

    def stop(self, limit_s: float) -> None:
        """End it, and wait at most `limit_s` for its last jobs."""
        self._stopping.set()
        self._jobs.put(lambda: None)
        if self._thread and self._thread is not threading.current_thread():
            self._thread.join(limit_s)

    def _run_in_lock_step(self) -> None:
        while not self._stopping.is_set():
            if self._motions:
                self._run_jobs()
                self._tick()
                self._busy_until = time.monotonic()
            elif self._job_within(IDLE_TICK_S):
                self._busy_until = time.monotonic()
            elif time.monotonic() - self._busy_until > self._settings.idle_grace:
                # nothing moves, and those who sleep in simulated time wake up
                self._clock.pause(IDLE_TICK_S * self._settings.idle_speed)
            self.watch.add_time('idle')

    def _run_paced(self) -> None:
        due = time.monotonic()
        while not self._stopping.is_set():
            due = max(due + PERIOD_S / self._settings.real_time_factor, time.monotonic() - LATE_S)
            self._tick()
            while not self._stopping.is_set() and time.monotonic() < due:
                self._job_within(due - time.monotonic())
            self._run_jobs()
            self.watch.add_time('idle')

    def _tick(self) -> None:
        self.watch.add_time('idle')
        moved = self._motions.tick()
        self._clock.advance(PERIOD_S, moved)
        self.watch.add_time('physics')
        self._after_tick()
        self.watch.add_time('publish')

    def _run_jobs(self) -> None:
        while not self._stopping.is_set() and self._job_within(0.0):
            pass

    def _job_within(self, timeout_s: float) -> bool:
        """Do one job that is there within the time. Return whether there was one."""
        try:
            job = self._jobs.get(block=timeout_s > 0, timeout=max(timeout_s, 1e-4))
        except queue.Empty:
            return False
        self.watch.add_time('idle')
        job()
        self.watch.add_time('jobs')
        return True


def _fulfil(result: 'Future[T]', function: Callable[[], T]) -> None:
    try:
        result.set_result(function())
    except Exception as err:  # raised again where the result is waited for
        result.set_exception(err)
