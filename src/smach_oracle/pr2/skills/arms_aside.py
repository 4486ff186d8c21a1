"""Move the arms to the robot's sides, out of the camera's view."""

from typing import Mapping, Sequence

import numpy as np

from ..kitchen import MapBox
from ..planning.arm import (
    FAST,
    Arm,
    SkillContext,
    SkillError,
    arm_positions,
    encoder_readings,
    seed_of,
)
from ..robot import ARMS

ASIDE = {
    'right': np.array([-1.6, 0.2, -1.5, -1.5, 0.5, -0.6, 0.0]),
    'left': np.array([1.6, 0.2, 1.5, -1.5, -0.5, -0.6, 0.0]),
}  # rad
NEAR_ENOUGH = 0.06  # rad


def is_aside(joints: Mapping[str, float], arm: str) -> bool:
    """Whether an arm is at the robot's side, by its encoders."""
    q = arm_positions(joints, arm)
    return bool(np.abs(_turned(q, ASIDE[arm]) - ASIDE[arm]).max() < NEAR_ENOUGH)


def arms_aside(context: SkillContext, arms: Sequence[str], boxes: Mapping[str, MapBox]) -> None:
    """Move arms aside, one after the other.

    :param arms: 'left', 'right'. Empty means both.
    :param boxes: obstacles, in base_footprint.
    :raises SkillError: for an unknown arm, or where an arm does not get there.
    """
    unknown = sorted(set(arms) - set(ARMS))
    if unknown:
        raise SkillError(
            'arm {}; allowed: {}'.format(', '.join(map(repr, unknown)), ', '.join(ARMS))
        )
    wanted = [arm for arm in ARMS if arm in arms or not arms]
    away = [arm for arm in wanted if not is_aside(encoder_readings(context.robot), arm)]
    for arm in away:
        with Arm(context, arm, boxes, seed_of(arm, encoder_readings(context.robot))) as limb:
            limb.go(ASIDE[arm], FAST)
    for arm in wanted:
        if not is_aside(encoder_readings(context.robot), arm):
            raise SkillError(
                'the {} arm is not at the side: something moved it, or holds it'.format(arm)
            )


def _turned(q: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """The two rolls of forearm and wrist are taken to within half a turn of the reference."""
    near = q.copy()
    for k in (4, 6):
        near[k] = reference[k] + (q[k] - reference[k] + np.pi) % (2 * np.pi) - np.pi
    return near
