"""A person's next try at a failed state: a ladder for each kind of work, and a memory.

Each rung is tried a few times at most, only where what is seen speaks for it, and what has just
failed is not repeated as long as there is something else. Pure.
"""
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from .state_plans import PUT_DOWN, RETRY, SHOW, TAKE, StatePlan

# what a person does
MARK = 'mark'  # show the thing in the image
BY_HAND = 'by hand'  # do the state's work with the hand
CLEAR = 'clear'  # move what is in the way
CLOSER = 'closer'  # move the thing to where the robot reaches it
AGAIN = 'again'  # have the state tried again
WAIT = 'wait'  # wait, and have it tried again
BASE = 'base'  # drive the base a little, and have it tried again
HIDDEN, LOST, BACK = 'hidden', 'lost', 'back'  # go to that state of the plan
LEAVE = 'leave'  # leave it undone
GIVE_UP = 'give up'
BY_INTERFACE = {MARK: 'perception', BY_HAND: 'manipulation', CLEAR: 'manipulation',
                CLOSER: 'manipulation'}
WAIT_S = 20.0  # of the world's time


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
    reachable: bool = True  # the hand of the plan reaches the thing


class Tried(NamedTuple):
    """Something that was done about a state in this trial."""

    state: str
    act: str
    worked: bool = False  # it came about what was meant. The state was not done by that


class NextAct(NamedTuple):
    """The next act about a question."""

    act: str
    interface: str = ''  # start this one
    goto: str = ''  # or go to this state
    wait_s: float = 0.0  # before that
    base: Tuple[float, float, float] = (0.0, 0.0, 0.0)  # before that: m, m, rad
    why: str = ''


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


_LADDERS: Dict[str, List[Rung]] = {
    SHOW: [
        Rung(HIDDEN, 1, lambda sight: sight.covered),
        Rung(MARK, 1, lambda sight: sight.located),
        Rung(CLEAR, 1, lambda sight: sight.located and sight.crowded),
        Rung(MARK, 0, lambda sight: sight.seen),
        Rung(BASE, 1, lambda sight: sight.dazzled),
        Rung(HIDDEN, 2, lambda sight: not sight.seen),
        Rung(WAIT, 1, lambda sight: not sight.located),
        Rung(BACK, 2),
        Rung(WAIT, 3, lambda sight: not sight.located),
        Rung(AGAIN, 2),
        Rung(CLEAR, 2, lambda sight: sight.located and sight.crowded),
    ],
    TAKE: [
        Rung(HIDDEN, 1, lambda sight: sight.covered),
        Rung(BACK, 1, lambda sight: sight.moved and not sight.holds),
        Rung(BY_HAND, 1, lambda sight: sight.located and sight.reachable),
        Rung(CLEAR, 1, lambda sight: sight.located and sight.crowded),
        Rung(CLOSER, 2, lambda sight: sight.located and not sight.reachable),
        Rung(BY_HAND, 0, lambda sight: sight.holds or sight.located),
        Rung(BASE, 1, lambda sight: sight.located),
        Rung(WAIT, 1, lambda sight: not sight.located),
        Rung(BACK, 2),
        Rung(CLEAR, 2, lambda sight: sight.located and sight.crowded),
        Rung(WAIT, 2, lambda sight: not sight.located),
        Rung(AGAIN, 2),
    ],
    PUT_DOWN: [
        Rung(LOST, 3, lambda sight: not sight.holds),
        Rung(BY_HAND, 1, lambda sight: sight.holds and not sight.blocked),
        Rung(CLEAR, 2, lambda sight: sight.blocked),
        Rung(BY_HAND, 0, lambda sight: sight.holds),
        Rung(BASE, 1),
        Rung(BACK, 2),
        Rung(AGAIN, 2),
    ],
    RETRY: [
        Rung(AGAIN, 0),
        Rung(BACK, 1),
        Rung(BASE, 1),
        Rung(WAIT, 1),
        Rung(BACK, 2),
    ],
}


class TrialMemory:
    """A person's memory of what they have tried in one trial."""

    def __init__(self) -> None:
        self._tried: List[Tried] = []

    def note(self, state: str, act: str, worked: bool = False) -> None:
        """Something was done about a state."""
        self._tried.append(Tried(state, act, worked))

    def times(self, state: str, act: str) -> int:
        """Return how often it was done."""
        return sum((each.state, each.act) == (state, act) for each in self._tried)

    def last(self, state: str) -> Tried:
        """Return what was done last about a state."""
        return next((each for each in reversed(self._tried) if each.state == state),
                    Tried(state, ''))


def choose(plan: StatePlan, asked: Asked, sight: Sight, memory: TrialMemory) -> NextAct:
    """Choose what to do about a question."""
    before = memory.last(asked.state)
    if before.act in (CLEAR, CLOSER) and before.worked:
        after = _made(BACK, plan, asked) or _made(AGAIN, plan, asked)
        if after is not None:
            return after._replace(why='there is room now')
    ladder = [rung for rung in _LADDERS[plan.means] if rung.when(sight)]
    for repeat in (False, True):
        for rung in ladder:
            choice = _made(rung.act, plan, asked)
            left = memory.times(asked.state, rung.act) < (rung.most or plan.tries)
            if choice is not None and left and (repeat or rung.act != before.act):
                return choice
    return _made(LEAVE, plan, asked) or NextAct(GIVE_UP, why='nothing is left to try')


def _made(act: str, plan: StatePlan, asked: Asked) -> Optional[NextAct]:
    """The answer that does it, or None where it cannot be done."""
    if act in BY_INTERFACE:
        interface = BY_INTERFACE[act]
        allowed = interface in asked.interfaces and not (act == CLEAR and plan.inside)
        return NextAct(act, interface=interface) if allowed else None
    goals = {HIDDEN: plan.hidden, LOST: plan.lost, BACK: plan.otherwise, LEAVE: plan.leave}
    state = goals.get(act, plan.again or asked.state)
    if not state or state not in asked.states:
        return None
    if act == BASE:
        return NextAct(act, goto=state, base=plan.base,
                      why='from another place') if any(plan.base) else None
    return NextAct(act, goto=state, wait_s=WAIT_S if act == WAIT else 0.0, why=_WHY[act])


_WHY = {
    AGAIN: 'once more', WAIT: 'once more, a while later', HIDDEN: 'it is hidden',
    LOST: 'the hand holds nothing', BACK: 'from further back', LEAVE: 'it is left as it is'
}
