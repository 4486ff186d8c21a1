"""Visits of states, how each counts, and which states a trial has begun. Pure, without smach."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Dict, List, NamedTuple, Tuple


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


@dataclass(eq=False)
class VisitMark:
    """The marks of one state in one trial.

    `reached`: number of its latest visit, over the whole tree. 0 means none. `executed`: number of
    the latest visit in which it was executed, and not held back. 0 means none. `done`: whether it
    was executed, by a visit or as a precondition. `spent`: whether the oracle has left for a place
    from which the machine may come here again: if it is guarded, it is not executed then.
    """

    reached: int = 0
    executed: int = 0
    done: bool = False
    spent: bool = False


class VisitMarks(Dict[str, VisitMark]):
    """The marks of one container, by label. They are kept where a state of the tree is guarded."""

    def __missing__(self, label: str) -> VisitMark:
        mark = self[label] = VisitMark()
        return mark

    def told(self) -> List[Tuple[str, List[object]]]:
        """Return labels and marks as plain data."""
        return [
            (label, [mark.reached, mark.executed, mark.done, mark.spent])
            for label, mark in dict(self).items()
        ]


class StateRateRow(NamedTuple):
    """The numbers learned of one state. The fields are those of StateRate.msg."""

    path: str
    state: str
    rate: float
    failure_class: int
    successes: int
    failures: int
    recoveries: int
    has_preconditions: bool


class TransitionRow(NamedTuple):
    """The count of one transition. The fields are those of TransitionCount.msg."""

    path: str
    state: str
    outcome: str
    to: str
    count: int  # type: ignore[assignment]  # as the message says, not what a tuple does
