"""One border: what may come over it, and what takes that or refuses it."""

import collections
import contextlib
import functools
import signal
from typing import Any, Callable, Counter, Iterator, NamedTuple, Tuple
from unittest import mock

from hypothesis import HealthCheck, Phase, control, given, settings
from hypothesis.internal.reflection import get_pretty_function_description
from hypothesis.strategies import SearchStrategy

LONGEST_S = 60.0  # of one example: what takes so long hangs
# Hypothesis describes a strategy at each draw, for an example that fails. That took a quarter of
# the time
DESCRIBED = functools.lru_cache(maxsize=10000)(get_pretty_function_description)
TAKEN, REFUSED = BOTH = 'taken', 'refused'


class Hangs(BaseException):
    """An example has not ended; no Exception, which a border may catch."""


class Border(NamedTuple):
    """`take` returns TAKEN or REFUSED; it asserts that a refusal says what was wrong.

    `ends`: which of them some of the examples must come to.
    """

    name: str
    given: 'SearchStrategy[Any]'
    take: Callable[[Any], str]
    ends: Tuple[str, ...] = BOTH


def refused(text: object, *named: str) -> str:
    """Note that something was refused, with a text that names what was wrong."""
    words = str(text)
    assert words.strip(), 'refused without a reason'
    assert all(each in words for each in named), (words, named)
    return REFUSED


def try_border(border: Border, examples: int, is_random: bool = False) -> Counter[str]:
    """Draw that many examples; return how many were taken and refused.

    :raises Exception: what came past the border, or `Hangs`.
    """
    ends: Counter[str] = collections.Counter()

    @settings(
        max_examples=examples,
        deadline=None,
        derandomize=not is_random,
        database=None,
        suppress_health_check=list(HealthCheck),
        print_blob=False,
        report_multiple_bugs=False,
        phases=[Phase.explicit, Phase.generate, Phase.shrink],
    )
    @given(border.given)
    def each(drawn: Any) -> None:
        with in_time():
            end = border.take(drawn)
        assert end in (TAKEN, REFUSED)
        ends[end] += 1

    with mock.patch.object(control, 'get_pretty_function_description', DESCRIBED, create=True):
        each()
    return ends


@contextlib.contextmanager
def in_time() -> Iterator[None]:
    """Raise Hangs in the main thread where the body does not end."""

    def on_alarm(*_: object) -> None:
        raise Hangs('not done within {:g} s'.format(LONGEST_S))

    before = signal.signal(signal.SIGALRM, on_alarm)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
