"""A person's view of an image: the things recognised in it, and about where they are. Pure.

Places come from the outlines and the measured depth alone, so they err as these do. Where the depth
is lost, a person still tells about where a thing stands, by what it stands on.
"""

from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy import ndimage

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import points_of
from smach_oracle.geometry.marked_object import object_above
from smach_oracle.geometry.plane import Plane, find_plane

ON_SURFACE = 0.008  # m: what is not higher belongs to the surface
LEAST_DEPTH = 25  # pixels of an outline with a depth
LEVEL = 0.01  # m, of a surface
LEAST_SURFACE = 60  # points
ROBOT = 'robot'  # the name under which its limbs are recognised
BESIDE = 0.015  # of the image's width: a limb that near a thing hinders
LEAST_LIMB = 0.0003  # of the image's pixels
FLOOR = 0.25  # m: things are put on furniture, which is higher
STANDING = 0.03  # m between the lowest point that is seen of a thing and what it stands on
WELL_SEEN = 0.2  # of the points of the level with the most of them
WHITE = 240  # each of a pixel's three values, of 255, where light is too bright
LEAST_GLARE = 0.005  # of the image's pixels
DIM = 65.0  # of 255: the mean of an image, below which there is little light
LYING = 0.75  # of its height: what is seen lower has fallen over
LONG = 1.25  # of its height: what is seen wider lies, where nobody has seen it stand
TOP_BAND = 0.02  # m below its highest point, that belongs to the top of a thing

Region = Tuple[int, int, int, int]  # px: x, y, width, height


class Outline(NamedTuple):
    """A thing as it was recognised."""

    name: str
    wanted: bool  # the task is about it
    movable: bool
    mask: np.ndarray  # (h, w) bool, as large as the image


class SeenThing(NamedTuple):
    """A thing that is seen."""

    name: str
    wanted: bool
    movable: bool
    region: Region
    mask: np.ndarray  # (h, w) bool
    box: Optional[UprightBox]  # in base_footprint. None means nobody can tell where it is
    top: Optional[np.ndarray] = None  # (3,) m, the middle of its top, as far as that is seen
    low: float = 0.0  # m above the floor, its lowest point that is seen
    stands: bool = False  # it is seen to stand on a surface

    @property
    def bottom(self) -> float:
        """m above the floor, or 0 where nobody can tell."""
        return float(self.box.centre[2] - self.box.size[2] / 2) if self.box is not None else 0.0

    def lies(self, tall: Optional[float]) -> bool:
        """Whether it lies.

        :param tall: m, of the thing when it was seen standing. None means it was not.
        """
        if self.box is None:
            return False
        height = float(self.box.size[2])
        return height < LYING * tall if tall is not None else self.box.wide > LONG * height


class SeenScene(NamedTuple):
    """The scene that is seen at one moment."""

    things: List[SeenThing]
    image: CameraImage
    limbs: Optional[np.ndarray] = None  # (h, w) bool: where the robot's own limbs are seen

    def wanted(self) -> Optional[SeenThing]:
        """Return the object of the task, None where it is not seen."""
        return next((thing for thing in self.things if thing.wanted), None)

    def named(self, name: str) -> Optional[SeenThing]:
        """Return the thing of that name, None where it is not seen."""
        return next((thing for thing in self.things if thing.name == name), None)

    def covered(self, thing: SeenThing) -> bool:
        """Whether a limb of the robot is seen right beside a thing, or before it."""
        if self.limbs is None:
            return False
        beside = ndimage.binary_dilation(
            thing.mask, iterations=max(1, round(BESIDE * thing.mask.shape[1]))
        )
        return int((beside & self.limbs).sum()) > LEAST_LIMB * thing.mask.size

    def dazzled(self) -> bool:
        """Whether part of the image is white and without depth: light falls into the camera."""
        white = self.image.colour.min(axis=-1) > WHITE
        return float((white & ~np.isfinite(self.image.depth)).mean()) > LEAST_GLARE

    def dim(self) -> bool:
        """Whether there is little light."""
        return float(self.image.colour.mean()) < DIM

    def heights(self) -> Dict[str, float]:
        """Return how tall (m) the things are that are seen standing, by name."""
        return {
            thing.name: float(thing.box.size[2])
            for thing in self.things
            if thing.stands and thing.box is not None and not thing.lies(None)
        }

    def boxes_but(self, *names: str) -> List[UprightBox]:
        """The boxes of all other movable things."""
        return [
            thing.box
            for thing in self.things
            if thing.movable and thing.box is not None and thing.name not in names
        ]

    def near(self, point: np.ndarray, within: float) -> Optional[SeenThing]:
        """The movable thing whose middle is nearest to a point (3,) m, within that many m."""
        beside = [
            (float(np.linalg.norm(thing.box.centre - point)), number)
            for number, thing in enumerate(self.things)
            if thing.movable and thing.box is not None
        ]
        distance, number = min(beside, default=(np.inf, -1))
        return self.things[number] if distance <= within else None

    def surface_at(
        self, place: np.ndarray, radius: float = 0.09, below: float = np.inf
    ) -> Optional[float]:
        """m above the floor of the level surface that is seen at a place (2,) or (3,) m.

        :param radius: m around the place that are looked at.
        :param below: m. What is higher does not count.
        :returns: None where too little of it is seen.
        """
        points = self._free_points()
        near = np.hypot(*(points[:, :2] - np.asarray(place)[:2]).T) < radius
        heights = points[near & (points[:, 2] > FLOOR) & (points[:, 2] < below), 2]
        if len(heights) < LEAST_SURFACE:
            return None
        counts, edges = np.histogram(
            heights, np.arange(heights.min(), heights.max() + 2 * LEVEL, LEVEL)
        )
        # the highest of those that are seen well: a shelf is seen beneath another one
        level = edges[int(np.flatnonzero(counts >= WELL_SEEN * counts.max())[-1])]
        close = heights[(heights > level - LEVEL / 2) & (heights < level + 1.5 * LEVEL)]
        return float(np.median(close))

    def _free_points(self) -> np.ndarray:
        """(n, 3) m: measured points that belong to no thing."""
        free = np.isfinite(self.image.depth)
        if self.limbs is not None:
            free &= ~self.limbs
        for thing in self.things:
            if thing.movable:
                free &= ~thing.mask
        points = points_of(self.image.depth, self.image.intrinsics, self.image.base_from_camera)
        found: np.ndarray = points[free]
        return found


