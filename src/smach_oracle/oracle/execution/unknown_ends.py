"""Says which ends of a machine have names that tell neither success nor failure."""

from typing import Iterable, Set, Tuple

import smach

from ..settings.failure_rule import FailureRule

UNKNOWN_ENDS = (
    '{}: nothing says whether an end in {} is a success or a failure. Statistics count it as '
    '"other end". To settle it, list all failing ends in failing_outcomes, or choose a name that '
    'says it, such as {}_succeeded'
)
_MOST_TOLD = 1000  # machines. A program may make up machines without end
_told: Set[Tuple[str, Tuple[str, ...]]] = set()


def tell_unknown_ends(name: str, ends: Iterable[object], rule: FailureRule) -> None:
    """Name the ends of a top machine whose meaning is not known, once in a process."""
    unknown = rule.unknown(ends)
    if not unknown or (name, unknown) in _told or len(_told) >= _MOST_TOLD:
        return
    _told.add((name, unknown))
    smach.loginfo(UNKNOWN_ENDS.format(name, ' or '.join(unknown), unknown[0]))
