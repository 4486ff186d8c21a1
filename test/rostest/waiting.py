"""Waiting for what another process or thread will bring about."""
import time
from typing import Any, Callable


def wait_for(condition: Callable[[], Any], limit_s: float = 40.0) -> Any:
    """Poll until the condition holds, at most so many seconds; its last value."""
    until = time.monotonic() + limit_s
    while time.monotonic() < until:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    return condition()


def least_of(measure: Callable[[], float], enough: float, most: int = 6) -> float:
    """The least of so many measurements, or of as many as it takes to come below `enough`: a machine that is busy with
    others makes a delay longer, and never shorter."""
    values = [measure()]
    while values[-1] >= enough and len(values) < most:
        values.append(measure())
    return min(values)
