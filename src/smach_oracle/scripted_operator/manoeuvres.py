"""Work by hand in place of the robot: take a thing, put it down."""

from typing import Callable, List, NamedTuple, Optional, Protocol, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import from_rpy, transform

from .hand_driver import HandDriver, StuckError
from .seen_scene import SeenScene, SeenThing

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
_WAYS = 3  # of taking a thing, that are tried one after the other, where the arm gets stuck
_OFF_SHELF = 0.03  # m that a thing is lifted inside a shelf
_GRIP = 100.0  # N, on a table
_SQUEEZE = 90.0  # N: the robot, which grips with less, may have lost it before
OUT = 0.28  # m straight back out of a shelf

HELD = (0.006, 0.079)  # m between the tips, where there is something between them
HALF_TALL = 0.06  # m, of a thing of which nothing is seen in the hand
UNTIL_IT_TOUCHES = 0.06  # m that a hand is lowered at most until what it holds touches
IN_HAND = 0.13  # m from the tool to the middle of what is in the hand
FAR = 0.95  # m from the shoulder, which no hand reaches


class Watcher(Protocol):
    """A person's eyes and touch while they drive a hand."""

    def look_at(self, point: np.ndarray, *names: str) -> SeenScene:
        """Turn the head to a point (3,) m, base_footprint, and look.

        :param names: of furniture that is looked for besides the things.
        """

    def gap(self, arm: str) -> float:
        """m between the finger tips of an arm."""

    def tall(self, name: str) -> Optional[float]:
        """Return how tall a thing is (m), where it was seen standing in this trial, or None."""


class ManoeuvreError(Exception):
    """A manoeuvre did not work. The text says what came of it."""


class Attempt(NamedTuple):
    """One try at a state's work by hand."""

    driver: HandDriver
    watcher: Watcher
    number: int  # of tries before this one
    slip: Callable[[], np.ndarray]  # (3,) m, by how much a person misjudges a place

    @property
    def holds(self) -> bool:
        """Whether there is something between the fingers."""
        return HELD[0] < self.watcher.gap(self.driver.hand.arm) < HELD[1]

    def feels(self, effort: float) -> bool:
        """Whether the hand still holds something once it is closed with `effort` N.

        Fingers that stand half open show the same gap as fingers with a thing between them.
        """
        return self.holds and self.driver.close(effort).stalled and self.holds


Target = Callable[[SeenScene], Optional[SeenThing]]


def found(attempt: Attempt, target: Target, about: np.ndarray) -> Tuple[SeenScene, SeenThing]:
    """A thing, and all that is seen, with the head turned to it.

    :param about: (3,) m, where it is looked for first.
    :raises ManoeuvreError: where it is not seen, or nobody can tell where it is.
    """
    thing = None
    for _ in range(2):
        scene = attempt.watcher.look_at(about)
        thing = target(scene)
        if thing is None or thing.box is None:
            break
        about = thing.box.centre
    if thing is None or thing.box is None:
        raise ManoeuvreError('there is nothing to take: it cannot be seen')
    return scene, thing


def pick(attempt: Attempt, target: Target, about: np.ndarray) -> None:
    """Take a thing and lift it.

    :param target: finds it in what is seen.
    :param about: (3,) m, where it is looked for.
    :raises ManoeuvreError: where it is not in the hand in the end.
    :raises StuckError: where the hand does not get there.
    """
    if not attempt.feels(_GRIP):
        scene, thing = found(attempt, target, about)
        fetch(
            attempt,
            thing.bottom + float(_box(thing).size[2]),
            _grasps_to_try(attempt, scene, thing),
        )
    lift(attempt)


def lift(attempt: Attempt) -> None:
    """Lift what the hand has closed on.

    :raises ManoeuvreError: where it is not in the hand in the end.
    :raises StuckError: where the hand does not get there.
    """
    attempt.driver.shift(z=LIFT, share=0.5)
    attempt.driver.rest(10)
    if not attempt.holds:
        raise ManoeuvreError('it slipped out of the hand')


def fetch(
    attempt: Attempt, top: float, ways: Sequence[np.ndarray], until_it_touches: bool = False
) -> None:
    """Close the hand on a thing.

    :param top: m, how high it is.
    :param ways: poses of the hand (4x4, base_footprint from tool), tried one after the other where
        the arm gets stuck.
    :param until_it_touches: the last bit goes as far as it goes: the hand comes from above.
    :raises ManoeuvreError: where nothing is between the fingers then.
    :raises StuckError: where the hand does not get there.
    """
    driver = attempt.driver
    driver.open()
    for last, grasp in enumerate(ways, 1 - len(ways)):
        come_out(driver, top)
        try:
            _approach(driver, grasp, top, until_it_touches)
            break
        except StuckError:
            if last == 0:
                raise
    grip = driver.close(_GRIP)
    if not grip.stalled or not attempt.holds:
        driver.open()
        driver.back(BEFORE)
        raise ManoeuvreError('the hand closed on nothing')


