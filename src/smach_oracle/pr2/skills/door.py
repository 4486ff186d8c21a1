"""Open and close the refrigerator by contact: by the handle, or with the hand against the door.

Many a door falls shut unless it is open past a stop. So the hand holds the handle until the door is
wide open: where the arm gets no farther, the base takes it along. In the end the camera looks
whether the door stays open.
"""

from contextlib import contextmanager
from typing import Iterator

import numpy as np

from smach_oracle.geometry.transforms import apply, from_rpy, inverse, yaw_of

from ..kitchen import Kitchen, base_from_fridge, door_angle_at, handle_point, odom_from_pose
from ..perception.door_view import DoorView
from ..planning.arm import Arm, SkillContext, SkillError, encoder_readings, known_arm, seed_of
from ..planning.travel import carry, draw_back, drive, stow
from ..robot import ARMS, FINGER_JOINTS, GRIPPER_OPEN
from .at_door import (
    APPROACH_SPEED,
    BEFORE,
    BERTH,
    STEP,
    against,
    approach_to,
    arm_at,
    is_beside,
    look,
    named_boxes,
    place_door,
    relax,
    strain,
    swing_along,
)
from .hand_off import (
    AWAY_FOR_GOOD,
    OFF,
    RELEASE,
    go_away,
    step_back,
    take_hands_off,
    withdraw,
)

# x, y in m and yaw in rad of the base, in the fridge's frame
OPENING = (-0.98, 0.02, 0.0)
CLEAR = (-1.00, -0.14, 0.0)  # beside the open door's edge, ready to drive in
CLOSING = (-0.92, -0.30, 0.0)

AJAR = np.radians(42.0)  # from here on there is room for a hand behind it: it is pushed
PULLED = np.radians(68.0)  # as far as the handle is pulled. The hand goes on from inside
WIDE = np.radians(95.0)  # as far as the door is opened
PRESS = 0.05  # m that the base presses the door shut, for the hand may be off by some degrees
OFF_DOOR = 0.25  # m that the base takes the hand back from a door that it has pushed shut
AHEAD = 0.52  # m before the robot's middle: a hand there may be in the door's way
# m ahead at least, m to its side at most: a hand there is in the other arm's way
BEFORE_CHEST = (0.30, 0.20)
DRAWN = np.radians(92.0)  # as far as the base takes the handle from there
DRAWS = 6  # drives in which it does
MOST_LEFT = 0.46  # y of the base then, m in the fridge's frame: farther left there may be people
LEAST_OPEN = np.radians(82.0)  # the robot gets in, and sees the shelf
LEAST_PULL = np.radians(30.0)  # less than this is no opening
GRASP_HEIGHT, PUSH_HEIGHT, CLOSE_HEIGHT = 1.0, 1.0, 1.28  # m
DOOR_LOOK = np.array([-0.15, 0.05, GRASP_HEIGHT])  # m, in the fridge's frame
OPEN_LOOK = np.array([-0.30, 0.25, GRASP_HEIGHT])  # m: at the face of an open door
BEYOND = 0.012  # m that the finger tips reach beyond the bar
PULLS, PUSHES = 3, 2  # until the door is open, or shut
PUSH_REACH, CLOSE_REACH = 0.50, 0.52  # m from the hinge at which the hand pushes
GRIP_EFFORT = 100.0  # N
LEAST_GAP = 0.008  # m between the tips that a bar keeps
PULL_SPEED, PUSH_SPEED = 0.25, 0.25  # share of the joints' speed limits


class HandleLost(SkillError):
    """The hand does not hold the handle."""


def open_door(context: SkillContext, kitchen: Kitchen, arm: str) -> float:
    """Open the fridge, from wherever the base stands before it. Leave the base ready to drive in.

    :param arm: 'left' or 'right'.
    :returns: rad, the opening that the camera sees in the end.
    :raises SkillError: with the reason.
    :raises PlanningError: where no path is found.
    :raises RobotError: where arm, head or gripper do not get somewhere.
    """
    known_arm(arm)
    with _driving_back_on_failure(context, kitchen):
        return _open(context, kitchen, arm)


