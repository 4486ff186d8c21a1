"""What the scripted operator does with a hand in place of the robot: take a thing, put it down, hand it over."""
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import from_rpy, transform

from .pilot import Pilot, Stuck
from .sight import Seen, Sight

READY = {'right': np.array([0.52, -0.22, 1.0]), 'left': np.array([0.52, 0.22, 1.0])}  # m, before the chest
SHOULDER = {'right': np.array([-0.05, -0.19]), 'left': np.array([-0.05, 0.19])}  # x, y in base_footprint, m
WIDEST = 0.08  # m between the tips that a thing may take up
BEFORE = 0.12  # m before a thing, from where the hand goes straight
LIFT = 0.12  # m
CLEAR_OF = 0.07  # m beside the middle of the hand that neighbours should be away
_TURNS = (0.0, 0.35, -0.35, 0.7, -0.7)  # rad beside the straight heading
_PITCHES = (0.45, 0.9, 0.15)  # rad downwards
_LEVEL = (0.1, 0.3)  # the same, inside a shelf
_OFF_SHELF = 0.03  # m that a thing is lifted inside a shelf
_SQUEEZE = 90.0  # N: the robot, which grips with less, may have lost it before
OUT = 0.28  # m straight back out of a shelf

Look = Callable[[], Sight]


class Failed(Exception):
    """It did not work; the text says what the eye saw."""


class Attempt(NamedTuple):
    """One try at a state's work by hand."""

    pilot: Pilot
    look: Look
    number: int  # of tries before this one
    slip: Callable[[], np.ndarray]  # (3,) m, by how much the eye misjudges a place


def pick(attempt: Attempt, target: Callable[[Sight], Optional[Seen]]) -> None:
    """Take a thing and lift it.

    :param target: finds it in what is seen.
    :raises Failed, Stuck: where it is not in the hand in the end.
    """
    pilot, arm = attempt.pilot, attempt.pilot.hand.arm
    sight = attempt.look()
    if sight.held_by(arm) is None:
        thing = target(sight)
        if thing is None:
            raise Failed('there is nothing to take')
        _fetch(attempt, sight, thing)
    pilot.shift(z=LIFT, share=0.5)
    pilot.rest(10)
    if attempt.look().held_by(arm) is None:
        raise Failed('it slipped out of the hand')


def _fetch(attempt: Attempt, sight: Sight, thing: Seen) -> None:
    pilot = attempt.pilot
    ways = grasps(thing.box, [other.box for other in sight.movable() if other.name != thing.name], pilot.hand.arm)
    if not ways:
        raise Failed('{} is too wide for the hand'.format(thing.name))
    grasp = ways[attempt.number % len(ways)]
    grasp[:3, 3] += attempt.slip()
    pilot.open()
    come_out(pilot, thing.top)
    before = transform(grasp[:3, 3] - BEFORE * grasp[:3, 0], grasp[:3, :3])
    above = before.copy()
    above[2, 3] = max(above[2, 3], thing.top + 0.10)
    pilot.go(above, near=(0.04, 0.2))
    pilot.go(before)
    pilot.go(grasp, share=0.4, near=(0.006, 0.05))
    grip = pilot.close()
    if not grip.stalled or attempt.look().held_by(pilot.hand.arm) is None:
        pilot.open()
        pilot.back(BEFORE)
        raise Failed('the hand closed on nothing')


def come_out(pilot: Pilot, height: float) -> None:
    """Take the hand out of whatever it is among: back, up over `height` m, and before the robot's chest."""
    tool = pilot.hand.tool()
    if tool[0, 3] > 0.45 and tool[2, 3] < height + 0.12:
        _as_far_as_it_goes(lambda: pilot.back(0.10))
        _as_far_as_it_goes(lambda: pilot.shift(z=height + 0.15 - tool[2, 3]))
    elif tool[2, 3] < height + 0.05:
        _as_far_as_it_goes(lambda: pilot.shift(z=height + 0.10 - tool[2, 3]))
    pilot.come_to(READY[pilot.hand.arm] + [0.0, 0.0, max(0.0, height + 0.1 - READY[pilot.hand.arm][2])])


