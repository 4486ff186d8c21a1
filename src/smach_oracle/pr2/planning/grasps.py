"""Grasps of an upright thing: headings all round, with the hand level, inclined or from above."""

from typing import Iterator, List

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import from_rpy

from ..robot import GRIPPER_OPEN

WIDEST = 0.085  # m between the tips that a thing may take up
# what a heading costs, as a turn in rad, from which fingers may come down on corners and squeeze it
# out
CORNERS = 0.6
SPARE = 0.002  # m between the open tips and such corners that is enough
# x, y in base_footprint, m
SHOULDER = {'right': np.array([-0.05, -0.19]), 'left': np.array([-0.05, 0.19])}
HEADINGS = np.linspace(-1.3, 1.3, 14)  # rad, beside the straight one from the shoulder
FINE_HEADINGS = np.linspace(-1.3, 1.3, 27)  # where there is little room
PITCHES = (0.0, 0.4, 0.8, np.pi / 2)  # rad, of the hand downwards
ROUND = 0.006  # m by which the sides of the box of something round differ at most
NO_HEADING = 0.02  # rad that the base may have turned since its box was seen
FROM_ABOVE = 1.2  # rad, of the hand downwards
DEPTH = 0.012  # m that the tips go beyond the middle
LOWEST = 0.035  # m of the tips above what the thing stands on, hand level
BELOW_TOP = 0.02  # m, hand level
# what it costs per m that a thing takes up between the tips: fingers that do not lie flat on its
# faces push it, jam it by its corners, and tilt it
FLAT = 30.0
# m below the top, from above: near the middle, for what hangs from its top swings and tilts
DEEP = 0.05


def grasps(box: UprightBox, arm: str, fine: bool = False) -> List[np.ndarray]:
    """Ways to take a thing, the most natural first, or [] where it is too wide from everywhere.

    :param box: in base_footprint.
    :param fine: whether to try twice as many headings.
    :returns: poses of the tool (4x4, in base_footprint) when the gripper closes.
    """
    straight = float(np.arctan2(*(box.centre[:2] - SHOULDER[arm])[::-1]))
    found = [
        (cost, order, grasp)
        for order, (cost, grasp) in enumerate(
            _all(box, straight, FINE_HEADINGS if fine else HEADINGS)
        )
    ]
    return [grasp for _, _, grasp in sorted(found, key=lambda item: item[:2])]


def others_first(found: List[np.ndarray], failed: int) -> List[np.ndarray]:
    """The same grasps, with those last that are like the ones that have failed.

    Then those come first that are least like the most natural one.

    :param found: as from grasps().
    :param failed: how many kinds of grasp have failed: as many inclinations of the hand come last.
    """
    if not failed or not found:
        return list(found)
    natural = _inclination(found[0])
    kinds = sorted(
        {_inclination(grasp) for grasp in found},
        key=lambda kind: (kind != natural, -abs(kind - natural)),
    )
    last = failed % len(kinds)
    rank = {kind: number for number, kind in enumerate(kinds[last:] + kinds[:last])}
    return sorted(found, key=lambda grasp: rank[_inclination(grasp)])


def comes_from_above(grasp: np.ndarray) -> bool:
    """Whether a hand (4x4) comes straight down."""
    return _inclination(grasp) > FROM_ABOVE


def _inclination(grasp: np.ndarray) -> float:
    """rad to two digits, of a hand (4x4) downwards."""
    return round(float(np.arcsin(np.clip(-grasp[2, 0], -1.0, 1.0))), 2)


def _all(box: UprightBox, straight: float, headings: np.ndarray) -> Iterator[tuple]:
    for pitch in PITCHES:
        for turn in np.append(headings, _to_the_faces(box, straight)):
            heading = straight + turn
            if width_across(box, heading) <= WIDEST:
                pose = from_rpy(_middle(box, heading, pitch), pitch=pitch, yaw=heading)
                taken_up = _projected(box, heading)
                corners = CORNERS if taken_up > GRIPPER_OPEN - SPARE else 0.0
                yield abs(turn) + 0.8 * pitch + FLAT * taken_up + corners, pose


def _to_the_faces(box: UprightBox, straight: float) -> np.ndarray:
    """(n,) rad, turns from the straight heading after which the fingers lie flat on two faces."""
    if is_round(box):
        return np.zeros(0)
    turns = box.yaw + np.pi / 2 * np.arange(4) - straight
    turns = (turns + np.pi) % (2 * np.pi) - np.pi
    return np.asarray(turns[np.abs(turns) <= np.abs(HEADINGS).max()])


def width_across(box: UprightBox, heading: float) -> float:
    """Return how much of the gap between the tips a thing takes up, m.

    :param heading: rad, of the hand that comes.
    """
    # as good as round, or square: its corners turn in between the tips
    if box.wide - box.narrow < 0.012:
        return box.wide
    return _projected(box, heading)


def is_round(box: UprightBox) -> bool:
    """Whether the box of something round is meant: it has no heading, see upright_box()."""
    return abs(box.yaw) < NO_HEADING and box.wide - box.narrow < ROUND


def _projected(box: UprightBox, heading: float) -> float:
    if is_round(box):
        return box.wide
    angle = heading - box.yaw
    return float(box.size[0] * abs(np.sin(angle)) + box.size[1] * abs(np.cos(angle)))


def _middle(box: UprightBox, heading: float, pitch: float) -> np.ndarray:
    """Return the tool frame's place: beyond the middle, at a height where the fingers hold well."""
    bottom, top = box.centre[2] - box.size[2] / 2, box.centre[2] + box.size[2] / 2
    if pitch > FROM_ABOVE:
        return np.array([box.centre[0], box.centre[1], max(bottom + 0.02, top - DEEP)])
    height = min(max(box.centre[2], bottom + LOWEST + 0.03 * np.sin(pitch)), top - BELOW_TOP)
    ahead = min(DEPTH, box.narrow / 3)
    return np.array(
        [box.centre[0] + ahead * np.cos(heading), box.centre[1] + ahead * np.sin(heading), height]
    )
