"""Whether a trial was a true success, by the world's bodies alone."""

from typing import List, NamedTuple, Tuple

import numpy as np

from ..scenes.scene import Goal
from .world import World

UPRIGHT = np.cos(np.radians(15.0))
RESTING = (0.03, 0.3)  # m/s, rad/s: what is slower is at rest
HEIGHT = 0.05  # m, that a body may be off the goal's height
# m from where the scene put it: what was merely pushed towards the goal was not brought there
CARRIED = 0.08
RECEIVER = 'palm'  # the body that takes what is handed over


class TrialVerdict(NamedTuple):
    """The truth about a goal."""

    success: bool
    why: str
    wrong_object: str = ''  # another thing than the goal's own that was brought to the goal


def judge(world: World, goal: Goal) -> TrialVerdict:
    """Look at the world as it stands, without moving it.

    :raises ValueError: for a goal of an unknown kind, or about a body that is not there.
    """
    if goal.kind not in ('stands_at', 'in_hand'):
        raise ValueError("goal: kind is {!r}; allowed: 'stands_at', 'in_hand'".format(goal.kind))
    names = [goal.body] if goal.body else world.movable()
    if not names:
        return TrialVerdict(False, 'there is nothing in the world that can be moved')
    found: List[Tuple[float, str, str]] = []
    for name in names:
        off = float(np.linalg.norm(world.body_pose(name)[:2, 3] - goal.position[:2]))
        faults = _faults(world, goal, name, off)
        if not faults:
            return TrialVerdict(
                True,
                '{} {}, {:.1f} cm off'.format(
                    name,
                    'stands at its goal'
                    if goal.kind == 'stands_at'
                    else 'is in the receiving hand',
                    100 * off,
                ),
            )
        found.append((off, name, ', '.join(faults)))
    _, name, text = min(found)
    why = '{} {}'.format(name, text)
    wrong = _wrong_object(world, goal) if goal.body else ''
    return TrialVerdict(
        False, 'wrong object: {} was brought, {}'.format(wrong, why) if wrong else why, wrong
    )


def _wrong_object(world: World, goal: Goal) -> str:
    """Another thing that is at the goal as its own should be, and that a hand has carried."""
    for name in world.movable():
        off = float(np.linalg.norm(world.body_pose(name)[:2, 3] - goal.position[:2]))
        brought = goal.kind == 'in_hand' or world.harm.was_carried(name)
        if name != goal.body and brought and not _faults(world, goal, name, off):
            return name
    return ''


def _faults(world: World, goal: Goal, name: str, off: float) -> List[str]:
    """Return what keeps one body from being the success that the goal asks for."""
    pose, (speed, turning) = world.body_pose(name), world.body_speed(name)
    touching = {contact.other for contact in world.contacts(name) if contact.force > 0}
    height = pose[2, 3] - goal.position[2]
    faults = []
    if off > goal.tolerance:
        faults.append('is {:.1f} cm from the goal'.format(100 * off))
    way = float(np.linalg.norm(pose[:3, 3] - world.body(name).position))
    if goal.kind == 'stands_at' and not goal.body and way < CARRIED:
        faults.append('was never carried')
    if 'robot' in touching:
        faults.append('is touched by the robot')
    if pose[2, 2] < UPRIGHT:
        faults.append('does not stand upright')
    if speed > RESTING[0] or turning > RESTING[1]:
        faults.append('is not at rest')
    if goal.kind == 'in_hand' and RECEIVER not in touching:
        faults.append('does not lie in the {}'.format(RECEIVER))
    if goal.kind == 'stands_at' and abs(height) > HEIGHT:
        faults.append(
            'is {:.0f} cm too {}'.format(100 * abs(height), 'high' if height > 0 else 'low')
        )
    if goal.kind == 'stands_at' and not touching - {'robot'}:
        faults.append('stands on nothing')
    return faults