def grasps(thing: UprightBox, others: List[UprightBox], arm: str,
           pitches: Sequence[float] = _PITCHES) -> List[np.ndarray]:
    """Poses (4x4, base_footprint from tool) from which to take a thing, the most promising first."""
    straight = float(np.arctan2(*(thing.centre[:2] - SHOULDER[arm])[::-1]))
    found = []
    for order, (pitch, turn) in enumerate((pitch, turn) for pitch in pitches for turn in _TURNS):
        if width_across(thing, straight + turn) > WIDEST:
            continue
        pose = from_rpy((0, 0, 0), pitch=pitch, yaw=straight + turn)
        low, high = thing.centre[2] - thing.size[2] / 2, thing.centre[2] + thing.size[2] / 2
        height = min(max(thing.centre[2], low + 0.04 + 0.03 * np.sin(pitch)), high - 0.015)
        ahead = min(0.012, thing.narrow / 3)
        pose[:3, 3] = thing.centre[:2].tolist() + [height]
        pose[:2, 3] += ahead * pose[:2, 0] / max(np.linalg.norm(pose[:2, 0]), 0.2)
        crowded = sum(max(0.0, CLEAR_OF - _beside(pose, other)) for other in others)
        found.append((20.0 * crowded * np.cos(pitch) + abs(turn) + 0.4 * abs(pitch - pitches[0]), order, pose))
    return [pose for _, _, pose in sorted(found, key=lambda item: item[:2])]


def width_across(thing: UprightBox, heading: float) -> float:
    """m between the tips that a thing takes up, for a hand that comes along `heading` (rad)."""
    if thing.wide - thing.narrow < 0.012:
        return thing.wide
    angle = heading - thing.yaw
    return float(thing.size[0] * abs(np.sin(angle)) + thing.size[1] * abs(np.cos(angle)))


def _beside(pose: np.ndarray, other: UprightBox) -> float:
    """m from another thing's edge to the line along which the hand comes, in the plane; large behind the target."""
    way = pose[:2, 0] / np.linalg.norm(pose[:2, 0])
    offset = other.centre[:2] - pose[:2, 3]
    along = offset @ way
    if along > 0.04:
        return 1.0
    return float(abs(offset @ np.array([-way[1], way[0]])) - other.wide / 2)


def put_down(attempt: Attempt, place: np.ndarray) -> None:
    """Put what the hand holds down upright.

    :param place: (3,) m, where its centre shall be, in base_footprint; it comes to stand on what is below.
    :raises Failed, Stuck: where it does not stand there in the end.
    """
    pilot, arm = attempt.pilot, attempt.pilot.hand.arm
    thing = attempt.look().held_by(arm)
    if thing is None:
        raise Failed('the hand holds nothing')
    carry(attempt, thing, place + [0.0, 0.0, 0.10])
    thing = _in_hand(attempt, arm)
    support = attempt.look().support_below(thing)
    down = thing.bottom - (support.top if support is not None else place[2] - thing.size[2] / 2)
    offset = (place - thing.centre)[:2] + attempt.slip()[:2]
    pilot.shift(offset[0], offset[1], share=0.5)
    _as_far_as_it_goes(lambda: pilot.shift(z=-down + 0.004, share=0.3))
    let_go(pilot)
    left = attempt.look().bodies.get(thing.name)
    if left is None:
        raise Failed('{} is gone'.format(thing.name))
    _check_stands(left, place)


def carry(attempt: Attempt, thing: Seen, centre: np.ndarray) -> None:
    """Carry a thing until its centre is at (3,) m: up, across, the hand turning as is natural for the arm.

    :raises Failed, Stuck: where it is lost, or the hand does not get there.
    """
    pilot, arm = attempt.pilot, attempt.pilot.hand.arm
    rise = centre[2] - thing.centre[2]
    if rise > 0.02:
        pilot.shift(z=rise, share=0.6)
    tool, now = pilot.hand.tool(), _in_hand(attempt, arm).centre
    turn = _heading(centre, arm) - _heading(now, arm)
    goals = tuple(_carried(tool, now, centre, part * turn) for part in (1.0, 0.5, 0.0))
    _first_that_goes(pilot, goals)
    _in_hand(attempt, arm)


