"""A person's next try at a failed state: a ladder for each kind of work, and a memory.

Each rung is tried a few times at most, only where what is seen speaks for it. What has failed is
not done again as long as all that is seen is as it was. Where nothing is left, a person gives up.
Pure.
"""

import math
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from .state_plans import PUT_DOWN, RETRY, SHOW, TAKE, StatePlan

# what a person does
MARK = 'mark'  # show the thing in the image
BY_HAND = 'by hand'  # do the state's work with the hand
CLEAR = 'clear'  # move what is in the way
CLOSER = 'closer'  # move the thing to where the robot reaches it
UPRIGHT = 'upright'  # set the thing upright that lies
AGAIN = 'again'  # have the state tried again
WAIT = 'wait'  # wait, and have it tried again
BASE = 'base'  # drive the base a little, and have it tried again
HIDDEN, LOST, BACK = 'hidden', 'lost', 'back'  # go to that state of the plan
LEAVE = 'leave'  # leave it undone
GIVE_UP = 'give up'
BY_INTERFACE = {
    MARK: 'perception',
    BY_HAND: 'manipulation',
    CLEAR: 'manipulation',
    CLOSER: 'manipulation',
    UPRIGHT: 'manipulation',
}
PREPARING = (CLEAR, CLOSER, UPRIGHT)  # the state itself is not done by these
WAIT_S = 20.0  # of the world's time
ALIKE = 0.04  # m: what is seen no further from where it was seen before has not been moved


class Sight(NamedTuple):
    """A person's knowledge when they decide."""

    seen: bool = True  # the thing that the task is about
    located: bool = True  # and where it is
    holds: bool = False  # the hand of the plan holds something
    crowded: bool = False  # another thing stands close next to it
    blocked: bool = False  # another thing stands where something should be put
    covered: bool = False  # a limb of the robot is right next to it, or before it
    moved: bool = False  # it stands elsewhere than where the robot has detected it
    dazzled: bool = False  # light falls into the camera
    dim: bool = False  # there is little light
    reachable: bool = True  # the hand of the plan reaches the thing
    lies: bool = False  # it lies, and should stand
    lost: bool = False  # it is where no hand gets, as on the floor
    open: bool = False  # where it should be nothing hides it: other things are seen there
    shelf: bool = False  # it is in a shelf, where a hand has no room to turn it
    there: bool = False  # it is at the place where it should be put, or right beside
    repeated: bool = False  # the robot has done the state again by itself, in vain
    place: Optional[Tuple[float, ...]] = None  # m, base_footprint: where it is seen
    around: Tuple[Tuple[float, ...], ...] = ()  # likewise: what is seen close to it

    @property
    def may_pass(self) -> bool:
        """Whether waiting may help."""
        return self.dazzled or self.dim or self.covered

    def unchanged(self, before: 'Sight') -> bool:
        """Whether all is seen to be as it was, within what the eye gets wrong."""
        return (
            all(getattr(self, field) == getattr(before, field) for field in _TELLING)
            and _alike(self.place, before.place)
            and len(self.around) == len(before.around)
            and all(any(_alike(one, other) for other in before.around) for one in self.around)
        )


_TELLING = ('seen', 'located', 'holds', 'lies', 'covered', 'dazzled', 'dim')


def _alike(one: Optional[Tuple[float, ...]], other: Optional[Tuple[float, ...]]) -> bool:
    if one is None or other is None:
        return one is other
    return math.dist(one, other) <= ALIKE


class NextAct(NamedTuple):
    """The next act about a question."""

    act: str
    interface: str = ''  # start this one
    goto: str = ''  # or go to this state
    wait_s: float = 0.0  # before that
    base: Tuple[float, float, float] = (0.0, 0.0, 0.0)  # before that: m, m, rad
    why: str = ''

    def same(self, other: 'NextAct') -> bool:
        """Whether it comes to the same for the robot, whatever it is called."""
        return (self.interface, self.goto, self.wait_s, self.base) == (
            other.interface,
            other.goto,
            other.wait_s,
            other.base,
        ) and (not self.interface or self.act == other.act)


class Tried(NamedTuple):
    """Something that was done about a state in this trial."""

    state: str
    choice: NextAct
    sight: Sight  # when it was chosen
    worked: bool = False  # it came about what was meant


class Asked(NamedTuple):
    """The possible answers to a question."""

    state: str
    states: Sequence[str]  # that can be entered now
    interfaces: Sequence[str]  # on offer


class Rung(NamedTuple):
    """Something to try."""

    act: str
    most: int  # how often in one trial. 0 means as often as the plan says
    when: Callable[[Sight], bool] = lambda sight: True


def _lies(sight: Sight) -> bool:
    return sight.located and sight.lies


