"""The ways on from a failure, as a policy sees them. Pure.

The *menu* of a failure is the list of its ways. A *streak* is the failures of one state in one
execution of its container, up to its next success. doc/ways.md says what is on the menu, and
`recovery.menu` makes it.
"""

from enum import Enum
from typing import NamedTuple, Tuple

KEEP, RESTORE = 'keep', 'restore'
WAITS_S = (10.0, 60.0)  # before the failed state is entered again
_FROM = 'from '


class WayKind(str, Enum):
    """A kind of way. The values are those of DECISION events."""

    AGAIN = 'again'  # enter the failed state again
    WAIT = 'wait'  # let time pass, and then enter it again
    PREPARE = 'prepare'  # run its preconditions, and then enter it again
    STEP_BACK = 'step_back'  # go on from a state that was visited before it
    START = 'start'  # go on from the initial state of its container
    TOP = 'top'  # go on from the initial state of the top machine


class Way(NamedTuple):
    """One way on from a failure.

    `target`: the state that is entered, a label of the container, or a path below the top machine.
    `back`: how many of the visited states it goes back. `wait_s`: the wait before. `userdata`:
    `keep` or `restore`. `minutes`: that the robot is expected to take until it is where it was.
    `repeats`: the states that have succeeded in this trial and are entered again. `blocked`: why
    the way is not open, as a clause, '' where it is.
    """

    kind: WayKind
    target: str
    back: int = 0
    wait_s: float = 0.0
    userdata: str = KEEP
    minutes: float = 0.0
    repeats: Tuple[str, ...] = ()
    blocked: str = ''

    @property
    def key(self) -> str:
        """Return the name by which a streak knows it: another way to the same place is the same."""
        if self.kind is WayKind.WAIT:
            return 'wait {:g} s'.format(self.wait_s)
        return self.kind.value if self.enters_again else _FROM + self.target

    @property
    def reach(self) -> int:
        """Return how often one state back is doubled until it is as far back: 1, 2, 4 are 1, 2, 3.

        It is 0 where it goes nowhere back.
        """
        return (2 * self.back - 1).bit_length() if self.back else 0

    @property
    def enters_again(self) -> bool:
        """Whether it enters the failed state again, and no state before it."""
        return self.kind in (WayKind.AGAIN, WayKind.WAIT, WayKind.PREPARE)


def way_in_words(key: str) -> str:
    """Return what was done by a way, for people. `key`: that of the way."""
    if key.startswith(_FROM):
        return 'going back to ' + key[len(_FROM) :]
    return {
        WayKind.AGAIN.value: 'trying it again',
        WayKind.PREPARE.value: 'trying it again after its preconditions',
    }.get(key, 'trying it again after ' + key[len(WayKind.WAIT.value) + 1 :])


class StreakSoFar(NamedTuple):
    """What was done in a streak. `tried`: the keys of its ways, in order.

    `attempts`: the ways that were gone, those of the containers within among them. `minutes`: since
    its first failure.
    """

    tried: Tuple[str, ...] = ()
    attempts: int = 0
    minutes: float = 0.0


class Prices(NamedTuple):
    """What things cost, in minutes of the robot."""

    robot_minute: float = 1.0
    expert_minute: float = 5.0
    lost_trial: float = 60.0
    harm: float = 30.0