def seen_scene(image: CameraImage, outlines: Sequence[Outline]) -> SeenScene:
    """Return what a person makes of an image and the outlines recognised in it."""
    points = points_of(image.depth, image.intrinsics, image.base_from_camera)
    limbs = next((each.mask for each in outlines if each.name == ROBOT), None)
    outlines = [each for each in outlines if each.name != ROBOT]
    taken = np.zeros(image.depth.shape, bool)
    for outline in outlines:
        taken |= outline.mask
    if limbs is not None:
        taken |= limbs
    return SeenScene([_seen(image, points, taken, outline) for outline in outlines], image, limbs)


def _seen(image: CameraImage, points: np.ndarray, taken: np.ndarray, outline: Outline) -> SeenThing:
    rows, columns = np.nonzero(outline.mask)
    region = (int(columns.min()), int(rows.min()), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1)
    own = points[outline.mask & np.isfinite(points[..., 2])]
    surface = _surface_around(points, taken, region)
    box, stands = None, False
    if len(own) >= LEAST_DEPTH:
        found = object_above(own, surface, ON_SURFACE)
        box = found.box if found is not None else None
        own = own[found.chosen] if found is not None else own
        stands = (
            box is not None
            and surface is not None
            and bool(
                np.percentile(own[:, 2], 2) < surface.z_at(*own[:, :2].mean(axis=0)) + STANDING
            )
        )
    elif surface is not None:
        box = _guessed(image, region, surface)
    return SeenThing(
        outline.name,
        outline.wanted,
        outline.movable,
        region,
        outline.mask,
        box,
        _top(own) if box is not None and len(own) else None,
        float(np.percentile(own[:, 2], 2)) if len(own) else 0.0,
        stands,
    )


def _surface_around(points: np.ndarray, taken: np.ndarray, region: Region) -> Optional[Plane]:
    """Return the surface that a thing stands on, where enough of it is seen around the region."""
    left, top, width, height = region
    across, down = max(12, int(0.8 * width)), max(12, int(0.5 * height))
    window = (
        slice(max(0, top - down // 2), top + height + down),
        slice(max(0, left - across), left + width + across),
    )
    around = points[window][~taken[window]]
    around = around[np.isfinite(around[:, 2])]
    return find_plane(around, np.random.default_rng(1), least=max(150, len(around) // 10))


def _guessed(image: CameraImage, region: Region, surface: Plane) -> Optional[UprightBox]:
    """About where a thing stands of which only the outline is seen: by its foot on the surface."""
    left, top, width, height = region
    foot = _ray(image, left + width / 2, top + height - 1.0)
    eye = image.base_from_camera[:3, 3]
    away = (surface.point - eye) @ surface.normal / min(foot @ surface.normal, -1e-6)
    if not 0.2 < away < 3.0:
        return None
    spot = eye + away * foot
    wide = float(width * away / image.intrinsics[0, 0])
    slope = float(np.hypot(foot[0], foot[1]))  # a thing that stands is seen foreshortened
    tall = float(height * away / image.intrinsics[1, 1] / max(slope, 0.3))
    spot = spot + foot * [1, 1, 0] / max(slope, 0.1) * wide / 2
    return UprightBox(spot + [0.0, 0.0, tall / 2], np.array([wide, wide, tall]), 0.0)


def _ray(image: CameraImage, column: float, row: float) -> np.ndarray:
    """(3,) unit vector in base_footprint along which the camera sees a pixel."""
    k = image.intrinsics
    ray = np.array([(column - k[0, 2]) / k[0, 0], (row - k[1, 2]) / k[1, 1], 1.0])
    turned: np.ndarray = image.base_from_camera[:3, :3] @ (ray / np.linalg.norm(ray))
    return turned


def _top(points: np.ndarray) -> np.ndarray:
    """(3,) m: the middle of the highest part of a thing's points (n, 3)."""
    high = float(np.percentile(points[:, 2], 97))
    band = points[points[:, 2] > high - TOP_BAND]
    low, far = np.percentile(band[:, :2], [3, 97], axis=0)
    return np.array([*((low + far) / 2), float(np.median(band[:, 2]))])
