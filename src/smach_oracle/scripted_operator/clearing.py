"""Moving things by hand that are in the way, or too far away: to where there is room."""

from typing import List, Optional, Tuple

import numpy as np

from .manoeuvres import Attempt, ManoeuvreError, Target, found, pick, put_down
from .seen_scene import SeenScene, SeenThing

CROWDED = 0.015  # m between two things that are too close to each other for a hand
ROOM = 0.15  # m between the middles of things, where each has room
SPOTS_X, SPOTS_Y = (0.50, 0.56, 0.62, 0.68), (0.05, 0.12, 0.19, 0.26, 0.33, 0.40)  # m, y outwards
# m from the middle of the place where something should stand: other things hinder the hand there
ABOUT_PLACE = 0.14
REACH = {'right': (-0.55, 0.27), 'left': (-0.27, 0.55)}  # m, y that an arm reaches on a table
FARTHEST = 0.82  # m from the shoulder
Spot = Tuple[float, float]


def gap_between(one: SeenThing, other: SeenThing) -> float:
    """m, in the plane, between two things as they are seen, or inf where nobody can tell."""
    if one.box is None or other.box is None:
        return float('inf')
    away = float(np.hypot(*(one.box.centre - other.box.centre)[:2]))
    return away - (one.box.narrow + one.box.wide + other.box.narrow + other.box.wide) / 4


def in_the_way(scene: SeenScene, thing: SeenThing) -> Optional[SeenThing]:
    """Return the thing so close to another one that a hand has no room, or None."""
    close = [
        (gap_between(thing, other), number)
        for number, other in enumerate(scene.things)
        if other.movable and other.name != thing.name
    ]
    gap, number = min(close, default=(float('inf'), -1))
    return scene.things[number] if gap < CROWDED else None


def on_place(scene: SeenScene, place: np.ndarray) -> Optional[SeenThing]:
    """Return the thing nearest to a place (3,) m at which another one should stand, or None."""
    beside = [
        (float(np.hypot(*(thing.box.centre - place)[:2])), number)
        for number, thing in enumerate(scene.things)
        if thing.movable and thing.box is not None and not thing.wanted
    ]
    away, number = min(beside, default=(float('inf'), -1))
    return scene.things[number] if away < ABOUT_PLACE else None


def free_spot(scene: SeenScene, arm: str, kept: List[np.ndarray], thing: str) -> Optional[Spot]:
    """Return a spot on the table where an arm can put a thing, with room around, or None.

    The spot whose y is nearest to 0.25 m on the arm's side comes first, and there the smallest x.

    :param kept: (3,) m, places that should stay free.
    """
    side = 1.0 if arm == 'left' else -1.0
    taken = [box.centre for box in scene.boxes_but(thing)] + kept
    for x, y in sorted(
        ((x, side * y) for x in SPOTS_X for y in SPOTS_Y),
        key=lambda spot: abs(spot[1] - side * 0.25),
    ):
        roomy = all(np.hypot(x - other[0], y - other[1]) > ROOM for other in taken)
        if roomy and scene.surface_at(np.array([x, y])) is not None:
            return x, y
    return None


def move_aside(attempt: Attempt, target: Target, about: np.ndarray, kept: List[np.ndarray]) -> str:
    """Take a thing and put it where there is room. Return its name.

    :param kept: (3,) m, places that should stay free.
    :raises ManoeuvreError: where it cannot be moved, or is lost.
    :raises StuckError: where the hand does not get there.
    """
    scene, thing = found(attempt, target, about)
    spot = free_spot(scene, attempt.driver.hand.arm, kept, thing.name)
    if spot is None or thing.box is None:
        raise ManoeuvreError('there is no room for {}'.format(thing.name))
    move_to(attempt, lambda seen: seen.named(thing.name), thing.box.centre, spot)
    return thing.name


def move_to(attempt: Attempt, target: Target, about: np.ndarray, spot: Spot) -> None:
    """Take a thing and put it down at a place x, y (m).

    :raises ManoeuvreError: where it cannot be moved, or is lost.
    :raises StuckError: where the hand does not get there.
    """
    pick(attempt, target, about)
    there = np.array([spot[0], spot[1], about[2]])
    surface = attempt.watcher.look_at(there).surface_at(there)
    put_down(attempt, there, surface)


def arm_for(point: np.ndarray, wanted: str = '') -> str:
    """The arm that reaches a place (3,) m on a table: `wanted`, if that one does."""
    for arm in (wanted, 'right' if point[1] < 0 else 'left'):
        low, high = REACH.get(arm, (0.0, 0.0))
        if low <= point[1] <= high:
            return arm
    return 'right' if point[1] < 0 else 'left'


def within_reach(point: np.ndarray, arm: str) -> bool:
    """Whether an arm takes something at a place (3,) m with ease."""
    low, high = REACH[arm]
    shoulder = np.array([-0.05, -0.19 if arm == 'right' else 0.19])
    return bool(low <= point[1] <= high and np.hypot(*(point[:2] - shoulder)) <= FARTHEST)
