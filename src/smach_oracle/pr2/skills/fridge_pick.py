"""Take a drink off a shelf of the refrigerator: grasp, lift, back out of it with the base, carry it beside the body."""
from typing import Sequence

import numpy as np

from ...geometry.box import UprightBox
from ...geometry.transforms import from_rpy
from .arm import FEEL_EFFORT, Arm, Means, SkillError, seed_of
from .door import WIDE, named_boxes
from .interface import GRIPPER_OPEN
from .kitchen import Kitchen, MapBox
from .pick import Held, Slipped, pick
from .travel import carry, drive, stow

STEP_BACK = 0.40  # m that the base draws back to take the hand out
PADDING = 0.015  # m
BESIDE = 0.004  # m around things on the shelf
SAME = 0.03  # m between the middles of two boxes that are the same thing


def pick_from_fridge(means: Means, kitchen: Kitchen, base_from_fridge: np.ndarray, arm: str, target: UprightBox,
                     others: Sequence[UprightBox], effort: float = FEEL_EFFORT) -> Held:
    """Pick a drink and take it out, upright; where that fails, the hand leaves the fridge empty.

    :param base_from_fridge: 4x4, where the fridge is.
    :param others: what else stands on the shelf; the drink itself may be among it.
    :param effort: N, of the grip.
    :raises SkillError: with the reason; Slipped where the drink did not come along.
    """
    boxes = {name: _padded(box) for name, box in named_boxes(kitchen, base_from_fridge, WIDE).items()}
    boxes.update({'thing {}'.format(k): MapBox(box.centre, box.size / 2 + BESIDE, box.yaw)
                  for k, box in enumerate(others) if np.hypot(*(box.centre - target.centre)[:2]) > SAME})
    try:
        held = pick(means, arm, target, boxes, effort)
        _draw_out(means)
        with Arm(means, arm, {}, seed_of(arm, held.grasp)) as hand:
            hand.space.attach(held.half, held.tool_from_object)
            carry(hand)
            if hand.close(effort) == 0:
                raise Slipped('the drink was lost on the way out of the refrigerator')
    except SkillError:
        _leave(means, arm)
        raise
    return held


def _padded(box: MapBox) -> MapBox:
    """Wider by what the base may stand beside where it believes to; not higher, for things stand on shelves."""
    return box._replace(half=box.half + [PADDING, PADDING, 0.0])


def _draw_out(means: Means) -> None:
    """The base takes the arm straight out of the fridge, as it is: the arm need not be able to."""
    drive(means, means.robot.odom_from_base() @ from_rpy((-STEP_BACK, 0.0, 0.0)))


def _leave(means: Means, arm: str) -> None:
    """Get the hand out of the fridge and to the side, and the base to where it was: the shelf is to be seen again."""
    here = means.robot.odom_from_base()
    means.robot.gripper(arm, GRIPPER_OPEN)
    _draw_out(means)
    stow(means, (arm,), {})
    drive(means, here)
