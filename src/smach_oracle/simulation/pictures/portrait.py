"""Pictures of the world from a viewpoint of its own: for people, not for the robot."""

from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.transforms import transform

from ..physics.camera import RenderedView
from ..physics.world import World

SIZE = (960, 640)  # pixels
LIGHT = {
    'shadow': 1,
    'lightAmbientCoeff': 0.55,
    'lightDiffuseCoeff': 0.48,
    'lightSpecularCoeff': 0.12,
    'lightDistance': 6.0,
}
# where it stands: to the left of the camera, rad, and m above
LIGHT_TURN, LIGHT_HEIGHT = np.radians(40.0), 4.0
FAR = 5.0  # m. The horizon: with a further one the shadows get lost
BACKGROUND = (236, 238, 241)
FINER = 2  # times more pixels are drawn, each way, than shown
Point = Tuple[float, float, float]


class Viewpoint(NamedTuple):
    """A place for a camera that watches the world."""

    eye: Point  # m, in the world
    target: Point  # m, what is in the middle of the picture
    field_of_view: float  # degrees, from top to bottom


AT_TABLE = Viewpoint((2.5, -1.75, 1.85), (0.36, -0.02, 0.82), 34.0)
AT_FRIDGE = Viewpoint((-0.15, -2.6, 1.85), (0.95, 0.1, 0.74), 40.0)
AT_PERSON = Viewpoint((-2.4, -1.0, 1.75), (0.12, 0.42, 0.75), 37.5)
KITCHEN = 'drink_retrieval'  # the task with these two. Others: AT_TABLE
# m, x of the robot. Up to the first it is seen from AT_PERSON, from the second on from AT_FRIDGE.
# It hands over at 0. When it opens and closes the door, it comes back to 0.47
GLIDE = (0.05, 0.42)


def portrait(
    world: World, size: Tuple[int, int] = SIZE, viewpoint: Optional[Viewpoint] = None
) -> np.ndarray:
    """(h, w, 3) uint8 RGB: the world as seen from a viewpoint, or from that of `usual_viewpoint`.

    :param size: width and height, pixels.
    """
    width, height = size
    view = rendered(world, (FINER * width, FINER * height), viewpoint)
    view.colour[view.bodies < 0] = BACKGROUND
    blocks = view.colour.reshape(height, FINER, width, FINER, 3)
    return blocks.mean(axis=(1, 3)).round().astype(np.uint8)


def rendered(
    world: World, size: Tuple[int, int], viewpoint: Optional[Viewpoint] = None
) -> RenderedView:
    """Return the view that a portrait shows, as the renderer draws it."""
    eye, target, field_of_view = usual_viewpoint(world) if viewpoint is None else viewpoint
    return RenderedView(
        world,
        _looking(eye, target),
        size,
        field_of_view,
        FAR,
        lightDirection=_light(eye, target),
        **LIGHT,
    )


def usual_viewpoint(world: World) -> Viewpoint:
    """Return from where a world's task is seen well, as its robot stands.

    In the kitchen it glides along while the robot drives from the refrigerator to the person.
    """
    if world.scene.task != KITCHEN:
        return AT_TABLE
    x = world.true_base()[0, 3]
    share = float(np.clip((x - GLIDE[0]) / (GLIDE[1] - GLIDE[0]), 0.0, 1.0))
    return _between(AT_PERSON, AT_FRIDGE, share * share * (3.0 - 2.0 * share))


def _between(one: Viewpoint, other: Viewpoint, share: float) -> Viewpoint:
    """Return one viewpoint at share 0, the other at share 1."""

    def mixed(here: Point, there: Point) -> Point:
        x, y, z = ((1.0 - share) * a + share * b for a, b in zip(here, there))
        return x, y, z

    return Viewpoint(
        mixed(one.eye, other.eye),
        mixed(one.target, other.target),
        (1.0 - share) * one.field_of_view + share * other.field_of_view,
    )


def _light(eye: Sequence[float], target: Sequence[float]) -> List[float]:
    """Return the place from which the light comes."""
    x, y, _ = np.subtract(eye, target)
    sine, cosine = np.sin(LIGHT_TURN), np.cos(LIGHT_TURN)
    return [x * cosine - y * sine, x * sine + y * cosine, LIGHT_HEIGHT]


def _looking(eye: Sequence[float], target: Sequence[float]) -> np.ndarray:
    """4x4, the world from a camera (z forward, x right, y down) that is held level."""
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return transform(eye, np.column_stack([right, np.cross(forward, right), forward]))
