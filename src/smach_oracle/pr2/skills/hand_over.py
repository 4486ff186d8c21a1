"""Hand a held object over: look for the palm that waits, set the object down on it, let go.

Where the program that asked for it was stopped, the hand may be on its way, or may have let go.
The skill looks for what an empty hand has set down.
"""

from typing import Dict, Optional

import numpy as np

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import points_of

from ..fingers import stands_open
from ..kitchen import MapBox
from ..perception.upright import UNKNOWN, StandingLook, why_not_standing
from ..planning.arm import (
    SLOW,
    Arm,
    SkillContext,
    SkillError,
    encoder_readings,
    lifted,
    seed_of,
)
from ..planning.travel import carry, draw_back, stow
from .pick import HeldObject
from .place import RETREAT, HoldsNothing, place

PALM = 'palm'
NEAR = 0.16  # m around the place where the palm is expected, horizontally
LEVEL = 0.06  # m, vertically
LEAST_POINTS = 150
LEAST_EXTENT = 0.09  # m that a palm extends. A sleeve is narrower
LEAST_HALF = 0.11  # m: part of it may be hidden
THICK = 0.03  # m of a hand
COLUMNS = 320  # that are looked at
BESIDE = 0.28  # m between a hand and the palm that it hides, horizontally
UP = 0.10  # m, straight up from a palm
LEAST_TOP = 40  # points


def hand_over(
    context: SkillContext,
    arm: str,
    expected: np.ndarray,
    held: HeldObject,
    look: StandingLook = UNKNOWN,
) -> None:
    """Set the held object down on a palm. An empty one succeeds where it is seen to stand there.

    :param expected: (3,) m in base_footprint, the middle of the palm's upper face, right to some
        0.1 m.
    :param look: the looks of the object while it stood.
    :raises SkillError: where no palm is seen, the object cannot be brought there, or it does not
        stand there then.
    """
    context.robot.look_at(expected)
    if stands_open(encoder_readings(context.robot), arm):
        if _is_given(context, arm, expected, held, look):
            return
    else:
        _clear_view(context, arm, expected, held)
    palm = find_palm(context.robot.see(), expected)
    boxes = {PALM: palm}
    top = palm.centre + [0.0, 0.0, palm.half[2]]
    try:
        stood = place(context, arm, top + [0.0, 0.0, held.half[2]], held, boxes, PALM, gently=True)
    except HoldsNothing:
        if _is_given(context, arm, expected, held, look):
            return
        raise
    boxes['given'] = MapBox(stood, held.half, 0.0)
    stow(context, (arm,), boxes)
    why = why_not_standing(context.robot.see(), stood, held.half, look=look)
    if why:
        raise SkillError('it was let go on the palm, but ' + why)


def _is_given(
    context: SkillContext,
    arm: str,
    expected: np.ndarray,
    held: HeldObject,
    look: StandingLook,
) -> bool:
    """Take an empty hand away from a palm, and look whether the object stands there."""
    boxes = _about_palm(expected)
    with Arm(context, arm, boxes, seed_of(arm, expected)) as hand:
        if _beside(hand, expected):
            draw_back(hand, RETREAT, boxes, SLOW)
    stow(context, (arm,), boxes)
    image = context.robot.see()
    top = middle_of_top(image, expected, 2 * float(held.half[2]))
    if top is None:
        return False
    return not why_not_standing(image, top - [0.0, 0.0, held.half[2]], held.half, look=look)


def _clear_view(context: SkillContext, arm: str, expected: np.ndarray, held: HeldObject) -> None:
    """Take a hand that was stopped above a palm up and to the side, with what it holds."""
    boxes = _about_palm(expected)
    with Arm(context, arm, boxes, seed_of(arm, expected)) as hand:
        if not _beside(hand, expected):
            return
        hand.close(held.effort)
        with hand.space.touchable(boxes):
            path = hand.line(hand.now(), lifted(hand.pose(), UP))
        if path is not None:
            hand.follow(path, SLOW)
        hand.space.attach(held.half, held.tool_from_object)
        carry(hand)


def _beside(hand: Arm, expected: np.ndarray) -> bool:
    return float(np.hypot(*(hand.pose()[:3, 3] - expected)[:2])) < BESIDE


def _about_palm(expected: np.ndarray) -> Dict[str, MapBox]:
    """A palm that has not been seen, as low as it may be."""
    return {
        PALM: MapBox(
            expected - [0.0, 0.0, LEVEL + THICK / 2],
            np.array([LEAST_HALF, LEAST_HALF, THICK / 2]),
            0.0,
        )
    }


def middle_of_top(image: CameraImage, expected: np.ndarray, height: float) -> Optional[np.ndarray]:
    """The middle (3,) of the top of what stands on a palm, in m in base_footprint.

    :param expected: as for hand_over().
    :param height: m, of what stands there, right to some LEVEL.
    :returns: None where nothing as high is seen.
    """
    points = _near(image, expected + [0.0, 0.0, height])
    if len(points) < LEAST_TOP:
        return None
    top = float(np.percentile(points[:, 2], 95))
    return np.append(np.median(points[points[:, 2] > top - 0.015, :2], axis=0), top)


def find_palm(image: CameraImage, expected: np.ndarray) -> MapBox:
    """The palm in an image, as a box in base_footprint.

    :param expected: (3,) m in base_footprint, as for hand_over().
    :raises SkillError: where there is none near.
    """
    points = _near(image, expected)
    if len(points) < LEAST_POINTS:
        raise SkillError(
            'no hand waits where it should: {} points within {:.0f} cm of it'.format(
                len(points), 100 * NEAR
            )
        )
    # a palm that is held out lies higher than the arm behind it
    height = float(np.percentile(points[:, 2], 90))
    level = points[np.abs(points[:, 2] - height) < 0.015]
    low, high = np.percentile(level[:, :2], [2, 98], axis=0)
    if np.min(high - low) < LEAST_EXTENT:
        raise SkillError(
            'what is where the hand should wait is too small for one: {:.0f} x {:.0f} cm'.format(
                *(100 * (high - low))
            )
        )
    centre = (low + high) / 2
    return MapBox(
        np.array([centre[0], centre[1], height - THICK / 2]),
        np.array([*np.maximum((high - low) / 2, LEAST_HALF), THICK / 2]),
        0.0,
    )


def _near(image: CameraImage, expected: np.ndarray) -> np.ndarray:
    """(n, 3): what an image shows about a point, in base_footprint."""
    stride = image.stride(COLUMNS)
    points = points_of(
        image.depth[::stride, ::stride], image.intrinsics, image.base_from_camera, stride=stride
    )
    points = points.reshape(-1, 3)
    with np.errstate(invalid='ignore'):
        near = (np.hypot(*(points[:, :2] - expected[:2]).T) < NEAR) & (
            np.abs(points[:, 2] - expected[2]) < LEVEL
        )
    return points[near]