def _open(context: SkillContext, kitchen: Kitchen, arm: str) -> float:
    view = _look_from_before(context, kitchen)
    angle = view.angle
    for pull in range(PULLS):
        if view.angle < AJAR:
            try:
                angle = _pull(context, kitchen, arm, view)
                _take_hand_off(context, kitchen, arm, angle)
            except HandleLost:
                if pull == PULLS - 1:
                    raise
                take_hands_off(context, kitchen)  # it may stand open far enough to be pushed
            view = _look_from_before(context, kitchen)
    if view.angle < AJAR:
        raise SkillError(
            'the door fell shut again, to {:.0f} degrees, when the hand let go '
            'of its handle at {:.0f}'.format(*np.degrees([view.angle, angle]))
        )
    if view.angle < WIDE - STEP:
        angle = _push_open(context, kitchen, arm, view)
        _stow_beside(context, kitchen, angle)
        drive(context, odom_from_pose(kitchen, *CLEAR))
        view = look(context.robot, kitchen, OPEN_LOOK)
        if view.angle < LEAST_OPEN:
            raise SkillError(
                'the door stands open by {:.0f} degrees only, and not by {:.0f}: '
                'something is in its way, or it fell back'.format(*np.degrees([view.angle, angle]))
            )
    else:
        drive(context, odom_from_pose(kitchen, *CLEAR))
    return view.angle


def close_door(context: SkillContext, kitchen: Kitchen, arm: str) -> None:
    """Push the door shut with the back of the hand, and look whether it is.

    :raises SkillError: with the reason.
    :raises PlanningError: where no path is found.
    :raises RobotError: where arm, head or gripper do not get somewhere.
    """
    known_arm(arm)
    with _driving_back_on_failure(context, kitchen):
        _close(context, kitchen, arm)


def _close(context: SkillContext, kitchen: Kitchen, arm: str) -> None:
    drive(context, odom_from_pose(kitchen, *CLOSING))
    _clear_of_door(context, next(other for other in ARMS if other != arm))
    view = look(context.robot, kitchen, np.array([-0.35, 0.20, GRASP_HEIGHT]))
    for push in range(PUSHES):
        if view.angle >= STEP:
            if push:
                drive(context, odom_from_pose(kitchen, *CLOSING))
            try:
                _push_shut(context, kitchen, arm, view)
            except SkillError:
                if push == PUSHES - 1:
                    raise
            view = look(context.robot, kitchen, np.array([-0.2, 0.10, GRASP_HEIGHT]))
    if view.angle >= 2 * STEP:
        raise SkillError(
            'the door still stands open by {:.0f} degrees'.format(np.degrees(view.angle))
        )


@contextmanager
def _driving_back_on_failure(context: SkillContext, kitchen: Kitchen) -> Iterator[None]:
    """After a failure, let go and drive back: a hand may be caught behind a part of the door."""
    try:
        yield
    except SkillError:
        try:
            if not take_hands_off(context, kitchen):
                step_back(context, AWAY_FOR_GOOD)
        except SkillError:
            pass  # the first failure is the one to report
        raise


def stand_before(context: SkillContext, kitchen: Kitchen) -> None:
    """Drive to where the door is opened, with the arms out of the way.

    A hand that is at the door, as after a skill that was stopped, is taken off it first.

    :raises SkillError: where an arm or the base does not get there.
    """
    take_hands_off(context, kitchen)
    here = inverse(base_from_fridge(kitchen, context.robot.odom_from_base()))
    if here[0, 3] > CLEAR[0] + 0.05:  # within the door's swing
        step_back(context, here[0, 3] - CLEAR[0])
    _stow_beside(context, kitchen, WIDE)
    drive(context, odom_from_pose(kitchen, *OPENING))


