"""Waiting for what another process or thread will bring about."""
import time
from typing import Any, Callable, List, Tuple

_BELIEVED_S = 0.15  # with it, a joystick whose release is lost is not in time: it stops after 0.3 s of silence


def wait_for(condition: Callable[[], Any], limit_s: float = 40.0) -> Any:
    """Poll until the condition holds, at most so many seconds; its last value."""
    until = time.monotonic() + limit_s
    while time.monotonic() < until:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    return condition()


def assert_soon(measure: Callable[[], Tuple[float, float]], within_s: float, worst_s: float = 2.0) -> None:
    """Most of five delays must be in time, and not one may be beyond `worst_s`; ends when that is settled.

    `measure` tells a delay, and how much of it a busy machine may have added, of which little is believed: it makes one
    of them long now and then, while what mostly fails to happen is found.
    """
    delays: List[Tuple[float, float]] = []
    in_time = 0
    while in_time < 3 and len(delays) - in_time < 3:
        delay_s, added_s = measure()
        delays.append((round(delay_s, 3), round(added_s, 3)))
        assert delay_s < worst_s, '{} s: each must be below {:g} s'.format(delays, worst_s)
        in_time += delay_s - min(added_s, _BELIEVED_S) < within_s
    assert in_time == 3, '{} s: most must be below {:g} s'.format(delays, within_s)