def _approach(driver: HandDriver, grasp: np.ndarray, top: float, until_it_touches: bool) -> None:
    """Bring the open hand around a thing: above the place before it, down, and straight in."""
    before = transform(grasp[:3, 3] - BEFORE * grasp[:3, 0], grasp[:3, :3])
    above = before.copy()
    above[2, 3] = max(above[2, 3], top + 0.10)
    driver.go(above, near=(0.04, 0.2))
    driver.go(before)
    try:
        driver.go(grasp, share=0.4, near=(0.006, 0.05))
    except StuckError:
        if not until_it_touches:
            raise


def _grasps_to_try(
    attempt: Attempt, scene: SeenScene, thing: SeenThing, pitches: Sequence[float] = _PITCHES
) -> List[np.ndarray]:
    """Return how the hand takes a thing: another way at each try, and misjudged a little.

    :returns: _WAYS of them, perhaps the same again.
    :raises ManoeuvreError: where there is no way.
    """
    arm, box = attempt.driver.hand.arm, _box(thing)
    if float(np.hypot(*(box.centre[:2] - SHOULDER[arm]))) > FAR:
        raise ManoeuvreError('{} is out of reach'.format(thing.name))
    ways = grasps(box, scene.boxes_but(thing.name), arm, pitches)
    if not ways:
        raise ManoeuvreError('{} is too wide for the hand'.format(thing.name))
    chosen = [ways[(_WAYS * attempt.number + number) % len(ways)].copy() for number in range(_WAYS)]
    missed = attempt.slip()
    for grasp in chosen:
        grasp[:3, 3] += missed
    return chosen


def _box(thing: SeenThing) -> UprightBox:
    if thing.box is None:
        raise ManoeuvreError('nobody can tell where {} is'.format(thing.name))
    return thing.box


def come_out(driver: HandDriver, height: float) -> None:
    """Take the hand out from among things: back, up over `height` m, and before the chest."""
    tool = driver.hand.tool()
    if tool[0, 3] > 0.45 and tool[2, 3] < height + 0.12:
        as_far_as_it_goes(lambda: driver.back(0.10))
        as_far_as_it_goes(lambda: driver.shift(z=height + 0.15 - tool[2, 3]))
    elif tool[2, 3] < height + 0.05:
        as_far_as_it_goes(lambda: driver.shift(z=height + 0.10 - tool[2, 3]))
    driver.come_to(
        READY[driver.hand.arm] + [0.0, 0.0, max(0.0, height + 0.1 - READY[driver.hand.arm][2])]
    )


def grasps(
    thing: UprightBox, others: List[UprightBox], arm: str, pitches: Sequence[float] = _PITCHES
) -> List[np.ndarray]:
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
        pose[:3, 3] = [*thing.centre[:2], height]
        pose[:2, 3] += ahead * pose[:2, 0] / max(float(np.linalg.norm(pose[:2, 0])), 0.2)
        crowded = sum(max(0.0, CLEAR_OF - _beside(pose, other)) for other in others)
        found.append(
            (
                20.0 * crowded * np.cos(pitch) + abs(turn) + 0.4 * abs(pitch - pitches[0]),
                order,
                pose,
            )
        )
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


class InHand(NamedTuple):
    """A thing in the hand, as far as it is seen."""

    centre: np.ndarray  # (3,) m
    half: float  # m from its middle down to its lowest point
    name: str  # '': nothing of it is seen


def put_down(attempt: Attempt, place: np.ndarray, surface: Optional[float]) -> None:
    """Put what the hand holds down upright.

    :param place: (3,) m, where its centre should be, in base_footprint. It comes to stand on
        what is below.
    :param surface: m, how high that is. None means as far as the hand gets.
    :raises ManoeuvreError: where it does not stand there in the end.
    :raises StuckError: where the hand does not get there.
    """
    driver = attempt.driver
    if not attempt.feels(_GRIP):
        raise ManoeuvreError('the hand holds nothing')
    held = _look_at_hand(attempt)
    level = surface if surface is not None else float(place[2]) - held.half
    _carry(attempt, held, np.array([place[0], place[1], level + held.half + 0.10]))
    if not attempt.holds:
        raise ManoeuvreError('it was lost on the way')
    held = _look_at_hand(attempt)
    offset = (place - held.centre)[:2] + attempt.slip()[:2]
    driver.shift(offset[0], offset[1], share=0.5)
    down = float(held.centre[2]) - held.half - level
    as_far_as_it_goes(lambda: driver.shift(z=0.02 - down, share=0.5))
    # until it touches: its lower end is hidden by the hand
    as_far_as_it_goes(lambda: driver.shift(z=-UNTIL_IT_TOUCHES, share=0.1))
    let_go(driver)
    _check_stands(attempt, held.name, place)


