"""Results of the ways that were gone on from failures. Pure, and without smach.

A way *helped* if the next result of the failed state in this trial is a success. It did not if the
state fails again in any kind, or if the trial ends in failure first. Nobody knows after a preempt,
a shutdown or the act of a person.
"""

import re
from typing import NamedTuple, Optional

from .events import FailureKind
from .short_text import shortened

FIRST, LATER, BY_PERSON = 0, 1, 2  # the places of a way

_LONGEST = 120
_LONGEST_READ = 2000
_NUMBER = re.compile(r'(?:(?<!\w)[-+])?(?:0x[0-9a-f]+|\d+(?:\.\d+)?(?:e[-+]?\d+)?)', re.IGNORECASE)


class WayResult(NamedTuple):
    """The result of one way from a failure of one state.

    `way`: its key. `kind`: the value of its WayKind. `place`: 0 for the first way of its streak, 1
    for a later one, 2 for the choice of a person. `failure`: the kind of failure, a
    `failure_text_key`. `helped`: None is not known. `minutes`: from the failure on, until the
    state had its next result, or until it was clear that nobody knows.
    """

    way: str
    kind: str
    place: int
    failure: str
    helped: Optional[bool]
    minutes: float


def failure_text_key(kind: int, outcome: str, text: str) -> str:
    """Return the name of a kind of failure: its FailureKind, its outcome, and its text.

    A text with other numbers in it is the same. A long one lacks its middle.

    >>> failure_text_key(1, 'aborted', 'no object within 0.25 m (try 3)')
    'failing_outcome aborted: no object within # m (try #)'
    """
    names = {int(each): each.name.lower() for each in FailureKind}
    words = [names.get(kind, str(kind)), outcome]
    plain = ' '.join(_NUMBER.sub('#', shortened(text, _LONGEST_READ)).split())
    return shortened(': '.join(filter(None, (' '.join(filter(None, words)), plain))), _LONGEST)
