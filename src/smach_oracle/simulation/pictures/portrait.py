"""Pictures of the world from a viewpoint of its own: for people, not for the robot."""
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.transforms import transform

from ..physics.camera import RenderedView
from ..physics.world import World

SIZE = (960, 640)  # pixels
LIGHT = {
    'shadow': 1, 'lightAmbientCoeff': 0.55, 'lightDiffuseCoeff': 0.48, 'lightSpecularCoeff': 0.12,
    'lightDistance': 6.0
}
# where it stands: to the left of the camera, rad, and m above
LIGHT_TURN, LIGHT_HEIGHT = np.radians(40.0), 4.0
FAR = 5.0  # m. The horizon: with a further one the shadows get lost
BACKGROUND = (236, 238, 241)
FINER = 2  # times more pixels are drawn, each way, than shown


class Viewpoint(NamedTuple):
    """A place for a camera that watches the world."""

    eye: Tuple[float, float, float]  # m, in the world
    target: Tuple[float, float, float]  # m, what is in the middle of the picture
    field_of_view: float  # degrees, from top to bottom


AT_TABLE = Viewpoint((2.5, -1.75, 1.85), (0.36, -0.02, 0.82), 34.0)
AT_FRIDGE = Viewpoint((-0.15, -2.6, 1.85), (0.95, 0.1, 0.74), 40.0)
USUAL = {'drink_retrieval': AT_FRIDGE}  # by task; others: AT_TABLE


def portrait(world: World, size: Tuple[int, int] = SIZE,
             viewpoint: Optional[Viewpoint] = None) -> np.ndarray:
    """(h, w, 3) uint8 RGB: the world as seen from a viewpoint, or from the usual one of its task.

    :param size: width and height, pixels.
    """
    width, height = size
    eye, target, field_of_view = USUAL.get(world.scene.task,
                                           AT_TABLE) if viewpoint is None else viewpoint
    rendered = RenderedView(world, _looking(eye, target), (FINER * width, FINER * height),
                            field_of_view, FAR, lightDirection=_light(eye, target), **LIGHT)
    rendered.colour[rendered.bodies < 0] = BACKGROUND
    blocks = rendered.colour.reshape(height, FINER, width, FINER, 3)
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
