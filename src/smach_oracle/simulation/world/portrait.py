"""Pictures of the world from a camera that nobody carries: for people, not for the robot."""
from typing import List, Sequence, Tuple

import numpy as np

from ...geometry.transforms import transform
from .camera import View
from .physics import World

SIZE = (960, 640)  # pixels
EYE, TARGET = (2.6, -2.2, 1.9), (0.45, -0.05, 0.78)  # m, in the world
LIGHT = {'shadow': 1, 'lightAmbientCoeff': 0.55, 'lightDiffuseCoeff': 0.48, 'lightSpecularCoeff': 0.12,
         'lightDistance': 6.0}
LIGHT_TURN, LIGHT_HEIGHT = np.radians(40.0), 4.0  # where it stands: to the left of the camera, rad, and m above
FAR = 5.0  # m; the horizon: with a further one the shadows get lost
BACKGROUND = (236, 238, 241)
FINER = 2  # times more pixels are drawn, each way, than shown


def portrait(world: World, size: Tuple[int, int] = SIZE, eye: Sequence[float] = EYE,
             target: Sequence[float] = TARGET, field_of_view: float = 34.0) -> np.ndarray:
    """(h, w, 3) uint8 RGB: the world as seen from `eye` towards `target` (m, in the world).

    :param size: width and height, pixels.
    :param field_of_view: degrees, from top to bottom.
    """
    width, height = size
    view = View(world, _looking(eye, target), (FINER * width, FINER * height), field_of_view, FAR,
                lightDirection=_light(eye, target), **LIGHT)
    view.colour[view.bodies < 0] = BACKGROUND
    blocks = view.colour.reshape(height, FINER, width, FINER, 3)
    return blocks.mean(axis=(1, 3)).round().astype(np.uint8)


def _light(eye: Sequence[float], target: Sequence[float]) -> List[float]:
    """From where the light comes."""
    x, y, _ = np.subtract(eye, target)
    sine, cosine = np.sin(LIGHT_TURN), np.cos(LIGHT_TURN)
    return [x * cosine - y * sine, x * sine + y * cosine, LIGHT_HEIGHT]


def _looking(eye: Sequence[float], target: Sequence[float]) -> np.ndarray:
    """4x4, the world from a camera (z forward, x right, y down) that is held level."""
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return transform(eye, np.column_stack([right, np.cross(forward, right), forward]))