def _look_from_before(context: SkillContext, kitchen: Kitchen) -> DoorView:
    """Drive to where the door is opened, and look at it."""
    stand_before(context, kitchen)
    return look(context.robot, kitchen, DOOR_LOOK)


def _clear_of_door(context: SkillContext, arm: str) -> None:
    """Take a hand that is in the way of the door or of the pushing arm to its side.

    It keeps what it holds.
    """
    with Arm(context, arm, {}, seed_of(arm, encoder_readings(context.robot))) as limb:
        ahead, left = limb.pose()[:2, 3]
        beside = left if arm == 'left' else -left
        if ahead > AHEAD or (ahead > BEFORE_CHEST[0] and beside < BEFORE_CHEST[1]):
            carry(limb, level=False)


def _stow_beside(context: SkillContext, kitchen: Kitchen, angle: float) -> None:
    """Take both arms to their postures for driving, with the door at `angle`."""
    boxes = named_boxes(kitchen, base_from_fridge(kitchen, context.robot.odom_from_base()), angle)
    stow(context, ARMS, boxes)


def _pull(context: SkillContext, kitchen: Kitchen, arm: str, view: DoorView) -> float:
    """Grasp the handle and pull it around the hinge as far as the arm reaches."""
    fridge = view.base_from_fridge

    def grasp_at(angle: float, turn: float) -> np.ndarray:
        bar = apply(fridge, handle_point(kitchen, angle, GRASP_HEIGHT))
        return from_rpy(bar, yaw=turn - angle + yaw_of(fridge)) @ from_rpy((BEYOND, 0.0, 0.0))

    with arm_at(context, kitchen, arm, view) as limb:
        swing = swing_along(
            limb,
            kitchen,
            fridge,
            grasp_at,
            view.angle,
            PULLED,
            (-1.05, 1.45),
            ('handle',),
            lambda q: approach_to(limb, q) is not None,
        )
        if swing is None or swing.angles[-1] < LEAST_PULL:
            raise SkillError(
                'the handle is out of reach of the {} arm, or cannot be pulled from here'.format(
                    arm
                )
            )
        context.robot.gripper(arm, GRIPPER_OPEN)
        place_door(limb, kitchen, fridge, view.angle)
        approach = approach_to(limb, swing.path[0])
        if approach is None:
            raise SkillError('no straight way to the handle')
        limb.go(approach[0])
        limb.follow(approach, APPROACH_SPEED)
        held = context.robot.gripper(arm, 0.0, GRIP_EFFORT)
        if held.position < LEAST_GAP:
            draw_back(limb, BEFORE, ('handle',), APPROACH_SPEED)
            raise HandleLost('the hand closed on nothing: the handle is not where it was seen')
        strain(limb, swing, PULL_SPEED)
        relax(limb)
        if sum(encoder_readings(context.robot)[name] for name in FINGER_JOINTS[arm]) < LEAST_GAP:
            raise HandleLost('the handle slipped out of the {} hand'.format(arm))
        # an arm that pulls against a hinge does not get as far as it was sent
        bar = apply(limb.pose(), np.array([-BEYOND, 0.0, 0.0]))
        reached = _draw_along(
            context, kitchen, fridge, door_angle_at(kitchen, apply(inverse(fridge), bar))
        )
        relax(limb)
        context.robot.gripper(arm, RELEASE)
    return reached


def _draw_along(context: SkillContext, kitchen: Kitchen, fridge: np.ndarray, angle: float) -> float:
    """Take the handle farther around the hinge with the base, the arm being held as it is.

    The base turns with the door. A hand that does not is wedged between bar and door.

    :param fridge: 4x4, where it is, in base_footprint.
    :param angle: rad, how far the arm has opened the door.
    :returns: rad, how far it should be open now.
    """
    start = context.robot.odom_from_base()
    hinge = from_rpy(apply(fridge, np.array([0.0, kitchen.width / 2, 0.0])))
    first = angle
    for further in np.linspace(first, DRAWN, DRAWS + 1)[1:]:
        about_hinge = hinge @ from_rpy((0.0, 0.0, 0.0), yaw=first - further) @ inverse(hinge)
        if (inverse(fridge) @ about_hinge)[1, 3] > MOST_LEFT:
            break
        try:
            drive(context, start @ about_hinge)
        except SkillError:
            break  # the door is at its end, or something is in its way: the camera will tell
        angle = float(further)
    return angle