_LADDERS: Dict[str, List[Rung]] = {
    SHOW: [
        Rung(GIVE_UP, 1, lambda sight: sight.lost),
        Rung(UPRIGHT, 2, _lies),
        Rung(GIVE_UP, 1, lambda sight: _lies(sight) and not sight.shelf),
        Rung(HIDDEN, 1, lambda sight: sight.covered),
        Rung(MARK, 1, lambda sight: sight.located),
        Rung(CLEAR, 2, lambda sight: sight.located and sight.crowded),
        Rung(MARK, 0, lambda sight: sight.seen),
        Rung(BASE, 1, lambda sight: sight.dazzled),
        Rung(HIDDEN, 2, lambda sight: not sight.seen and not sight.open),
        Rung(WAIT, 2, lambda sight: not sight.located and sight.may_pass),
        Rung(BACK, 2),
        Rung(AGAIN, 1, lambda sight: sight.located),
    ],
    TAKE: [
        Rung(GIVE_UP, 1, lambda sight: sight.lost and not sight.holds),
        Rung(UPRIGHT, 2, lambda sight: _lies(sight) and not sight.holds),
        Rung(GIVE_UP, 1, lambda sight: _lies(sight) and not (sight.holds or sight.shelf)),
        Rung(HIDDEN, 1, lambda sight: sight.covered),
        Rung(BACK, 2, lambda sight: sight.moved and not sight.holds),
        Rung(BY_HAND, 1, lambda sight: sight.located and sight.reachable),
        Rung(CLEAR, 2, lambda sight: sight.located and sight.crowded),
        Rung(CLOSER, 2, lambda sight: sight.located and not sight.reachable),
        Rung(BASE, 1, lambda sight: sight.located and not sight.reachable),
        Rung(BY_HAND, 0, lambda sight: sight.holds or sight.located),
        Rung(BASE, 1, lambda sight: sight.located),
        Rung(WAIT, 2, lambda sight: not sight.located and sight.may_pass),
        Rung(BACK, 2),
        Rung(AGAIN, 1, lambda sight: sight.located),
    ],
    PUT_DOWN: [
        Rung(GIVE_UP, 1, lambda sight: sight.lost and not sight.holds),
        Rung(
            BY_HAND,
            0,
            lambda sight: (
                not sight.holds
                and sight.located
                and sight.reachable
                and (sight.there or sight.lies)
            ),
        ),
        Rung(LOST, 3, lambda sight: not sight.holds),
        Rung(BY_HAND, 1, lambda sight: sight.holds and not sight.blocked),
        Rung(CLEAR, 2, lambda sight: sight.blocked),
        Rung(BY_HAND, 0, lambda sight: sight.holds),
        Rung(BASE, 1, lambda sight: sight.holds),
        Rung(BACK, 2, lambda sight: sight.holds),
        Rung(AGAIN, 1, lambda sight: sight.holds),
    ],
    RETRY: [
        Rung(AGAIN, 0, lambda sight: not sight.repeated),
        Rung(BACK, 2),
        Rung(BASE, 1),
        Rung(WAIT, 1, lambda sight: sight.may_pass),
        Rung(LEAVE, 1),
        Rung(AGAIN, 1),
    ],
}


def _is_about(tried: Tried, state: str) -> bool:
    """Whether it counts for a state: what prepares the scene does so for all."""
    return tried.state == state or tried.choice.act in PREPARING


class TrialMemory:
    """A person's memory of what they have tried in one trial."""

    def __init__(self) -> None:
        self._tried: List[Tried] = []

    def note(self, state: str, choice: NextAct, sight: Sight, worked: bool = False) -> None:
        """Something was done about a state, which was seen so before."""
        self._tried.append(Tried(state, choice, sight, worked))

    def times(self, state: str, act: str) -> int:
        """Return how often it was done."""
        return sum(each.choice.act == act and _is_about(each, state) for each in self._tried)

    def last(self, state: str) -> Optional[Tried]:
        """Return what was done last about a state."""
        return next((each for each in reversed(self._tried) if each.state == state), None)

    def was_futile(self, state: str, choice: NextAct, sight: Sight) -> bool:
        """Whether the same was done before about the same state, which was seen as it is now.

        An act of the hand or the eye that came about was not futile.
        """
        return any(
            _is_about(each, state)
            and choice.same(each.choice)
            and not each.worked
            and sight.unchanged(each.sight)
            for each in self._tried
        )


def choose(plan: StatePlan, asked: Asked, sight: Sight, memory: TrialMemory) -> NextAct:
    """Choose what to do about a question."""
    before = memory.last(asked.state)
    if before is not None and before.choice.act in PREPARING and before.worked:
        after = _made(BACK, plan, asked) or _made(AGAIN, plan, asked)
        if after is not None:
            return after._replace(why=_PREPARED[before.choice.act])
    for rung in _LADDERS[plan.means]:
        if not rung.when(sight):
            continue
        choice = _made(rung.act, plan, asked)
        left = memory.times(asked.state, rung.act) < (rung.most or plan.tries)
        if choice is not None and left and not memory.was_futile(asked.state, choice, sight):
            return choice
    return NextAct(GIVE_UP, why='nothing is left to try')


def _made(act: str, plan: StatePlan, asked: Asked) -> Optional[NextAct]:
    """The answer that does it, or None where it cannot be done."""
    if act == GIVE_UP:
        return NextAct(GIVE_UP, why='no hand gets to it as it is')
    if act in BY_INTERFACE:
        interface = BY_INTERFACE[act]
        allowed = interface in asked.interfaces and not (act in PREPARING and plan.inside)
        return NextAct(act, interface=interface) if allowed else None
    goals = {HIDDEN: plan.hidden, LOST: plan.lost, BACK: plan.otherwise, LEAVE: plan.leave}
    state = goals.get(act, plan.again or asked.state)
    if not state or state not in asked.states:
        return None
    if act == BASE:
        return (
            NextAct(act, goto=state, base=plan.base, why='from another place')
            if any(plan.base)
            else None
        )
    return NextAct(act, goto=state, wait_s=WAIT_S if act == WAIT else 0.0, why=_WHY[act])


_WHY = {
    AGAIN: 'once more',
    WAIT: 'once more, a while later',
    HIDDEN: 'it is hidden',
    LOST: 'the hand holds nothing',
    BACK: 'from further back',
    LEAVE: 'it is left as it is',
}
_PREPARED = {
    CLEAR: 'there is room now',
    CLOSER: 'it stands nearer now',
    UPRIGHT: 'it stands upright now',
}
