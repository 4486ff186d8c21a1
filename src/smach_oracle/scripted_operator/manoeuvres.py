"""Work by hand in place of the robot: take a thing, put it down."""
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import from_rpy, transform

from .hand_driver import HandDriver, StuckError
from .true_scene import TrueBody, TrueScene

# m, before the chest
READY = {'right': np.array([0.52, -0.22, 1.0]), 'left': np.array([0.52, 0.22, 1.0])}
# x, y in base_footprint, m
SHOULDER = {'right': np.array([-0.05, -0.19]), 'left': np.array([-0.05, 0.19])}
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

ReadScene = Callable[[], TrueScene]


class ManoeuvreError(Exception):
    """It did not work; the text says what came of it."""


class Attempt(NamedTuple):
    """One try at a state's work by hand."""

    driver: HandDriver
    read_scene: ReadScene
    number: int  # of tries before this one
    slip: Callable[[], np.ndarray]  # (3,) m, by how much a person misjudges a place


def pick(attempt: Attempt, target: Callable[[TrueScene], Optional[TrueBody]]) -> None:
    """Take a thing and lift it.

    :param target: finds it in the scene.
    :raises ManoeuvreError: where it is not in the hand in the end.
    :raises StuckError: where the hand does not get there.
    """
    driver, arm = attempt.driver, attempt.driver.hand.arm
    scene = attempt.read_scene()
    if scene.held_by(arm) is None:
        thing = target(scene)
        if thing is None:
            raise ManoeuvreError('there is nothing to take')
        _fetch(attempt, scene, thing)
    driver.shift(z=LIFT, share=0.5)
    driver.rest(10)
    if attempt.read_scene().held_by(arm) is None:
        raise ManoeuvreError('it slipped out of the hand')


def _fetch(attempt: Attempt, scene: TrueScene, thing: TrueBody) -> None:
    driver = attempt.driver
    ways = grasps(thing.box, [other.box for other in scene.movable() if other.name != thing.name],
                  driver.hand.arm)
    if not ways:
        raise ManoeuvreError('{} is too wide for the hand'.format(thing.name))
    grasp = ways[attempt.number % len(ways)]
    grasp[:3, 3] += attempt.slip()
    driver.open()
    come_out(driver, thing.top)
    before = transform(grasp[:3, 3] - BEFORE * grasp[:3, 0], grasp[:3, :3])
    above = before.copy()
    above[2, 3] = max(above[2, 3], thing.top + 0.10)
    driver.go(above, near=(0.04, 0.2))
    driver.go(before)
    driver.go(grasp, share=0.4, near=(0.006, 0.05))
    grip = driver.close()
    if not grip.stalled or attempt.read_scene().held_by(driver.hand.arm) is None:
        driver.open()
        driver.back(BEFORE)
        raise ManoeuvreError('the hand closed on nothing')


def come_out(driver: HandDriver, height: float) -> None:
    """Take the hand out from among things: back, up over `height` m, and before the chest."""
    tool = driver.hand.tool()
    if tool[0, 3] > 0.45 and tool[2, 3] < height + 0.12:
        _as_far_as_it_goes(lambda: driver.back(0.10))
        _as_far_as_it_goes(lambda: driver.shift(z=height + 0.15 - tool[2, 3]))
    elif tool[2, 3] < height + 0.05:
        _as_far_as_it_goes(lambda: driver.shift(z=height + 0.10 - tool[2, 3]))
    driver.come_to(READY[driver.hand.arm] +
                   [0.0, 0.0, max(0.0, height + 0.1 - READY[driver.hand.arm][2])])


def grasps(thing: UprightBox, others: List[UprightBox], arm: str,
           pitches: Sequence[float] = _PITCHES) -> List[np.ndarray]:
    """Poses (4x4, base_footprint from tool) from which to take a thing, most promising first."""
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
        pose[:2, 3] += ahead * pose[:2, 0] / max(float(np.linalg.norm(pose[:2, 0])), 0.2)
        crowded = sum(max(0.0, CLEAR_OF - _beside(pose, other)) for other in others)
        found.append((20.0 * crowded * np.cos(pitch) + abs(turn) + 0.4 * abs(pitch - pitches[0]),
                      order, pose))
    return [pose for _, _, pose in sorted(found, key=lambda item: item[:2])]


def width_across(thing: UprightBox, heading: float) -> float:
    """m between the tips that a thing takes up, for a hand that comes along `heading` (rad)."""
    if thing.wide - thing.narrow < 0.012:
        return thing.wide
    angle = heading - thing.yaw
    return float(thing.size[0] * abs(np.sin(angle)) + thing.size[1] * abs(np.cos(angle)))


def _beside(pose: np.ndarray, other: UprightBox) -> float:
    """m, in the plane, from another thing's edge to the line along which the hand comes.

    Large for things behind the target.
    """
    way = pose[:2, 0] / np.linalg.norm(pose[:2, 0])
    offset = other.centre[:2] - pose[:2, 3]
    along = offset @ way
    if along > 0.04:
        return 1.0
    return float(abs(offset @ np.array([-way[1], way[0]])) - other.wide / 2)