def _take_hand_off(context: SkillContext, kitchen: Kitchen, arm: str, angle: float) -> None:
    """Drive the open hand back from the bar, and stow the arms. The door is at `angle`."""
    with Arm(context, arm, {}, seed_of(arm, encoder_readings(context.robot))) as limb:
        withdraw(context, limb, OFF)
        try:
            _stow_beside(context, kitchen, angle)
        except SkillError:
            relax(limb)
            go_away(context, kitchen)  # the door is elsewhere: the camera will tell


def _push_open(context: SkillContext, kitchen: Kitchen, arm: str, view: DoorView) -> float:
    """Reach behind the door's edge and push it from inside, and return how far it is open, rad."""
    fridge = view.base_from_fridge

    def push_at(angle: float, turn: float) -> np.ndarray:
        return against(kitchen, fridge, angle, turn, PUSH_REACH, PUSH_HEIGHT, inside=True)

    with arm_at(context, kitchen, arm, view) as limb:
        swing = swing_along(
            limb,
            kitchen,
            fridge,
            push_at,
            view.angle - 2 * STEP,
            WIDE,
            (-1.75, 0.6),
            ('door',),
            lambda q: is_beside(limb, kitchen, view, q),
        )
        if swing is None or swing.angles[-1] < view.angle + STEP:
            if view.angle >= LEAST_OPEN:
                return view.angle  # wide enough, as it stands
            raise SkillError('the {} arm cannot push the door further from here'.format(arm))
        place_door(limb, kitchen, fridge, view.angle, BERTH)
        limb.go(swing.path[0])
        context.robot.gripper(arm, 0.0)
        strain(limb, swing, PUSH_SPEED)
        place_door(limb, kitchen, fridge, float(swing.angles[-1]))
        draw_back(limb, BEFORE, ('door',), APPROACH_SPEED)
    return float(swing.angles[-1])


def _push_shut(context: SkillContext, kitchen: Kitchen, arm: str, view: DoorView) -> None:
    """Push the door from outside until it is shut."""
    fridge = view.base_from_fridge

    def push_at(angle: float, turn: float) -> np.ndarray:
        return against(kitchen, fridge, angle, turn, CLOSE_REACH, CLOSE_HEIGHT, inside=False)

    with arm_at(context, kitchen, arm, view) as limb:
        context.robot.gripper(arm, 0.0)
        swing = swing_along(
            limb,
            kitchen,
            fridge,
            push_at,
            view.angle + 2 * STEP,
            0.0,
            (-1.2, 2.4),
            ('door',),
            lambda q: is_beside(limb, kitchen, view, q),
        )
        if swing is None or swing.angles[-1] > view.angle - STEP:
            raise SkillError('the {} arm cannot push the door shut from here'.format(arm))
        place_door(limb, kitchen, fridge, view.angle, BERTH)
        limb.go(swing.path[0])
        strain(limb, swing, PUSH_SPEED)
    _press(context)
    # a hand that is lifted away from there may hook the door, or its handle
    step_back(context, OFF_DOOR)
    stow(
        context,
        (arm,),
        named_boxes(kitchen, base_from_fridge(kitchen, context.robot.odom_from_base()), 2 * STEP),
    )


def _press(context: SkillContext) -> None:
    """Drive on a little with the hand at the door. A base that is held up has not failed."""
    try:
        step_back(context, -PRESS)
    except SkillError:
        pass
