"""Why something under way ends early, in the one order in which reasons count."""

from enum import IntEnum


class Reason(IntEnum):
    """A reason to end early. If there are several, the first of this order counts.

    The first two come first, as nobody waits for an outcome then, and no other state begins. A
    preempt comes before a shutdown: where both are there, the process that goes down has preempted
    its machines.
    """

    EARLY_END = 1  # of the trial, which goes on later from its store
    LEFT_BEHIND = 2  # the state around it was abandoned
    PREEMPTED = 3
    SHUTDOWN = 4  # of the process
    TIME_OVER = 5  # the minutes of the trial's budget
    ENDED = 6  # what it was about is over

    @property
    def text(self) -> str:
        """Return it in words."""
        return self.name.lower().replace('_', ' ')
