"""The effect of light on the head camera's images for a time: it fails, or falls into the lens.

A glare begins at a place that reflects the sun or a lamp towards a point, the `eye`. Seen from near
the ray to that point, the place itself is too bright, and so is its mirror image in the lens, at
the opposite side of the image's centre: from a base or a torso elsewhere there is none, and with
another direction of the head the patch lies on other things.
"""

from typing import Dict, List, NamedTuple, Tuple

import numpy as np

from smach_oracle.geometry.transforms import apply, inverse

from ..scenes.scene import CameraQuality

# of a disturbance: what may be given, and what it is where it is not
OPTIONS: Dict[str, Dict[str, float]] = {
    'dim': {'brightness': 0.15, 'duration': 60.0},
    'glare': {
        'x': 0.0,
        'y': 0.0,
        'z': 0.0,
        'eye_x': 0.0,
        'eye_y': 0.0,
        'eye_z': 0.0,
        'radius': 0.2,
        'lobe': 0.2,
        'duration': 60.0,
    },
}
PLACES = ('x', 'y', 'z', 'eye_x', 'eye_y', 'eye_z')  # which may be negative, m in the world
SOFT = 1.3  # times the radius of a patch, or of a lobe, where it has faded out
INTO_LENS = 0.9  # rad off the optical axis from which light still gets into the lens


class Light(NamedTuple):
    """A spell of bad light for images, from a control period up to another."""

    kind: str  # 'dim' or 'glare'
    values: Dict[str, float]
    begins: int
    ends: int


class Lights:
    """The lights of one trial."""

    def __init__(self) -> None:
        self._all: List[Light] = []

    def add(self, light: Light) -> None:
        """One more. It need not have begun."""
        self._all.append(light)

    def quality(self, quality: CameraQuality, period: int) -> CameraQuality:
        """Return how well the camera sees at a control period.

        :param quality: of the camera undisturbed.
        """
        for each in self._at('dim', period):
            quality = quality._replace(
                brightness=min(quality.brightness, each.values['brightness'])
            )
        return quality

    def dazzled(
        self,
        period: int,
        world_from_camera: np.ndarray,
        intrinsics: np.ndarray,
        size: Tuple[int, int],
    ) -> np.ndarray:
        """Return how much of each pixel is lost to glare, (h, w), 0 to 1.

        :param world_from_camera: 4x4, z forward.
        :param intrinsics: (3, 3).
        :param size: width and height, pixels.
        """
        lost = np.zeros(size[::-1], np.float32)
        for each in self._at('glare', period):
            lost = np.maximum(lost, patches(each.values, world_from_camera, intrinsics, size))
        return lost

    def _at(self, kind: str, period: int) -> List[Light]:
        return [
            each for each in self._all if each.kind == kind and each.begins <= period < each.ends
        ]


def patches(
    values: Dict[str, float],
    world_from_camera: np.ndarray,
    intrinsics: np.ndarray,
    size: Tuple[int, int],
) -> np.ndarray:
    """The patches of one glare; parameters and result as of `Lights.dazzled`.

    :param values: as in OPTIONS; radius and lobe in rad.
    """
    source = np.array([values[name] for name in PLACES[:3]])
    eye = np.array([values[name] for name in PLACES[3:]])
    off = _angle(world_from_camera[:3, 3] - source, eye - source)
    glint = apply(inverse(world_from_camera), source)
    if glint[2] < np.cos(INTO_LENS) * np.linalg.norm(glint):
        return np.zeros(size[::-1], np.float32)
    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    rays = np.stack(
        [
            (columns - intrinsics[0, 2]) / intrinsics[0, 0],
            (rows - intrinsics[1, 2]) / intrinsics[1, 1],
            np.ones(columns.shape),
        ],
        axis=-1,
    )
    mirrored = glint * (-1.0, -1.0, 1.0)
    radius = values['radius']
    bright = np.maximum(
        _share(_angle(rays, glint), radius / 2), _share(_angle(rays, mirrored), radius)
    )
    return np.asarray(_share(off, values['lobe']) * bright, np.float32)


def _share(angle: np.ndarray, radius: float) -> np.ndarray:
    """1 within the radius, and down to 0 at SOFT times that."""
    return np.clip((SOFT * radius - angle) / ((SOFT - 1) * radius + 1e-9), 0.0, 1.0)


def _angle(rays: np.ndarray, way: np.ndarray) -> np.ndarray:
    """rad between vectors (..., 3) and one (3,)."""
    lengths = np.linalg.norm(rays, axis=-1) * np.linalg.norm(way)
    return np.arccos(np.clip(rays @ way / np.maximum(lengths, 1e-9), -1.0, 1.0))
