"""Room on Python's stack for machines that lie in each other.

Each container takes a few frames while it executes. Where none are left, Python raises a
RecursionError in the innermost one. That is no failure of any state: no oracle around it could do
better, and each of them would try.
"""

import inspect
import sys
from typing import Iterator, Optional

import smach

from ..errors import TooDeepError
from ..machine.nesting import children_of

NEEDED_FRAMES = 150  # for a recovery, with whoever is asked, logs or records it
_FRAMES_OF_CONTAINER = 10  # at most, what is in a state not counted


def too_deep_below(error: BaseException) -> Optional[TooDeepError]:
    """Return the error that says that the stack was full further below, None where it was not."""
    return next((each for each in _chain(error) if isinstance(each, TooDeepError)), None)


def too_deep_here(top: smach.Container, name: str, error: BaseException) -> Optional[TooDeepError]:
    """Return what says that an error in a machine comes from a full stack, None where not.

    A state whose own functions call each other without end has failed as by any other error.

    `top`, `name`: the top machine around it, and its name.
    """
    if sys.getrecursionlimit() - _frames_in_use() >= NEEDED_FRAMES:
        return None
    if not any(isinstance(each, RecursionError) for each in _chain(error)):
        return None
    limit, depth = sys.getrecursionlimit(), _depth_of(top)
    wanted = limit + _FRAMES_OF_CONTAINER * depth
    return TooDeepError(
        '{}: {} containers lie in each other, and the stack of Python, which has {} frames, is '
        'full. Call sys.setrecursionlimit({}) before the machine runs'.format(
            name, depth, limit, -(-wanted // 1000) * 1000
        )
    )


def _chain(error: BaseException) -> Iterator[BaseException]:
    """Yield an error, and those that it was raised from."""
    current: Optional[BaseException] = error
    seen = set()
    while current is not None and id(current) not in seen:
        seen.add(id(current))
        yield current
        current = current.__cause__ or current.__context__


def _frames_in_use() -> int:
    count, frame = -1, inspect.currentframe()
    while frame is not None:
        count, frame = count + 1, frame.f_back
    return count


def _depth_of(container: object) -> int:
    """Return how many containers lie in each other, that one among them."""
    depth, level = 0, [container]
    while level:
        depth += 1
        level = [
            state
            for each in level
            for state in children_of(each).values()
            if isinstance(state, smach.Container)
        ]
    return depth