def put_down(attempt: Attempt, place: np.ndarray) -> None:
    """Put what the hand holds down upright.

    :param place: (3,) m, where its centre shall be, in base_footprint; it comes to stand on what is
        below.
    :raises ManoeuvreError: where it does not stand there in the end.
    :raises StuckError: where the hand does not get there.
    """
    driver, arm = attempt.driver, attempt.driver.hand.arm
    thing = attempt.read_scene().held_by(arm)
    if thing is None:
        raise ManoeuvreError('the hand holds nothing')
    carry(attempt, thing, place + [0.0, 0.0, 0.10])
    thing = _in_hand(attempt, arm)
    support = attempt.read_scene().support_below(thing)
    down = thing.bottom - (support.top if support is not None else place[2] - thing.size[2] / 2)
    offset = (place - thing.centre)[:2] + attempt.slip()[:2]
    driver.shift(offset[0], offset[1], share=0.5)
    _as_far_as_it_goes(lambda: driver.shift(z=-down + 0.004, share=0.3))
    let_go(driver)
    left = attempt.read_scene().bodies.get(thing.name)
    if left is None:
        raise ManoeuvreError('{} is gone'.format(thing.name))
    _check_stands(left, place)


def carry(attempt: Attempt, thing: TrueBody, centre: np.ndarray) -> None:
    """Carry a thing until its centre is at (3,) m: up, then across, turning with the arm.

    :raises ManoeuvreError: where it is lost, or the hand does not get there.
    :raises StuckError: where the hand does not get there.
    """
    driver, arm = attempt.driver, attempt.driver.hand.arm
    rise = centre[2] - thing.centre[2]
    if rise > 0.02:
        driver.shift(z=rise, share=0.6)
    tool, now = driver.hand.tool(), _in_hand(attempt, arm).centre
    turn = _heading(centre, arm) - _heading(now, arm)
    goals = tuple(_carried(tool, now, centre, part * turn) for part in (1.0, 0.5, 0.0))
    _first_that_goes(driver, goals)
    _in_hand(attempt, arm)


def let_go(driver: HandDriver) -> None:
    """Open the gripper, and draw the hand back and up."""
    driver.open()
    driver.rest(5)
    _as_far_as_it_goes(lambda: driver.back(0.13, share=0.4))
    _as_far_as_it_goes(lambda: driver.shift(z=0.10))


def _carried(tool: np.ndarray, now: np.ndarray, centre: np.ndarray, turn: float) -> np.ndarray:
    """The tool's pose once the thing at `now` is at `centre`, turned by `turn` rad about z."""
    rotation = from_rpy((0, 0, 0), yaw=turn)[:3, :3]
    return transform(centre + rotation @ (tool[:3, 3] - now), rotation @ tool[:3, :3])


def _first_that_goes(driver: HandDriver, goals: Tuple[np.ndarray, ...]) -> None:
    for last, goal in enumerate(goals, 1 - len(goals)):
        try:
            driver.go(goal, share=0.7, near=(0.015, 0.1))
            return
        except StuckError:
            if last == 0:
                raise


def _heading(point: np.ndarray, arm: str) -> float:
    return float(np.arctan2(*(point[:2] - SHOULDER[arm])[::-1]))


def _in_hand(attempt: Attempt, arm: str) -> TrueBody:
    thing = attempt.read_scene().held_by(arm)
    if thing is None:
        raise ManoeuvreError('it was lost on the way')
    return thing


def _check_stands(thing: TrueBody, place: np.ndarray) -> None:
    beside = float(np.hypot(*(thing.centre - place)[:2]))
    if not thing.upright or beside > 0.05 or thing.held:
        raise ManoeuvreError('{} {} {:.0f} cm beside its place'.format(
            thing.name, 'stands' if thing.upright else 'lies', 100 * beside))


def _as_far_as_it_goes(drive: Callable[[], None]) -> None:
    """A motion that need not get all the way."""
    try:
        drive()
    except StuckError:
        return


def pull_out(attempt: Attempt, target: Callable[[TrueScene], Optional[TrueBody]]) -> None:
    """Take a thing out of a shelf: level, straight in, lifted a little, straight back.

    :raises ManoeuvreError: where it is not in the hand in the end.
    :raises StuckError: where the hand does not get there.
    """
    driver, arm = attempt.driver, attempt.driver.hand.arm
    scene = attempt.read_scene()
    if scene.held_by(arm) is None:
        thing = target(scene)
        if thing is None:
            raise ManoeuvreError('there is nothing to take')
        _reach_in(attempt, scene, thing)
    _as_far_as_it_goes(lambda: driver.shift(z=_OFF_SHELF, share=0.3))
    _as_far_as_it_goes(lambda: driver.shift(x=-OUT, share=0.4))
    if attempt.read_scene().held_by(arm) is None:
        raise ManoeuvreError('it slipped out of the hand')


def _reach_in(attempt: Attempt, scene: TrueScene, thing: TrueBody) -> None:
    driver = attempt.driver
    others = [other.box for other in scene.movable() if other.name != thing.name]
    level = grasps(thing.box, others, driver.hand.arm, _LEVEL)
    if not level:
        raise ManoeuvreError('{} is too wide for the hand'.format(thing.name))
    grasp = level[attempt.number % len(level)]
    grasp[:3, 3] += attempt.slip()
    driver.open()
    _as_far_as_it_goes(lambda: driver.shift(
        x=min(0.0, thing.centre[0] - OUT - driver.hand.tool()[0, 3]), share=0.5))
    _as_far_as_it_goes(lambda: driver.come_to(grasp[:3, 3] - [OUT, 0.0, -0.03]))
    driver.go(transform(grasp[:3, 3] - OUT * 0.7 * grasp[:3, 0], grasp[:3, :3]))
    driver.go(grasp, share=0.4, near=(0.006, 0.05))
    if not driver.close(_SQUEEZE).stalled or attempt.read_scene().held_by(driver.hand.arm) is None:
        driver.open()
        driver.back(OUT * 0.7)
        raise ManoeuvreError('the hand closed on nothing')
