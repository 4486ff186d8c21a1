"""Causes that may make a trial fail, drawn from its seed: things in the world, never a failure."""

import math
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..site import GAUGE_RANGE, PANELS, before_panel
from .base import WetPatch
from .extra_causes import SLACK_TYRE, Plume, extra_kind, plume, veer
from .people import Errand

# of each cause, by itself
CHANCE = {
    'person_in_the_way': 0.35,
    'person_at_the_panel': 0.3,
    'wet_floor': 0.35,
    'glare': 0.3,
    'low_battery': 0.25,
}
LASTING = frozenset(('wet_floor', SLACK_TYRE))  # there at a second try, too, and after a restart
# on the robot's ways: where people stop for a talk (m), and when a robot without trouble passes (s)
CROSSINGS = (
    (1.5, 3.6, 4.0),
    (2.9, 5.3, 12.0),
    (4.3, 4.0, 15.0),
    (4.8, 2.4, 17.0),
    (6.5, 2.1, 25.0),
    (8.0, 3.9, 29.0),
)
AT_PANEL_S = {1: 8.0, 2: 20.0, 3: 32.0}  # when it looks at each panel
PUDDLES = ((1.7, 4.6), (4.4, 3.2), (4.9, 2.2), (7.4, 2.6), (8.0, 4.2))
# where people who walk about come from, and go to
CORNERS = ((0.6, 6.4), (0.6, 3.7), (4.1, 6.4), (5.9, 5.9), (4.2, 0.6), (9.4, 6.4), (9.4, 1.2))


class Glare(NamedTuple):
    """Sunlight that a panel's glass throws into the camera, seen from one side."""

    panel: int  # number of the panel
    angle: float  # rad between the panel's normal and the direction in which the light goes
    begins_s: float  # of the trial
    ends_s: float


class Sag(NamedTuple):
    """The battery's voltage breaks down. The base takes the power from its motors meanwhile."""

    begins_s: float  # of the trial
    ends_s: float


class TrialScene(NamedTuple):
    """One trial's world."""

    seed: int
    causes: Tuple[str, ...]
    readings: Dict[int, float]  # bar, by the number of the panel
    errands: Tuple[Errand, ...]
    wet: Optional[WetPatch] = None
    glare: Optional[Glare] = None
    sag: Optional[Sag] = None
    veer: float = 0.0  # rad for each m of way, that a slack tyre turns the robot
    plume: Optional[Plume] = None  # of steam


def draw(seed: int, only: Optional[Sequence[str]] = None, extra: bool = False) -> TrialScene:
    """The world of a seed.

    :param only: the causes that are there for certain, and no others. None means each by its
        chance.
    :param extra: with one of the extra causes, and no others.
    :raises ValueError: for a cause that is not among CHANCE, or for causes and `extra` together.
    """
    if extra:
        if only is not None:
            raise ValueError('extra causes: no other causes are allowed beside them')
        return _with_extra_cause(draw(seed, ()))
    unknown = sorted(set(only or ()) - set(CHANCE))
    if unknown:
        raise ValueError('cause {!r}: allowed are {}'.format(unknown[0], ', '.join(CHANCE)))
    rng = np.random.default_rng(seed)
    drawn = {kind: rng.random() < chance for kind, chance in CHANCE.items()}
    causes = tuple(kind for kind in CHANCE if (drawn[kind] if only is None else kind in only))
    readings = {
        panel.number: round(float(rng.uniform(0.5, GAUGE_RANGE - 0.5)), 2) for panel in PANELS
    }
    # each is drawn in any case: a seed's puddle is where it is, with or without other causes
    wet, glare, sag = _wet(rng), _glare(rng), _sag(rng)
    blocking, looking, strolling = _blocking(rng), _looking(rng), _strolling(rng)
    errands = [strolling] + [
        errand._replace(cause=kind)
        for errand, kind in ((blocking, 'person_in_the_way'), (looking, 'person_at_the_panel'))
        if kind in causes
    ]
    return TrialScene(
        seed,
        causes,
        readings,
        tuple(errands),
        wet=wet if 'wet_floor' in causes else None,
        glare=glare if 'glare' in causes else None,
        sag=sag if 'low_battery' in causes else None,
    )


def _with_extra_cause(scene: TrialScene) -> TrialScene:
    kind = extra_kind(scene.seed)
    scene = scene._replace(causes=(kind,))
    if kind == SLACK_TYRE:
        return scene._replace(veer=veer(scene.seed))
    return scene._replace(plume=plume(scene.seed, CROSSINGS, AT_PANEL_S))


def _pick(rng: np.random.Generator, places: Sequence[Tuple[float, float]]) -> Tuple[float, float]:
    return places[int(rng.integers(len(places)))]


def _wet(rng: np.random.Generator) -> WetPatch:
    x, y = _pick(rng, PUDDLES)
    side = 1 if rng.random() < 0.5 else -1
    return WetPatch(x, y, float(rng.uniform(0.5, 0.8)), float(side * rng.uniform(0.3, 0.7)))


def _glare(rng: np.random.Generator) -> Glare:
    panel = PANELS[int(rng.integers(len(PANELS)))]
    begins_s = float(rng.uniform(0.0, 20.0))
    return Glare(
        panel.number,
        math.radians(rng.uniform(-8.0, 8.0)),
        begins_s,
        begins_s + float(rng.uniform(15.0, 35.0)),
    )


def _sag(rng: np.random.Generator) -> Sag:
    begins_s = float(rng.uniform(3.0, 30.0))
    return Sag(begins_s, begins_s + float(rng.uniform(5.0, 15.0)))


def _blocking(rng: np.random.Generator) -> Errand:
    """Somebody stops on one of the robot's ways."""
    x, y, passes_s = CROSSINGS[int(rng.integers(len(CROSSINGS)))]
    return _there_and_back((x, y), passes_s - rng.uniform(3.0, 10.0), rng.uniform(10.0, 25.0))


def _looking(rng: np.random.Generator) -> Errand:
    """Somebody stands before a panel and looks at it."""
    panel = PANELS[int(rng.integers(len(PANELS)))]
    x, y, _ = before_panel(panel, 0.45, float(rng.uniform(-0.05, 0.05)))
    looks_s = AT_PANEL_S[panel.number] - rng.uniform(3.0, 10.0)
    return _there_and_back((x, y), looks_s, rng.uniform(10.0, 25.0))


def _there_and_back(where: Tuple[float, float], begins_s: float, stands_s: float) -> Errand:
    """Return an errand from the nearest corner, from where they can walk straight, and back."""
    corner = min(CORNERS, key=lambda each: math.hypot(each[0] - where[0], each[1] - where[1]))
    return Errand(max(0.0, float(begins_s)), (corner, where, corner), (0.0, float(stands_s), 0.0))


def _strolling(rng: np.random.Generator) -> Errand:
    """Somebody walks to and fro in a room, across the robot's way, and stands next to it."""
    rooms: List[Tuple[Tuple[float, float], ...]] = [
        ((0.6, 3.7), (2.9, 3.4)),
        ((4.1, 1.6), (5.9, 3.8)),
        ((7.1, 5.9), (9.4, 1.6)),
    ]
    ends = rooms[int(rng.integers(len(rooms)))]
    places = tuple(ends[turn % 2] for turn in range(8))
    return Errand(
        float(rng.uniform(0.0, 5.0)), places, tuple(float(rng.uniform(2.0, 8.0)) for _ in places)
    )
