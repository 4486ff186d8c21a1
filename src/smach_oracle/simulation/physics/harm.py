"""Harm in the course of a trial: things knocked over, dropped, pushed off.

It looks at every thing ten times a second, and judges a thing when that has come to rest again. It
only looks: physics is the same with it and without.
"""

from typing import Dict, List, NamedTuple, Protocol, Tuple

import numpy as np

from ..scenes.scene import Body
from .pr2_body import PERIOD

KNOCKED_OVER, DROPPED, PUSHED_OFF = KINDS = ('knocked_over', 'dropped', 'pushed_off')
EVERY = 6  # control periods between two looks
FALL = 0.05  # m that a thing falls before that is harm
UPRIGHT = float(np.cos(np.radians(30.0)))
STILL = 0.001  # m or rad between two looks: what moves less is at rest


class HarmedWorld(Protocol):
    """The parts of World that are watched for harm."""

    periods: int

    def movable(self) -> List[str]:
        """The bodies that can be carried."""

    def body(self, name: str) -> Body:
        """A body as the scene has it."""

    def body_pose(self, name: str) -> np.ndarray:
        """4x4, the world from a body's centre."""

    def holding(self, name: str) -> str:
        """The arm that holds it, or ''."""


class Harm(NamedTuple):
    """One thing that came to harm, once."""

    kind: str  # one of KINDS
    thing: str  # name of the body
    seen_s: float = 0.0  # s since the trial began, at which it was seen to have come to that


class _Watched(NamedTuple):
    """A thing as it was seen last."""

    pose: np.ndarray  # 4x4
    held: bool
    # m above the floor of its lowest point: where it last rested, or was held since
    bottom: float
    upright: bool  # when it last rested
    was_held: bool = False  # since it last rested


class HarmWatch:
    """Watches the things of one trial's world."""

    def __init__(self) -> None:
        self._things: Dict[str, _Watched] = {}
        self._done: List[Harm] = []
        self._carried: List[str] = []

    def tick(self, world: HarmedWorld) -> None:
        """A control period has passed."""
        if world.periods % EVERY:
            return
        for name in world.movable():
            pose = world.body_pose(name)
            seen = self._things.get(name)
            if seen is None:
                self._things[name] = _Watched(
                    pose, False, _bottom(world.body(name), pose), _stands(pose)
                )
            else:
                self._things[name] = self._looked(world, name, seen, pose)

    def was_carried(self, name: str) -> bool:
        """Whether a hand has held a thing in this trial."""
        return name in self._carried

    def found(self, world: HarmedWorld) -> Tuple[Harm, ...]:
        """All that came to harm so far, in its order. What still moves is judged as it is."""
        now = [
            (name, self._harm(world, name, seen, world.body_pose(name)))
            for name, seen in self._things.items()
            if not seen.held
        ]
        seen_s = _second(world)
        return tuple(self._done + [Harm(kind, name, seen_s) for name, kind in now if kind])

    def _looked(self, world: HarmedWorld, name: str, seen: _Watched, pose: np.ndarray) -> _Watched:
        still = bool(np.abs(pose - seen.pose).max() < STILL)
        if still and not seen.held and not seen.was_held and _settled(world, name, seen, pose):
            return seen
        if world.holding(name):
            if name not in self._carried:
                self._carried.append(name)
            return _Watched(pose, True, _bottom(world.body(name), pose), seen.upright, True)
        if not still:
            return seen._replace(pose=pose, held=False)
        kind = self._harm(world, name, seen, pose)
        if kind:
            self._done.append(Harm(kind, name, _second(world)))
        return _Watched(pose, False, _bottom(world.body(name), pose), _stands(pose))

    @staticmethod
    def _harm(world: HarmedWorld, name: str, seen: _Watched, pose: np.ndarray) -> str:
        """Return what has become of a thing since it last rested, one of KINDS, or ''."""
        if seen.bottom - _bottom(world.body(name), pose) > FALL:
            return DROPPED if seen.was_held else PUSHED_OFF
        return KNOCKED_OVER if seen.upright and not _stands(pose) else ''


def _second(world: HarmedWorld) -> float:
    return round(world.periods * PERIOD, 2)


def _settled(world: HarmedWorld, name: str, seen: _Watched, pose: np.ndarray) -> bool:
    """Whether a thing that is still stands as it did when it last rested."""
    there = abs(seen.bottom - _bottom(world.body(name), pose)) < FALL / 10
    return there and seen.upright == _stands(pose)


def _stands(pose: np.ndarray) -> bool:
    return bool(pose[2, 2] > UPRIGHT)


def _bottom(body: Body, pose: np.ndarray) -> float:
    """m above the floor of a thing's lowest point."""
    x, y, z = body.size
    if body.shape != 'cylinder':
        return float(pose[2, 3] - np.abs(pose[2, :3]) @ np.array([x, y, z]) / 2)
    level = float(np.hypot(pose[2, 0], pose[2, 1]))
    return float(pose[2, 3] - x * level - abs(pose[2, 2]) * z / 2)


def harm_record(found: Tuple[Harm, ...]) -> Dict[str, object]:
    """The harm of a trial as its truth line has it: how many, which by kind, and when each."""
    record: Dict[str, object] = {'count': len(found)}
    record['seen_s'] = [[each.kind, each.thing, each.seen_s] for each in found]
    record.update({kind: [each.thing for each in found if each.kind == kind] for kind in KINDS})
    return record
