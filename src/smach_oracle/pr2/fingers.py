"""The fingers of a gripper, by their encoders."""

from typing import Mapping

from .robot import FINGER_JOINTS, GRIPPER_OPEN

LEAST_GAP = 0.012  # m between the tips, below which there is nothing in the hand
WIDE_OPEN = 0.0025  # m that the gap may lack


def stands_open(joints: Mapping[str, float], arm: str) -> bool:
    """Whether a gripper is as wide open as it gets.

    Nothing that it can hold is as wide.

    :param joints: encoder readings, m or rad by joint.
    """
    return fingers_gap(joints, arm) > GRIPPER_OPEN - WIDE_OPEN


def may_hold(joints: Mapping[str, float], arm: str) -> bool:
    """Whether something may keep the fingers apart; parameters as above."""
    return fingers_gap(joints, arm) > LEAST_GAP and not stands_open(joints, arm)


def fingers_gap(joints: Mapping[str, float], arm: str) -> float:
    """Return how far the tips of a gripper are apart, m. The parameters are as above."""
    return sum(joints.get(name, 0.0) for name in FINGER_JOINTS[arm])
