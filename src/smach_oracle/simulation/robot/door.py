"""Opening and closing the refrigerator by real contact: by the handle, or with the hand against the door.

Opening does not look at its result: where the arm did not get far enough, the door stands half open and nobody knows
until somebody looks into the fridge.
"""
from typing import Callable, Dict

import numpy as np

from ...geometry.transforms import apply, from_rpy, yaw_of
from .collision import RobotModel
from .door_view import DoorNotSeen, DoorView, find_door
from .interface import GRIPPER_OPEN, Robot
from .kitchen import Kitchen, MapBox, base_from_fridge, door_frame, fridge_boxes, handle_point, odom_from_pose
from .limb import TRAVEL, Limb, stow
from .planner import PlanningError
from .swing import Swing, best_swing

# x, y in m and yaw in rad of the base, in the fridge's frame
OPENING = (-0.97, 0.08, 0.0)
CLEAR = (-1.00, -0.14, 0.0)  # beside the open door's edge, for whoever drives in next
CLOSING = (-0.87, -0.30, 0.0)

AJAR = np.radians(20.0)  # from here on a door is pushed, not pulled
WIDE = np.radians(100.0)  # as far as it is opened
STEP = np.radians(4.0)
LEAST_PULL = np.radians(30.0)  # less than this is no opening
GRASP_HEIGHT, PUSH_HEIGHT, CLOSE_HEIGHT = 1.0, 1.0, 1.28  # m
BEYOND = 0.025  # m that the finger tips reach beyond the bar
BEFORE = 0.10  # m that the hand comes straight
PUSH_REACH, CLOSE_REACH = 0.50, 0.42  # m from the hinge at which the hand pushes
GRIP_EFFORT = 100.0  # N
LEAST_GAP = 0.008  # m between the tips that a bar keeps
PULL_SPEED, PUSH_SPEED = 0.25, 0.25  # share of the joints' speed limits
COMFORT: Dict[str, np.ndarray] = {'left': np.array([0.2, 0.2, 1.0, -1.2, 0.0, -1.0, 0.0]),
                                  'right': np.array([-0.2, 0.2, -1.0, -1.2, 0.0, -1.0, 0.0])}

ToolAt = Callable[[float, float], np.ndarray]


class DoorError(Exception):
    """The door could not be moved; the text is the reason, for people."""


def open_door(robot: Robot, model: RobotModel, kitchen: Kitchen, arm: str, seed: int) -> float:
    """Open the fridge, from wherever the base stands in front of it, and leave the base ready to drive in.

    :param arm: 'left' or 'right'.
    :returns: rad, the opening that the arm's motion should have brought about.
    :raises DoorError: with the reason. PlanningError, RobotError where the arm or the base does not get somewhere.
    """
    back_off(robot, kitchen)
    stow(robot, model, ('left', 'right'), {}, seed)
    robot.drive(odom_from_pose(kitchen, *OPENING))
    view = look(robot, kitchen, np.array([-0.15, 0.05, GRASP_HEIGHT]))
    if view.angle < AJAR:
        angle = _pull(robot, model, kitchen, arm, view, seed)
    elif view.angle < WIDE - STEP:
        angle = _push_open(robot, model, kitchen, arm, view, seed)
    else:
        angle = view.angle
    stow(robot, model, (arm,), _boxes(kitchen, view.base_from_fridge, angle), seed)
    robot.drive(odom_from_pose(kitchen, *CLEAR))
    return angle


def close_door(robot: Robot, model: RobotModel, kitchen: Kitchen, arm: str, seed: int) -> None:
    """Push the door shut with the back of the hand, and look whether it is.

    :raises DoorError: with the reason. PlanningError, RobotError where the arm or the base does not get somewhere.
    """
    robot.drive(odom_from_pose(kitchen, *CLOSING))
    view = look(robot, kitchen, np.array([-0.35, 0.20, GRASP_HEIGHT]))
    if view.angle >= STEP:
        _push_shut(robot, model, kitchen, arm, view, seed)
        view = look(robot, kitchen, np.array([-0.1, 0.05, GRASP_HEIGHT]))
    if view.angle >= 2 * STEP:
        raise DoorError('the door still stands open by {:.0f} degrees'.format(np.degrees(view.angle)))


