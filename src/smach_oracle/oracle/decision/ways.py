"""The ways on from a failure, as a policy sees them. Pure.

The *menu* of a failure is the list of its ways. A *streak* is the failures of one state in one
execution of its container, up to its next success. doc/ways.md says what is on the menu, and
`recovery.options` makes it.
"""

from enum import Enum
from typing import Mapping, NamedTuple, Optional, Tuple

KEEP, RESTORE = 'keep', 'restore'
WAITS_S = (10.0, 60.0)  # before the failed state is entered again
# the places of a way: the first of its streak, a later one, the choice of a person
PLACES = FIRST, LATER, BY_PERSON = 0, 1, 2
_FROM, _WAIT = 'from ', 'wait '  # how the keys of ways begin
Count = Tuple[float, float]  # times that ways have helped, and that they have not


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
            return _WAIT + '{:g} s'.format(self.wait_s)
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


def key_of(target: str, here: str) -> str:
    """Return the key of the way that enters a state. `here`: the failed one."""
    return WayKind.AGAIN.value if target == here else _FROM + target


def kind_of_choice(key: str) -> WayKind:
    """Return the kind of way that a person chooses with a state. `key`: of the way."""
    return WayKind.AGAIN if key == WayKind.AGAIN.value else WayKind.STEP_BACK


def parts_of(key: str) -> Tuple[Optional[WayKind], str]:
    """Return the kind of way that a key names, and the state that it enters, or how long it waits.

    All ways back have the kind STEP_BACK, and None is no key of a way.
    """
    for kind, begin in ((WayKind.STEP_BACK, _FROM), (WayKind.WAIT, _WAIT)):
        if key.startswith(begin):
            return kind, key[len(begin) :]
    return {each.value: each for each in (WayKind.AGAIN, WayKind.PREPARE)}.get(key), ''


def way_in_words(key: str) -> str:
    """Return what was done by a way, for people. `key`: that of the way."""
    kind, what = parts_of(key)
    if kind is WayKind.STEP_BACK:
        return 'going back to ' + what
    behind: Mapping[Optional[WayKind], str] = {
        WayKind.PREPARE: ' after its preconditions',
        WayKind.WAIT: ' after ' + what,
    }
    return 'trying it again' + behind.get(kind, '')


class StreakSoFar(NamedTuple):
    """What was done in a streak. `tried`: the keys of its ways, in order.

    `attempts`: the ways that were gone, those of the containers within among them. `minutes`: since
    its first failure. `moved`: the one that came before its turn in the menu's
    own order, '' for none.
    """

    tried: Tuple[str, ...] = ()
    attempts: int = 0
    minutes: float = 0.0
    moved: str = ''


class WayResult(NamedTuple):
    """The result of one way from a failure of one state.

    `way`: its key. `kind`: the value of its WayKind. `place`: 0 for the first way of its streak, 1
    for a later one, 2 for the choice of a person. `failure`: the kind of failure, a
    `failure_text_key`. `helped`: None is not known. `minutes`: from the decision on, until the
    state had its next result, or until it was clear that nobody knows. `hoped`: the chance to help
    for which a policy preferred it to the ways of the menu's own order, None where none did.
    """

    way: str
    kind: str
    place: int
    failure: str
    helped: Optional[bool]
    minutes: float
    hoped: Optional[float] = None


class Evidence(NamedTuple):
    """What is known of the ways on from the failures of one state.

    `results`: of its ways, oldest first. `failure`: the kind of the present failure, as they have
    it. `of_kinds`: how often ways of a kind at a place have helped, and how often not, in the
    whole machine.
    """

    results: Tuple[WayResult, ...] = ()
    failure: str = ''
    of_kinds: Mapping[Tuple[str, int], Count] = {}

    def of_way(self, key: str) -> 'WayCounts':
        """Return what a way has led to after failures of this kind, after all kinds if none had."""
        known = [each for each in self.results if each.way == key and each.helped is not None]
        same = [each for each in known if each.failure == self.failure] or known
        helped = [each for each in same if each.helped]
        minutes = sum(each.minutes for each in helped) / max(1, len(helped))
        return WayCounts(len(helped), len(same), minutes)


class WayCounts(NamedTuple):
    """The times that a way has helped, of how many, and the mean time that it took then."""

    helped: int
    tried: int
    minutes: float

    @property
    def share(self) -> float:
        """Return the share of the times that it has helped, as if it had twice been one of two."""
        return (self.helped + 1.0) / (self.tried + 2.0)


class ChosenOrder(NamedTuple):
    """What a policy makes of a menu: the ways in the order in which it would go them.

    It asks where none is left. `chance`: of the first one to be that, where it was drawn. `hoped`:
    the chance to help for which it has come before its turn in the menu's own order. None: it has
    not. `remark`: what the log is told once of the state, '' for nothing.
    """

    ways: Tuple[Way, ...]
    chance: float = 1.0
    hoped: Optional[float] = None
    remark: str = ''


class Prices(NamedTuple):
    """What things cost, in minutes of the robot."""

    robot_minute: float = 1.0
    expert_minute: float = 5.0
    lost_trial: float = 60.0
    harm: float = 30.0
