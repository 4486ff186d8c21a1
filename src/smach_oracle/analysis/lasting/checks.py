"""Checks by the world's log which causes of a trial last until the failed state is tried again.

A cause lasts in a trial if it was still there at the second try of the state that failed first, and
at that state again after the script was started over. A trial in which no state failed, or in which
that state was not tried again, tells nothing.
"""

from typing import FrozenSet, Iterable, List, NamedTuple, Optional, Sequence

from ..trial_rows import TrialRow
from .causes_log import LoggedCause, causes_in
from .tries import StateTry, tries_in

# The world's log of the rows in doc/trials gives these no end, though a state of the script puts an
# end to them. So an end that is missing does not show that they last.
OPEN_ENDED = frozenset({'base_misplaced'})


class TrialCheck(NamedTuple):
    """The causes of one trial, and those that were there when the failed state was tried again."""

    causes: Sequence[LoggedCause]
    failed: bool  # whether a state failed
    # kinds that were there at the second try of the state. None: there was none
    at_second_try: Optional[FrozenSet[str]]
    # kinds that were there at the state after a restart. None: it did not come to it again
    after_restart: Optional[FrozenSet[str]]

    @property
    def lasting_by_class(self) -> FrozenSet[str]:
        """Return the kinds that are said to last."""
        return frozenset(cause.kind for cause in self.causes if cause.lasting)

    @property
    def lasting_by_log(self) -> Optional[FrozenSet[str]]:
        """Return the kinds that lasted. None means that the trial does not tell."""
        if self.at_second_try is None or self.after_restart is None:
            return None
        return self.at_second_try & self.after_restart


def check_of(row: TrialRow) -> Optional[TrialCheck]:
    """Return the check of a trial. None where its row lacks the log or the tries."""
    if not row.cause_log or not row.tries:
        return None
    causes, tries = causes_in(row.cause_log), tries_in(row.tries)
    failed = min(
        (each for each in tries if each.failed_s is not None),
        default=None,
        key=lambda each: (each.failed_s or 0.0, each.began_s),
    )
    if failed is None:
        return TrialCheck(causes, False, None, None)
    later = [
        each
        for each in tries
        if each.state == failed.state and each.began_s >= (failed.failed_s or 0.0)
    ]
    return TrialCheck(
        causes,
        True,
        _there(causes, later),
        _there(causes, [each for each in later if each.restarts > failed.restarts]),
    )


def _there(causes: Iterable[LoggedCause], tries: Sequence[StateTry]) -> Optional[FrozenSet[str]]:
    """Return the kinds that were there at the first of some tries. None means there is no try."""
    if not tries:
        return None
    return frozenset(
        cause.kind
        for cause in causes
        if cause.there_at(tries[0].began_s)
        and (cause.kind not in OPEN_ENDED or cause.ended_s is not None)
    )


def checks_of(rows: Iterable[TrialRow]) -> List[TrialCheck]:
    """Return the checks of the trials that have causes, and rows that tell."""
    found = [check_of(row) for row in rows if row.causes]
    return [each for each in found if each is not None]