def wrong_thing(attempt: Attempt) -> str:
    """The name of what is seen in the hand, where that is another thing than the wanted one."""
    tool = attempt.driver.hand.tool()[:3, 3]
    scene = attempt.watcher.look_at(tool)
    held = scene.near(tool, IN_HAND)
    known = any(thing.wanted for thing in scene.things)
    return held.name if held is not None and not held.wanted and known else ''


def _look_at_hand(attempt: Attempt) -> InHand:
    """Return what the hand holds: between its fingers, as high as seen, as tall as it stood."""
    tool = attempt.driver.hand.tool()[:3, 3]
    thing = attempt.watcher.look_at(tool).near(tool, IN_HAND)
    if thing is None or thing.box is None:
        return InHand(tool, HALF_TALL, '')
    half = (attempt.watcher.tall(thing.name) or 2 * HALF_TALL) / 2
    high = thing.bottom + float(thing.box.size[2])
    return InHand(np.array([tool[0], tool[1], high - half]), half, thing.name)


def _carry(attempt: Attempt, held: InHand, centre: np.ndarray) -> None:
    """Carry what is held until its centre is at (3,) m: up, then across, turning with the arm.

    :raises StuckError: where the hand does not get there.
    """
    driver, arm = attempt.driver, attempt.driver.hand.arm
    rise = float(centre[2] - held.centre[2])
    now = held.centre
    if rise > 0.02:
        driver.shift(z=rise, share=0.6)
        now = now + [0.0, 0.0, rise]
    tool = driver.hand.tool()
    turn = _heading(centre, arm) - _heading(now, arm)
    goals = tuple(_carried(tool, now, centre, part * turn) for part in (1.0, 0.5, 0.0))
    _first_that_goes(driver, goals)


def let_go(driver: HandDriver) -> None:
    """Open the gripper, and draw the hand back and up."""
    driver.open()
    driver.rest(5)
    as_far_as_it_goes(lambda: driver.back(0.13, share=0.4))
    as_far_as_it_goes(lambda: driver.shift(z=0.10))


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


def _check_stands(attempt: Attempt, name: str, place: np.ndarray) -> None:
    """Look whether a thing stands at its place. What is not seen is taken to stand there."""
    thing = attempt.watcher.look_at(place).named(name)
    if thing is None or thing.box is None:
        return
    beside = float(np.hypot(*(thing.box.centre - place)[:2]))
    if beside > 0.05:
        raise ManoeuvreError('{} is {:.0f} cm beside its place'.format(name, 100 * beside))
    if thing.lies(attempt.watcher.tall(name)):
        raise ManoeuvreError('{} lies at its place'.format(name))


def as_far_as_it_goes(drive: Callable[[], None]) -> None:
    """A motion that need not get all the way."""
    try:
        drive()
    except StuckError:
        return


def pull_out(attempt: Attempt, target: Target, about: np.ndarray) -> None:
    """Take a thing out of a shelf: level, straight in, lifted a little, straight back.

    :param target: finds it in what is seen.
    :param about: (3,) m, where it is looked for.
    :raises ManoeuvreError: where it is not in the hand in the end.
    :raises StuckError: where the hand does not get there.
    """
    driver = attempt.driver
    if not attempt.feels(_SQUEEZE):
        _reach_in(attempt, *found(attempt, target, about))
    as_far_as_it_goes(lambda: driver.shift(z=_OFF_SHELF, share=0.3))
    as_far_as_it_goes(lambda: driver.shift(x=-OUT, share=0.4))
    if not attempt.holds:
        raise ManoeuvreError('it slipped out of the hand')


def _reach_in(attempt: Attempt, scene: SeenScene, thing: SeenThing) -> None:
    driver, centre = attempt.driver, _box(thing).centre
    grasp = _grasps_to_try(attempt, scene, thing, _LEVEL)[0]
    driver.open()
    as_far_as_it_goes(
        lambda: driver.shift(x=min(0.0, centre[0] - OUT - driver.hand.tool()[0, 3]), share=0.5)
    )
    as_far_as_it_goes(lambda: driver.come_to(grasp[:3, 3] - [OUT, 0.0, -0.03]))
    driver.go(transform(grasp[:3, 3] - OUT * 0.7 * grasp[:3, 0], grasp[:3, :3]))
    driver.go(grasp, share=0.4, near=(0.006, 0.05))
    if not driver.close(_SQUEEZE).stalled or not attempt.holds:
        driver.open()
        driver.back(OUT * 0.7)
        raise ManoeuvreError('the hand closed on nothing')
