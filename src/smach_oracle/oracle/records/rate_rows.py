"""Learned rates and counts, as rows for those who publish them."""

from typing import NamedTuple


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
