"""Visits of states, and how each counts. Pure, and without smach."""

from enum import IntEnum
from typing import NamedTuple


class VisitResult(IntEnum):
    """The result as which a visit counts. The numbers are those of VisitedState.msg."""

    SUCCESS = 1
    FAILURE = 2
    SUPERSEDED = 3
    PREEMPTED = 4


class Visit(NamedTuple):
    """One visit of a state that has ended."""

    state: str
    outcome: str  # '' where it raised or ran over its time limit
    result: VisitResult
