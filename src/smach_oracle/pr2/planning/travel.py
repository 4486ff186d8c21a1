"""The arms while the base drives: compact, clear of doors and of the camera's view."""

from typing import Iterable, Mapping

import numpy as np

from smach_oracle.geometry.transforms import from_rpy, transform, yaw_of

from ..kitchen import MapBox
from ..robot import RobotError
from .arm import Arm, SkillContext, SkillError, Unreachable, encoder_readings, seed_of

# rad, the left hand folded before the chest, the right arm at the robot's side
TRAVEL = {
    'left': np.array([0.24, 1.24, 1.42, -1.89, -0.07, -1.98, 0.35]),
    'right': np.array([-1.6, 0.2, -1.5, -1.5, 0.5, -0.6, 0.0]),
}
NEAR_ENOUGH = 0.06  # rad
# m, m, rad: where the right hand carries
CARRIES = ((0.45, -0.38, -0.2), (0.45, -0.38, 0.2), (0.45, -0.32, -0.2), (0.48, -0.42, -0.5))
CARRY_HEIGHTS = (0.85, 1.00)  # m
CARRY_SPEED = 0.3


def stow(context: SkillContext, arms: Iterable[str], boxes: Mapping[str, MapBox]) -> None:
    """Take arms to their postures for driving.

    :param boxes: obstacles, in base_footprint.
    :raises SkillError: for an unknown arm, or where an arm does not get there.
    """
    for arm in arms:
        with Arm(context, arm, boxes, seed_of(arm, encoder_readings(context.robot))) as limb:
            if not is_stowed(limb):
                limb.go(TRAVEL[arm])


def is_stowed(limb: Arm) -> bool:
    """Whether an arm is in its posture for driving."""
    now = limb.now()
    return bool(np.abs(limb.chain.nearest_turn(TRAVEL[limb.name], now) - now).max() <= NEAR_ENOUGH)


def carry(limb: Arm, level: bool = True) -> None:
    """Take the hand to the robot's side, the elbow low and out of the camera's view.

    :param level: whether the hand is level in the end. If not, it is turned about the vertical
        alone, so that what it holds is as upright as it is now.
    :raises SkillError: where the arm does not get there.
    """
    now = limb.pose()
    height = min(max(float(now[2, 3]), CARRY_HEIGHTS[0]), CARRY_HEIGHTS[1])
    tilt = (
        np.eye(4)
        if level
        else transform(rotation=from_rpy((0, 0, 0), yaw=-yaw_of(now))[:3, :3] @ now[:3, :3])
    )
    for x, y, yaw in CARRIES:
        side = 1.0 if limb.name == 'right' else -1.0
        try:
            found = limb.reach(
                from_rpy((x, side * y, height), yaw=side * yaw) @ tilt, near=TRAVEL[limb.name]
            )
        except Unreachable:
            continue
        if found:
            limb.go(found[0], CARRY_SPEED, level=True)
            return
    raise SkillError('the {} arm cannot take what it holds to the side'.format(limb.name))


def draw_back(limb: Arm, length: float, touching: Iterable[str], speed: float) -> None:
    """Draw the hand back along its own axis, as far as there is a straight path.

    :param length: m, at most.
    :param touching: names of obstacles that the hand may touch meanwhile.
    :raises SkillError: where the arm does not follow it.
    """
    here = limb.pose()
    for share in (1.0, 0.7, 0.4):
        goal = here.copy()
        goal[:3, 3] -= share * length * here[:3, 0]
        with limb.space.touchable(touching):
            path = limb.line(limb.now(), goal)
        if path is not None:
            limb.follow(path, speed)
            return


def drive(context: SkillContext, odom_from_goal: np.ndarray) -> None:
    """Drive the base to a pose (4x4) in odom_combined.

    :raises SkillError: where it does not get there.
    """
    try:
        context.robot.drive(odom_from_goal)
    except RobotError as err:
        raise SkillError('the base did not get where it should: {}'.format(err)) from err
