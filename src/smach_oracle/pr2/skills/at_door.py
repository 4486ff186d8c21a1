"""An arm at the refrigerator's door: the door in its map, and ways of the hand along it."""

from typing import Callable, Dict, Optional, Tuple

import numpy as np

from smach_oracle.geometry.transforms import apply, from_rpy, yaw_of

from ..kitchen import Kitchen, MapBox, base_from_fridge, door_frame, fridge_boxes
from ..perception.door_view import DoorNotSeen, DoorView, find_door
from ..planning.arm import READY, Arm, SkillContext, SkillError, encoder_readings, seed_of
from ..planning.door_swing import DoorSwing, best_swing
from ..robot import Robot

STEP = np.radians(4.0)
BEFORE = 0.10  # m that the hand comes straight
BERTH = 0.01  # m that the arm keeps from the door on its way to it
APPROACH_SPEED = 0.3  # share of the joints' speed limits

ToolAt = Callable[[float, float], np.ndarray]


def look(robot: Robot, kitchen: Kitchen, point: np.ndarray, tries: int = 3) -> DoorView:
    """Look for the door at a point (3,) of the fridge's frame.

    :raises SkillError: where it is not seen.
    """
    expected = base_from_fridge(kitchen, robot.odom_from_base())
    robot.look_at(apply(expected, point))
    for attempt in range(tries):
        try:
            return find_door(robot.see(), kitchen, expected)
        except DoorNotSeen as err:
            if attempt == tries - 1:
                raise SkillError(str(err)) from err
    raise SkillError('the door was not looked for: tries is {}'.format(tries))


def swing_along(
    limb: Arm,
    kitchen: Kitchen,
    fridge: np.ndarray,
    tool_at: ToolAt,
    first: float,
    last: float,
    turns: Tuple[float, float],
    touching: Tuple[str, ...],
    may_begin: Callable[[np.ndarray], bool] = lambda q: True,
) -> Optional[DoorSwing]:
    """The best path of the hand along the door between two angles (rad)."""
    count = int(np.ceil(abs(last - first) / STEP)) + 1

    def is_free(q: np.ndarray, angle: float) -> bool:
        place_door(limb, kitchen, fridge, angle)
        with limb.space.touchable(touching):
            return limb.space.is_free(q)

    return best_swing(
        limb.chain,
        tool_at,
        np.linspace(first, last, count),
        turns,
        READY[limb.name],
        limb.generator,
        is_free,
        may_begin,
    )


def strain(limb: Arm, swing: DoorSwing, speed: float) -> None:
    """Follow a swing against resistance. An arm that is held up at the end has not failed."""
    here = limb.now()
    turns = limb.chain.nearest_turn(swing.path[0], here) - swing.path[0]
    try:
        limb.follow(np.vstack([here, swing.path[1:] + turns]), speed)
    except SkillError:
        pass


def relax(limb: Arm) -> None:
    """Stay where the arm is. One that was held up springs on, once the hand lets go.

    An arm that does not get quite there has not failed.
    """
    here = limb.now()
    try:
        limb.follow(np.array([here, here]), APPROACH_SPEED)
    except SkillError:
        pass


def arm_at(context: SkillContext, kitchen: Kitchen, arm: str, view: DoorView) -> Arm:
    """The arm among the parts of the fridge where they were seen."""
    boxes = named_boxes(kitchen, view.base_from_fridge, view.angle)
    return Arm(
        context,
        arm,
        boxes,
        seed_of(arm, view.angle, view.base_from_fridge, encoder_readings(context.robot)),
    )


def is_beside(limb: Arm, kitchen: Kitchen, view: DoorView, q: np.ndarray) -> bool:
    """Whether the arm touches nothing at joint positions, with the door where it was seen."""
    place_door(limb, kitchen, view.base_from_fridge, view.angle, BERTH)
    return limb.space.is_free(q)


def approach_to(limb: Arm, grasp: np.ndarray) -> Optional[np.ndarray]:
    """A straight path (m, 7) of the hand to joint positions at the handle.

    :returns: None where there is none.
    """
    before = limb.chain.forward(grasp) @ from_rpy((-BEFORE, 0.0, 0.0))
    with limb.space.touchable(('handle',)):
        path = limb.line(grasp, before)
    return None if path is None or not limb.space.is_free(path[-1]) else path[::-1]


def against(
    kitchen: Kitchen,
    fridge: np.ndarray,
    angle: float,
    turn: float,
    reach: float,
    height: float,
    inside: bool,
) -> np.ndarray:
    """4x4, base from tool: the closed hand beside the door's inner or outer face.

    :param turn: rad, of the hand against the face. At 0 it points straight at it. The more it lies
        along it, the more room its width needs.
    :param reach: m from the hinge.
    :param height: m.
    """
    room = 0.01 + 0.07 * abs(np.sin(turn))
    out = -room if inside else kitchen.door_thickness + room
    point = apply(fridge @ door_frame(kitchen, angle), np.array([out, reach, height]))
    outwards = np.pi - angle + yaw_of(fridge)
    return from_rpy(point, yaw=turn + outwards + (0.0 if inside else np.pi))


def named_boxes(kitchen: Kitchen, fridge: np.ndarray, angle: float) -> Dict[str, MapBox]:
    """The fridge (4x4, in base_footprint) as obstacles by name, its door open by `angle` rad."""
    boxes = fridge_boxes(kitchen, fridge, angle)
    named = {'fridge_{}'.format(index): box for index, box in enumerate(boxes[:-2])}
    named.update(door=boxes[-2], handle=boxes[-1])
    return named


def place_door(
    limb: Arm, kitchen: Kitchen, fridge: np.ndarray, angle: float, berth: float = 0.0
) -> None:
    """Have the door at an angle in the arm's map, with `berth` m around it."""
    boxes = named_boxes(kitchen, fridge, angle)
    for name in ('door', 'handle'):
        limb.space.add_box(name, boxes[name]._replace(half=boxes[name].half + berth))
