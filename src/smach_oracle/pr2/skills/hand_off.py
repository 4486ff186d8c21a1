"""Take a hand away from the refrigerator's door, where a skill failed, or was stopped.

A robot that is told to stop does nothing more. So a hand may still hold the handle, stand around
it, or stand behind the door. An arm that is stowed from there is held up by the door, or pulls at
it.
"""

import numpy as np

from smach_oracle.geometry.transforms import apply, from_rpy, inverse, yaw_of

from ..fingers import fingers_gap
from ..kitchen import Kitchen, base_from_fridge, odom_from_pose
from ..planning.arm import SLOW, Arm, SkillContext, SkillError, encoder_readings, seed_of
from ..planning.travel import draw_back, drive, is_stowed
from ..robot import ARMS, RobotError
from .at_door import BEFORE

OFF = 0.10  # m that the base takes the hand back from the bar: there may be somebody behind it
AWAY_FOR_GOOD = 0.40  # m, after a failure
# x and y of the base, m in the fridge's frame: there may be people behind, with a hand held out
FARTHEST_BACK, FARTHEST_LEFT = -1.30, 0.0
# m between the tips that lets go of the bar. There is no room for more between bar and door
RELEASE = 0.045
ABOUT_DOOR = 0.25  # m beyond the door's edge, from the hinge, where a hand may touch bar or door


def step_back(context: SkillContext, length: float) -> None:
    """Drive straight back by `length` m.

    :raises SkillError: where the base does not get there.
    """
    drive(context, context.robot.odom_from_base() @ from_rpy((-length, 0.0, 0.0)))


def take_hands_off(context: SkillContext, kitchen: Kitchen) -> bool:
    """Take each hand that is about the door away from it, and the base back. Arms stay as they are.

    A hand with a gap of less than RELEASE may hold the bar, so it is opened. It holds no drink, for
    these are wider.

    :returns: whether there was one.
    :raises SkillError: where a gripper or the base does not get there.
    """
    was_there = False
    for arm in ARMS:
        with Arm(context, arm, {}, seed_of(arm, encoder_readings(context.robot))) as limb:
            if is_stowed(limb) or not _is_about_door(context, kitchen, limb.pose()):
                continue
            was_there = True
            if fingers_gap(encoder_readings(context.robot), arm) < RELEASE:
                _let_go(context, arm)
            try:
                draw_back(limb, BEFORE, (), SLOW)  # the way that the hand has come
                go_away(context, kitchen)
            except SkillError:  # it is hooked on something, and may have come off it by now
                withdraw(context, limb, BEFORE)
                go_away(context, kitchen)
    return was_there


def withdraw(context: SkillContext, limb: Arm, length: float) -> None:
    """Drive a hand back along its own axis by `length` m, also sideways.

    A base that is held up has not failed yet.
    """
    ahead = limb.pose()[:2, 0]
    back = -length * ahead / max(float(np.hypot(*ahead)), 0.1)
    try:
        drive(context, context.robot.odom_from_base() @ from_rpy((*back, 0.0)))
    except SkillError:
        pass


def go_away(context: SkillContext, kitchen: Kitchen) -> None:
    """Drive back by AWAY_FOR_GOOD, but not among what stands behind the robot and to its left."""
    before = context.robot.odom_from_base()
    here = inverse(base_from_fridge(kitchen, before))
    length = min(AWAY_FOR_GOOD, max(OFF, float(here[0, 3]) - FARTHEST_BACK))
    drive(
        context,
        odom_from_pose(
            kitchen, float(here[0, 3]) - length, min(float(here[1, 3]), FARTHEST_LEFT), yaw_of(here)
        ),
    )


def _let_go(context: SkillContext, arm: str) -> None:
    """Open a gripper, as far as bar and door let it.

    :raises SkillError: where the gripper fails.
    """
    try:
        context.robot.gripper(arm, RELEASE)
    except RobotError as err:
        raise SkillError('the {} gripper: {}'.format(arm, err)) from err


def _is_about_door(context: SkillContext, kitchen: Kitchen, tool: np.ndarray) -> bool:
    """Whether a hand (4x4, base_footprint from tool) is where the door or its handle may be."""
    fridge = base_from_fridge(kitchen, context.robot.odom_from_base())
    hand = apply(inverse(fridge), tool[:3, 3])
    from_hinge = float(np.hypot(hand[0], hand[1] - kitchen.width / 2))
    return bool(
        hand[0] < 0.0
        and hand[2] < kitchen.height
        and from_hinge < kitchen.width + kitchen.handle_stand_off + ABOUT_DOOR
    )
