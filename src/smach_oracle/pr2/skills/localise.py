"""Set right where the robot believes to stand: look at the refrigerator, whose place it knows."""

from typing import NamedTuple

import numpy as np

from smach_oracle.geometry.transforms import apply, from_rpy, inverse, yaw_of

from ..kitchen import Kitchen, base_from_fridge, odom_from_pose
from ..perception.door_view import DoorNotSeen
from ..perception.fridge_pose import find_fridge
from ..planning.arm import SkillContext, SkillError, summary
from ..robot import RobotError
from .door import DOOR_LOOK, stand_before

LOOKS = 2  # from different head poses
# m along its depth, at which the refrigerator is looked for in an image: a map fits within some
# 0.1 m, and a localisation may be wrong by more
SHIFTS = (0.0, 0.12, -0.12)
ASIDE = np.array([0.10, -0.20, 0.10])  # m, in the fridge's frame: where the second look goes
FARTHEST, MOST_TURNED = 0.35, 0.12  # m, rad: a correction beyond that is taken for a mistake


class Correction(NamedTuple):
    """The error of the robot's localisation, along its own axes."""

    x: float  # m
    y: float  # m
    yaw: float  # rad


def localise_at_fridge(context: SkillContext, kitchen: Kitchen) -> Correction:
    """Drive to where the door is opened, look at the refrigerator, and tell the localisation.

    :raises SkillError: where it is not seen, the map does not fit, or the base does not get there.
    """
    stand_before(context, kitchen)
    robot = context.robot
    believed = robot.odom_from_base()
    expected = base_from_fridge(kitchen, believed)
    found = odom_from_pose(kitchen, 0.0, 0.0, 0.0) @ inverse(_seen(context, kitchen, expected))
    wrong = inverse(believed) @ found
    correction = Correction(float(wrong[0, 3]), float(wrong[1, 3]), float(yaw_of(wrong)))
    if np.hypot(*correction[:2]) > FARTHEST or abs(correction.yaw) > MOST_TURNED:
        raise SkillError(
            'the refrigerator is seen {:.0f} cm and {:.0f} degrees from where it should be: that '
            'cannot be'.format(100 * np.hypot(*correction[:2]), np.degrees(correction.yaw))
        )
    try:
        robot.localise(found)
    except RobotError as err:
        raise SkillError(str(err)) from err
    return correction


def _seen(context: SkillContext, kitchen: Kitchen, expected: np.ndarray) -> np.ndarray:
    """4x4, base from fridge, by a look at its front, or a second one from another head pose."""
    reasons = []
    for look in range(LOOKS):
        context.robot.look_at(apply(expected, DOOR_LOOK + look * ASIDE))
        image = context.robot.see()
        for shift in SHIFTS:
            moved = expected @ from_rpy((shift, 0.0, 0.0))
            try:
                return find_fridge(image, kitchen, moved).base_from_fridge
            except DoorNotSeen as err:
                reasons.append(str(err))
    raise SkillError('where the refrigerator stands cannot be seen: {}'.format(summary(reasons)))
