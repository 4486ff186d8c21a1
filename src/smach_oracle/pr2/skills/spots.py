"""Spots to put something down: the place itself, and free spots next to it."""

from typing import Iterator, List, Mapping, Tuple

import numpy as np

from ..kitchen import MapBox

GRID = 0.02  # m between spots
USUAL = 0.02  # m beside the place that is near enough, where nothing else is said
ROOM = 0.004  # m that must be left around what is put down
COMFORT = 0.025  # m that should be
CROWDED = 1.5  # m farther for each m of room that is lacking
FARTHEST = 0.5  # m, of a tolerance


def spots(centre: np.ndarray, tolerance: float) -> Iterator[np.ndarray]:
    """Places (3,) within `tolerance` m of a place, the nearest first. 0 means within USUAL."""
    reach = tolerance if tolerance > 0 else USUAL
    steps = int(np.floor(reach / GRID + 1e-9))
    beside = [
        (GRID * i, GRID * j)
        for i in range(-steps, steps + 1)
        for j in range(-steps, steps + 1)
        if np.hypot(i, j) * GRID <= reach + 1e-9
    ]
    for x, y in sorted(beside, key=lambda each: (round(float(np.hypot(*each)), 6), each)):
        yield centre + [x, y, 0.0]


def free_spots(
    centre: np.ndarray,
    tolerance: float,
    half: np.ndarray,
    boxes: Mapping[str, MapBox],
    support: str,
) -> Tuple[List[np.ndarray], List[str]]:
    """The spots on which nothing stands, best first, and the names of what stands on others.

    The nearest are best. A spot with a thing close by is as good as one that is farther by CROWDED
    times what is lacking to COMFORT, for hand and camera err.

    :param centre: (3,) m in base_footprint, of what is put down.
    :param half: (3,) m, its half extents.
    :param boxes: what stands there, and the support.
    """
    found: List[Tuple[float, int, np.ndarray]] = []
    taken: List[str] = []
    for order, spot in enumerate(spots(centre, tolerance)):
        room = {name: _room(spot, half, box) for name, box in boxes.items() if name != support}
        inside = [name for name, each in room.items() if each < ROOM]
        taken += inside
        if not inside:
            lacking = max(0.0, COMFORT - min(room.values(), default=COMFORT))
            away = float(np.hypot(*(spot - centre)[:2]))
            found.append((round(away + CROWDED * lacking, 6), order, spot))
    return [spot for _, _, spot in sorted(found, key=lambda each: each[:2])], sorted(set(taken))


def _room(spot: np.ndarray, half: np.ndarray, box: MapBox) -> float:
    """m between something round that stands at a spot and a box, below 0 where they meet."""
    if abs(spot[2] - box.centre[2]) > half[2] + box.half[2]:
        return float('inf')
    outside = np.maximum(box.beyond(spot), 0.0)
    # the narrower side, for what is long may be turned
    return float(np.hypot(*outside) - min(half[:2]))