def back_off(robot: Robot, kitchen: Kitchen) -> None:
    """Drive straight back, out of the door's swing, where the base stands in it."""
    here = np.linalg.inv(base_from_fridge(kitchen, robot.odom_from_base()))
    if here[0, 3] > CLEAR[0] + 0.05:
        robot.drive(odom_from_pose(kitchen, CLEAR[0], here[1, 3], yaw_of(here)))


def look(robot: Robot, kitchen: Kitchen, point: np.ndarray, tries: int = 3) -> DoorView:
    """Look for the door at a point of the fridge's frame. Raises DoorError where it is not seen."""
    expected = base_from_fridge(kitchen, robot.odom_from_base())
    robot.look_at(apply(expected, point))
    for attempt in range(tries):
        try:
            return find_door(robot.see(), kitchen, expected)
        except DoorNotSeen as err:
            if attempt == tries - 1:
                raise DoorError(str(err)) from err
    raise DoorError('nobody looked')


def _pull(robot: Robot, model: RobotModel, kitchen: Kitchen, arm: str, view: DoorView, seed: int) -> float:
    """Grasp the handle and pull it around the hinge as far as the arm reaches."""
    fridge = view.base_from_fridge

    def grasp_at(angle: float, turn: float) -> np.ndarray:
        bar = apply(fridge, handle_point(kitchen, angle, GRASP_HEIGHT))
        return from_rpy(bar, yaw=turn - angle + yaw_of(fridge)) @ from_rpy((BEYOND, 0.0, 0.0))

    with Limb(robot, model, arm, _boxes(kitchen, fridge, view.angle), seed) as limb:
        swing = _swing(limb, kitchen, fridge, grasp_at, view.angle, WIDE, (-1.05, 1.5), ('handle',))
        if swing is None or swing.angles[-1] < LEAST_PULL:
            raise DoorError('the handle is out of reach of the {} arm, or cannot be pulled from here'.format(arm))
        robot.gripper(arm, GRIPPER_OPEN)
        limb.go(_before(limb, swing))
        limb.line(limb.space.chain.forward(swing.path[0]), ('handle',))
        held = robot.gripper(arm, 0.0, GRIP_EFFORT)
        if held.position < LEAST_GAP:
            limb.back(BEFORE, ('handle',))
            raise DoorError('the hand closed on nothing: the handle is not where it was seen')
        limb.follow(np.vstack([limb.where(), swing.path[1:]]), PULL_SPEED)
        robot.gripper(arm, GRIPPER_OPEN)
        _place_door(limb, kitchen, fridge, swing.angles[-1])
        limb.back(BEFORE, ('handle', 'door'))
    return float(swing.angles[-1])


def _push_open(robot: Robot, model: RobotModel, kitchen: Kitchen, arm: str, view: DoorView, seed: int) -> float:
    """Reach behind the door's edge and push it from inside."""
    fridge = view.base_from_fridge

    def push_at(angle: float, turn: float) -> np.ndarray:
        return _against(kitchen, fridge, angle, turn, PUSH_REACH, PUSH_HEIGHT, inside=True)

    with Limb(robot, model, arm, _boxes(kitchen, fridge, view.angle), seed) as limb:
        robot.gripper(arm, 0.0)
        swing = _swing(limb, kitchen, fridge, push_at, view.angle - 2 * STEP, WIDE + STEP, (-1.75, 0.6), ('door',))
        if swing is None or swing.angles[-1] < view.angle + STEP:
            raise DoorError('the {} arm cannot push the door further from here'.format(arm))
        _place_door(limb, kitchen, fridge, view.angle)
        limb.go(swing.path[0])
        limb.follow(np.vstack([limb.where(), swing.path[1:]]), PUSH_SPEED)
        _place_door(limb, kitchen, fridge, swing.angles[-1])
        limb.back(BEFORE, ('door',))
    return float(swing.angles[-1])


