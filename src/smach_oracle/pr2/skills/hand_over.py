"""Hand a held object over: look for the palm that waits, set the object down on it, let go."""
import numpy as np

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import points_of

from ..kitchen import MapBox
from ..planning.arm import SkillContext, SkillError
from ..planning.travel import stow
from .pick import HeldObject
from .place import place, stands_there

PALM = 'palm'
NEAR = 0.16  # m around the place where the palm is expected, horizontally
LEVEL = 0.06  # m, vertically
LEAST_POINTS = 150
LEAST_EXTENT = 0.09  # m that a palm extends; a sleeve is narrower
LEAST_HALF = 0.11  # m: part of it may be hidden
THICK = 0.03  # m of a hand
COLUMNS = 320  # that are looked at


def hand_over(context: SkillContext, arm: str, expected: np.ndarray, held: HeldObject) -> None:
    """Set the held object down on a palm.

    :param expected: (3,) m in base_footprint, the middle of the palm's upper face, right to some
        0.1 m.
    :raises SkillError: where no palm is seen, the object cannot be brought there, or it does not
        stand there then.
    """
    context.robot.look_at(expected)
    palm = find_palm(context.robot.see(), expected)
    boxes = {PALM: palm}
    top = palm.centre + [0.0, 0.0, palm.half[2]]
    stood = place(context, arm, top + [0.0, 0.0, held.half[2]], held, boxes, PALM)
    boxes['given'] = MapBox(stood, held.half, 0.0)
    stow(context, (arm,), boxes)
    if not stands_there(context.robot.see(), stood, held):
        raise SkillError('it was let go, but it does not stand in the hand')


def find_palm(image: CameraImage, expected: np.ndarray) -> MapBox:
    """The palm in an image, as a box in base_footprint.

    :param expected: (3,) m in base_footprint, as for hand_over().
    :raises SkillError: where there is none near.
    """
    stride = image.stride(COLUMNS)
    points = points_of(image.depth[::stride, ::stride], image.intrinsics, image.base_from_camera,
                       stride=stride)
    points = points.reshape(-1, 3)
    with np.errstate(invalid='ignore'):
        near = ((np.hypot(*(points[:, :2] - expected[:2]).T) < NEAR) &
                (np.abs(points[:, 2] - expected[2]) < LEVEL))
    points = points[near]
    if len(points) < LEAST_POINTS:
        raise SkillError('no hand waits where it should: {} points within {:.0f} cm of it'.format(
            len(points), 100 * NEAR))
    # a palm that is held out lies higher than the arm behind it
    height = float(np.percentile(points[:, 2], 90))
    level = points[np.abs(points[:, 2] - height) < 0.015]
    low, high = np.percentile(level[:, :2], [2, 98], axis=0)
    if np.min(high - low) < LEAST_EXTENT:
        raise SkillError(
            'what is where the hand should wait is too small for one: {:.0f} x {:.0f} cm'.format(
                *(100 * (high - low))))
    centre = (low + high) / 2
    return MapBox(np.array([centre[0], centre[1], height - THICK / 2]),
                  np.array([*np.maximum((high - low) / 2, LEAST_HALF), THICK / 2]), 0.0)
