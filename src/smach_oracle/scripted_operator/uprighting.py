"""Work by hand with a thing that lies: taken from above, along its own axis, and held upright."""

from typing import List

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import from_rpy, transform

from .manoeuvres import (
    SHOULDER,
    WIDEST,
    Attempt,
    ManoeuvreError,
    Target,
    fetch,
    found,
    lift,
    put_down,
)

_DOWN = (np.pi / 2, 1.35)  # rad, of the hand that takes a thing which lies
_ABOVE = 0.030  # m from what it lies on to the middle between the finger tips
_RAISED = 0.10  # m by which the hand is lifted further before it turns level


def take_upright(attempt: Attempt, target: Target, about: np.ndarray) -> np.ndarray:
    """Take a thing that lies, lift it, and turn the hand level: then the thing is upright.

    Nobody sees which of its ends was the upper one.

    :param target: finds it in what is seen.
    :param about: (3,) m, where it is looked for.
    :returns: (3,) m, where it lay.
    :raises ManoeuvreError: where it cannot be taken so, or is not in the hand in the end.
    :raises StuckError: where the hand does not get there.
    """
    driver = attempt.driver
    _, thing = found(attempt, target, about)
    if thing.box is None or thing.box.narrow > WIDEST:
        raise ManoeuvreError('{} is too wide for the hand'.format(thing.name))
    ways = lying_grasps(thing.box, driver.hand.arm)
    missed = attempt.slip()
    for way in ways:
        way[:3, 3] += missed
    fetch(attempt, thing.bottom + float(thing.box.size[2]), ways, until_it_touches=True)
    lift(attempt)
    tool = driver.hand.tool()
    pitch = float(np.arcsin(np.clip(-tool[2, 0], -1.0, 1.0)))
    turned = level(tool, _straight(tool[:2, 3], driver.hand.arm), np.pi / 2 - pitch)
    turned[2, 3] += _RAISED
    driver.go(turned, share=0.6, near=(0.03, 0.08))
    if not attempt.holds:
        raise ManoeuvreError('it slipped out of the hand as it was turned')
    return np.array(thing.box.centre)


def set_upright(attempt: Attempt, target: Target, about: np.ndarray) -> None:
    """Set a thing that lies upright, where it lies.

    :raises ManoeuvreError: where it does not stand there in the end.
    :raises StuckError: where the hand does not get there.
    """
    place = take_upright(attempt, target, about)
    put_down(attempt, place, attempt.watcher.look_at(place).surface_at(place))


def lying_grasps(box: UprightBox, arm: str) -> List[np.ndarray]:
    """Poses (4x4, base_footprint from tool) from above, the fingers across a thing that lies.

    The hand is turned along the thing, to the side that is more straight ahead.
    """
    straight = _straight(box.centre[:2], arm)
    heading = min(
        (box.yaw + half * np.pi for half in (-1, 0, 1)), key=lambda yaw: abs(yaw - straight)
    )
    found_ways = []
    for pitch in _DOWN:
        pose = from_rpy((0, 0, 0), pitch=pitch, yaw=heading)
        pose[:3, 3] = box.centre
        pose[2, 3] = box.centre[2] - box.size[2] / 2 + max(_ABOVE, box.size[2] / 2)
        found_ways.append(pose)
    return found_ways


def level(tool: np.ndarray, heading: float, tilt: float) -> np.ndarray:
    """The tool's pose (4x4), turned to be level where it is, ahead along `heading` rad.

    :param tilt: rad by which it then points up: as far as it did not point straight down before.
    """
    return transform(tool[:3, 3], from_rpy((0, 0, 0), pitch=-tilt, yaw=heading)[:3, :3])


def _straight(place: np.ndarray, arm: str) -> float:
    return float(np.arctan2(*(place - SHOULDER[arm])[::-1]))