def _push_shut(robot: Robot, model: RobotModel, kitchen: Kitchen, arm: str, view: DoorView, seed: int) -> None:
    """Push the door from outside until it is shut."""
    fridge = view.base_from_fridge

    def push_at(angle: float, turn: float) -> np.ndarray:
        return _against(kitchen, fridge, angle, turn, CLOSE_REACH, CLOSE_HEIGHT, inside=False)

    with Limb(robot, model, arm, _boxes(kitchen, fridge, view.angle), seed) as limb:
        robot.gripper(arm, 0.0)
        swing = _swing(limb, kitchen, fridge, push_at, view.angle + 2 * STEP, 0.0, (-1.0, 1.8), ('door',))
        if swing is None or swing.angles[-1] > view.angle - STEP:
            raise DoorError('the {} arm cannot push the door shut from here'.format(arm))
        _place_door(limb, kitchen, fridge, view.angle)
        limb.go(swing.path[0])
        limb.follow(np.vstack([limb.where(), swing.path[1:]]), PUSH_SPEED)
        _place_door(limb, kitchen, fridge, swing.angles[-1])
        limb.back(BEFORE, ('door',))
        limb.go(np.array(TRAVEL[arm]))


def _swing(limb: Limb, kitchen: Kitchen, fridge: np.ndarray, tool_at: ToolAt, first: float, last: float,
           turns: 'tuple', touching: 'tuple') -> 'Swing':
    """The best path of the hand along the door between two angles, with the door where the hand has it."""
    count = int(np.ceil(abs(last - first) / STEP)) + 1

    def is_free(q: np.ndarray, angle: float) -> bool:
        _place_door(limb, kitchen, fridge, angle)
        with limb.space.touchable(touching):
            return limb.space.is_free(q)

    return best_swing(limb.space.chain, tool_at, np.linspace(first, last, count), turns, COMFORT[limb.arm],
                      np.random.default_rng(limb.seed), is_free)


def _before(limb: Limb, swing: Swing) -> np.ndarray:
    """Joint positions straight before the beginning of a swing. Raises PlanningError."""
    pose = limb.space.chain.forward(swing.path[0]) @ from_rpy((-BEFORE, 0.0, 0.0))
    found = limb.space.chain.inverse(pose, swing.path[0])
    if found is None or not limb.space.is_free(found):
        raise PlanningError('no free place before the handle for the {} hand'.format(limb.arm))
    return found


def _against(kitchen: Kitchen, fridge: np.ndarray, angle: float, turn: float, reach: float, height: float,
             inside: bool) -> np.ndarray:
    """4x4, base from tool: the closed hand beside the door's inner or outer face, turned by `turn` against it.

    At turn 0 it points straight at the face; the more it lies along it, the more room its width needs.
    """
    room = 0.01 + 0.07 * abs(np.sin(turn))
    out = -room if inside else kitchen.door_thickness + room
    point = apply(fridge @ door_frame(kitchen, angle), np.array([out, reach, height]))
    outwards = np.pi - angle + yaw_of(fridge)
    return from_rpy(point, yaw=turn + outwards + (0.0 if inside else np.pi))


def _boxes(kitchen: Kitchen, fridge: np.ndarray, angle: float) -> Dict[str, MapBox]:
    """The fridge as obstacles by name."""
    boxes = fridge_boxes(kitchen, fridge, angle)
    named = {'fridge_{}'.format(index): box for index, box in enumerate(boxes[:-2])}
    named.update(door=boxes[-2], handle=boxes[-1])
    return named


def _place_door(limb: Limb, kitchen: Kitchen, fridge: np.ndarray, angle: float) -> None:
    boxes = _boxes(kitchen, fridge, angle)
    for name in ('door', 'handle'):
        limb.space.add_box(name, boxes[name])
