"""Waiting for what another process or thread will bring about."""

import asyncio
import sys
import threading
import time
from pathlib import Path
from typing import Any, Callable, List, Optional, Tuple

# with it, a joystick whose release is lost is not in time: it stops after 0.3 s of silence
_BELIEVED_S = 0.15
# for a program that meets SIGINT or SIGTERM: two seconds are promised, the third is for ending a
# process at all
END_LIMIT_S = 2.0 + 1.0


def wait_for(condition: Callable[[], Any], limit_s: float = 40.0, every_s: float = 0.02) -> Any:
    """Poll until the condition holds, at most so many seconds; its last value."""
    until = time.monotonic() + limit_s
    while time.monotonic() < until:
        value = condition()
        if value:
            return value
        time.sleep(every_s)
    return condition()


async def wait_in_loop(condition: Callable[[], Any], limit_s: float = 40.0) -> Any:
    """As `wait_for`, in a coroutine whose event loop is to go on meanwhile."""
    until = time.monotonic() + limit_s
    while not condition() and time.monotonic() < until:
        await asyncio.sleep(0.01)
    return condition()


def stays(condition: Callable[[], Any], for_s: float) -> bool:
    """Whether the condition holds for so many seconds; returns as soon as it does not.

    For something that must not happen: there is nothing to await.
    """
    until = time.monotonic() + for_s
    while condition():
        if time.monotonic() >= until:
            return True
        time.sleep(0.01)
    return False


class Once(threading.Thread):
    """Calls `then` in a thread of its own once the condition holds. Join it.

    If the condition never holds, it calls `then` anyway, so that nothing hangs, and `join`
    fails.
    """

    def __init__(self, condition: Callable[[], Any], then: Callable[[], Any]) -> None:
        threading.Thread.__init__(self, daemon=True)
        self._condition, self._then = condition, then
        self._held = False
        self.start()

    def run(self) -> None:
        self._held = bool(wait_for(self._condition))
        self._then()

    def join(self, timeout: Optional[float] = None) -> None:
        threading.Thread.join(self, timeout)
        assert self._held, 'it was waited for in vain'


def waits(thread: threading.Thread) -> bool:
    """Whether a thread of this process waits for an event, a condition or a lock of `threading`."""
    frame = sys._current_frames().get(thread.ident or 0)
    return frame is not None and frame.f_code.co_filename == threading.__file__


def asleep(pid: int) -> bool:
    """Whether the main thread of a process waits for something, as the system sees it."""
    stat = Path('/proc', str(pid), 'stat').read_text(encoding='utf-8', errors='replace')
    return stat.rpartition(')')[2].split()[0] == 'S'


def assert_soon(
    measure: Callable[[], Tuple[float, float]], within_s: float, worst_s: float = 2.0
) -> None:
    """Most of five delays must be in time, and not one may be beyond `worst_s`; ends when that is
    settled.

    `measure` tells a delay, and how much of it a busy machine may have added, of which little is
    believed: it makes one of them long now and then, while what mostly fails to happen is found.
    """
    delays: List[Tuple[float, float]] = []
    in_time = 0
    while in_time < 3 and len(delays) - in_time < 3:
        delay_s, added_s = measure()
        delays.append((round(delay_s, 3), round(added_s, 3)))
        assert delay_s < worst_s, '{} s: each must be below {:g} s'.format(delays, worst_s)
        in_time += delay_s - min(added_s, _BELIEVED_S) < within_s
    assert in_time == 3, '{} s: most must be below {:g} s'.format(delays, within_s)