def let_go(pilot: Pilot) -> None:
    """Open the gripper, and draw the hand back and up. Raises Stuck."""
    pilot.open()
    pilot.rest(5)
    _as_far_as_it_goes(lambda: pilot.back(0.13, share=0.4))
    _as_far_as_it_goes(lambda: pilot.shift(z=0.10))


def _carried(tool: np.ndarray, now: np.ndarray, centre: np.ndarray, turn: float) -> np.ndarray:
    """The tool's pose once the thing at `now` is at `centre`, turned by `turn` about the vertical."""
    rotation = from_rpy((0, 0, 0), yaw=turn)[:3, :3]
    return transform(centre + rotation @ (tool[:3, 3] - now), rotation @ tool[:3, :3])


def _first_that_goes(pilot: Pilot, goals: Tuple[np.ndarray, ...]) -> None:
    for last, goal in enumerate(goals, 1 - len(goals)):
        try:
            pilot.go(goal, share=0.7, near=(0.015, 0.1))
            return
        except Stuck:
            if last == 0:
                raise


def _heading(point: np.ndarray, arm: str) -> float:
    return float(np.arctan2(*(point[:2] - SHOULDER[arm])[::-1]))


def _in_hand(attempt: Attempt, arm: str) -> Seen:
    thing = attempt.look().held_by(arm)
    if thing is None:
        raise Failed('it was lost on the way')
    return thing


def _check_stands(thing: Seen, place: np.ndarray) -> None:
    beside = float(np.hypot(*(thing.centre - place)[:2]))
    if not thing.upright or beside > 0.05 or thing.held:
        raise Failed('{} {} {:.0f} cm beside its place'.format(
            thing.name, 'stands' if thing.upright else 'lies', 100 * beside))


def _as_far_as_it_goes(drive: Callable[[], None]) -> None:
    """A motion that need not get all the way."""
    try:
        drive()
    except Stuck:
        return


def pull_out(attempt: Attempt, target: Callable[[Sight], Optional[Seen]]) -> None:
    """Take a thing out of a shelf: level, straight in, lifted a little, straight back.

    :raises Failed, Stuck: where it is not in the hand in the end.
    """
    pilot, arm = attempt.pilot, attempt.pilot.hand.arm
    sight = attempt.look()
    if sight.held_by(arm) is None:
        thing = target(sight)
        if thing is None:
            raise Failed('there is nothing to take')
        _reach_in(attempt, sight, thing)
    _as_far_as_it_goes(lambda: pilot.shift(z=_OFF_SHELF, share=0.3))
    _as_far_as_it_goes(lambda: pilot.shift(x=-OUT, share=0.4))
    if attempt.look().held_by(arm) is None:
        raise Failed('it slipped out of the hand')


def _reach_in(attempt: Attempt, sight: Sight, thing: Seen) -> None:
    pilot = attempt.pilot
    others = [other.box for other in sight.movable() if other.name != thing.name]
    level = grasps(thing.box, others, pilot.hand.arm, _LEVEL)
    if not level:
        raise Failed('{} is too wide for the hand'.format(thing.name))
    grasp = level[attempt.number % len(level)]
    grasp[:3, 3] += attempt.slip()
    pilot.open()
    _as_far_as_it_goes(lambda: pilot.shift(x=min(0.0, thing.centre[0] - OUT - pilot.hand.tool()[0, 3]), share=0.5))
    _as_far_as_it_goes(lambda: pilot.come_to(grasp[:3, 3] - [OUT, 0.0, -0.03]))
    pilot.go(transform(grasp[:3, 3] - OUT * 0.7 * grasp[:3, 0], grasp[:3, :3]))
    pilot.go(grasp, share=0.4, near=(0.006, 0.05))
    if not pilot.close(_SQUEEZE).stalled or attempt.look().held_by(pilot.hand.arm) is None:
        pilot.open()
        pilot.back(OUT * 0.7)
        raise Failed('the hand closed on nothing')
