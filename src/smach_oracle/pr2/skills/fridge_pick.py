"""Take a drink out of the refrigerator: grasp, lift, back out with the base, carry it."""
from typing import Sequence

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import from_rpy

from ..kitchen import Kitchen, MapBox
from ..planning.arm import FEEL_EFFORT, Arm, SkillContext, SkillError, seed_of
from ..planning.travel import carry, drive, stow
from ..robot import GRIPPER_OPEN
from .door import WIDE, named_boxes
from .pick import HeldObject, ObjectSlipped, pick

STEP_BACK = 0.40  # m that the base draws back to take the hand out
PADDING = 0.03  # m, for the fridge is not quite where the map has it
BESIDE = 0.004  # m around things on the shelf
SAME = 0.03  # m between the middles of two boxes that are the same thing


def pick_from_fridge(context: SkillContext, kitchen: Kitchen, base_from_fridge: np.ndarray,
                     arm: str, target: UprightBox, others: Sequence[UprightBox],
                     effort: float = FEEL_EFFORT, elsewhere: int = 0) -> HeldObject:
    """Pick a drink and take it out, upright; where that fails, the hand leaves the fridge empty.

    :param base_from_fridge: 4x4, where the fridge is.
    :param others: what else stands on the shelf; the drink itself may be among it.
    :param effort: N, of the grip.
    :param elsewhere: as in pick().
    :raises SkillError: with the reason; ObjectSlipped where the drink did not come along.
    """
    boxes = {
        name: _padded(box)
        for name, box in named_boxes(kitchen, base_from_fridge, WIDE).items()
    }
    boxes.update({
        'thing {}'.format(k): MapBox(box.centre, box.size / 2 + BESIDE, box.yaw)
        for k, box in enumerate(others) if np.hypot(*(box.centre - target.centre)[:2]) > SAME
    })
    try:
        held = pick(context, arm, target, boxes, effort, elsewhere)
        _draw_out(context)
        with Arm(context, arm, {}, seed_of(arm, held.grasp)) as hand:
            hand.space.attach(held.half, held.tool_from_object)
            carry(hand)
            if hand.close(effort) == 0:
                raise ObjectSlipped('the drink was lost on the way out of the refrigerator')
    except SkillError:
        _leave(context, arm)
        raise
    return held


def _padded(box: MapBox) -> MapBox:
    """The box, wider by what may be wrong; not higher, for things stand on shelves."""
    return box._replace(half=box.half + [PADDING, PADDING, 0.0])


def _draw_out(context: SkillContext) -> None:
    """The base takes the arm straight out of the fridge, as it is: the arm need not be able to."""
    drive(context, context.robot.odom_from_base() @ from_rpy((-STEP_BACK, 0.0, 0.0)))


def _leave(context: SkillContext, arm: str) -> None:
    """Take hand and base out of the fridge, so that the shelf can be seen again."""
    here = context.robot.odom_from_base()
    context.robot.gripper(arm, GRIPPER_OPEN)
    _draw_out(context)
    stow(context, (arm,), {})
    drive(context, here)
