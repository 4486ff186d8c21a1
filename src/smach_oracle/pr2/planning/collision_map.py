"""Maps to plan in: boxes made of what was detected, or of all that an image shows."""

import collections
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.camera_image import CameraImage

from ..kitchen import MapBox
from ..perception.clusters import Capsule, cloud_of
from .arm import SkillError, seed_of

TABLE = 'table'
THICK = 0.04  # m, of a table top of which only the upper face is seen
PADDING = 0.004  # m around objects
TABLE_ERROR = 0.01  # m that a table may be higher than it is seen
EDGE = 0.02  # m that the table goes on beyond what is seen of it
CELL = 0.03  # m, of the boxes made of an image
# lowest and highest corner of what is looked at
REGION = (np.array([0.15, -1.0, 0.2]), np.array([1.5, 1.0, 1.6]))
MOST_BOXES = 600
KEPT = 20  # maps


class CollisionMap(NamedTuple):
    """Boxes by name, and the objects among them."""

    boxes: Dict[str, MapBox]
    objects: Tuple[UprightBox, ...]


class CollisionMapStore:
    """The maps made last, by their ids."""

    def __init__(self) -> None:
        self._maps: 'collections.OrderedDict[str, CollisionMap]' = collections.OrderedDict()

    def keep(self, made: CollisionMap) -> str:
        """Its id, which depends on its content alone."""
        name = 'map_{:08x}'.format(
            seed_of(
                *[
                    part
                    for key in sorted(made.boxes)
                    for part in (
                        key,
                        np.asarray(made.boxes[key].centre),
                        np.asarray(made.boxes[key].half),
                        made.boxes[key].yaw,
                    )
                ]
            )
        )
        self._maps.pop(name, None)
        self._maps[name] = made
        while len(self._maps) > KEPT:
            self._maps.popitem(last=False)
        return name

    def find(self, name: str) -> CollisionMap:
        """The map of this id.

        :raises SkillError: where there is none.
        """
        if name not in self._maps:
            raise SkillError(
                'no collision map {!r}; known: {}'.format(name, ', '.join(self._maps) or 'none')
            )
        return self._maps[name]


def map_of(table: UprightBox, objects: Sequence[UprightBox]) -> CollisionMap:
    """The map of a table and the objects on it.

    :raises SkillError: for a table or object without extent.
    """
    for name, box in [('the table', table)] + [
        ('object {}'.format(k), box) for k, box in enumerate(objects)
    ]:
        flat = box.size[:2] if box is table else box.size
        if not np.all(np.asarray(flat) > 0.002) or np.max(box.size) > 3.0:
            raise SkillError(
                '{} has the size {} m; 0.2 cm to 3 m are allowed'.format(
                    name, ' x '.join('{:.3f}'.format(each) for each in box.size)
                )
            )
    top = table.centre[2] + table.size[2] / 2
    boxes = {
        TABLE: MapBox(
            np.array([table.centre[0], table.centre[1], top - THICK / 2]),
            np.array([table.size[0] / 2 + EDGE, table.size[1] / 2 + EDGE, THICK / 2]),
            table.yaw,
        )
    }
    for k, box in enumerate(objects):
        boxes['object {}'.format(k)] = MapBox(box.centre, box.size / 2 + PADDING, box.yaw)
    return CollisionMap(boxes, tuple(objects))


def with_margin(boxes: Mapping[str, MapBox]) -> Dict[str, MapBox]:
    """The boxes with a higher table: it is seen too low by as much as camera and encoders err.

    A forearm that passes over its edge would get caught on it.
    """
    higher = dict(boxes)
    if TABLE in higher:
        table = higher[TABLE]
        higher[TABLE] = table._replace(
            centre=table.centre + [0.0, 0.0, TABLE_ERROR / 2],
            half=table.half + [0.0, 0.0, TABLE_ERROR / 2],
        )
    return higher


def around(made: CollisionMap, target: UprightBox) -> Dict[str, MapBox]:
    """The boxes of a map without the one of `target`."""
    near = nearest_object(made, target.centre)
    return {
        name: box
        for name, box in made.boxes.items()
        if near is None or name != 'object {}'.format(near)
    }


def nearest_object(made: CollisionMap, point: np.ndarray, within: float = 0.05) -> Optional[int]:
    """Index of the object at a point (3,) of base_footprint.

    :param within: m that it may be beside the point.
    :returns: None where there is none.
    """
    distances = [float(np.hypot(*(box.centre - point)[:2])) for box in made.objects]
    if not distances or min(distances) > within:
        return None
    return int(np.argmin(distances))


def map_of_image(
    image: CameraImage, limbs: Sequence[Capsule], target: Optional[UprightBox] = None
) -> CollisionMap:
    """The map of all that an image shows within REGION.

    :param limbs: of the robot. They are left out.
    :param target: the object to be picked, left out as well.
    """
    points = cloud_of(image, limbs).points.reshape(-1, 3)
    points = points[np.all((points > REGION[0]) & (points < REGION[1]), axis=1)]
    if target is not None:
        points = points[~_inside(points, target)]
    return CollisionMap(
        {'seen {}'.format(k): box for k, box in enumerate(_columns(points)[:MOST_BOXES])}, ()
    )


def _inside(points: np.ndarray, box: UprightBox, margin: float = 0.012) -> np.ndarray:
    away = points - box.centre
    along = away[:, 0] * np.cos(box.yaw) + away[:, 1] * np.sin(box.yaw)
    across = away[:, 1] * np.cos(box.yaw) - away[:, 0] * np.sin(box.yaw)
    return (
        (np.abs(along) < box.size[0] / 2 + margin)
        & (np.abs(across) < box.size[1] / 2 + margin)
        & (np.abs(away[:, 2]) < box.size[2] / 2 + margin)
    )


def _columns(points: np.ndarray, least: int = 3) -> List[MapBox]:
    """Boxes of CELL in width, as long in y as cells lie side by side.

    :param points: (n, 3).
    :param least: points of a cell. Fewer are noise.
    """
    if not len(points):
        return []
    cells, counts = np.unique(np.floor(points / CELL).astype(int), axis=0, return_counts=True)
    cells = cells[counts >= least]
    order = np.lexsort((cells[:, 1], cells[:, 2], cells[:, 0]))
    boxes: List[MapBox] = []
    run: List[np.ndarray] = []
    for cell in cells[order]:
        if run and (cell[0] != run[-1][0] or cell[2] != run[-1][2] or cell[1] != run[-1][1] + 1):
            boxes.append(_box(run))
            run = []
        run.append(cell)
    return boxes + ([_box(run)] if run else [])


def _box(run: List[np.ndarray]) -> MapBox:
    lower, upper = run[0] * CELL, (run[-1] + 1) * CELL
    return MapBox((lower + upper) / 2, (upper - lower) / 2, 0.0)
