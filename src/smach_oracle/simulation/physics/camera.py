"""The head camera: PyBullet's software renderer, with the errors of a depth camera."""

import math
from typing import List, Optional, Tuple

import numpy as np
import pybullet
from scipy import ndimage

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.pr2.robot import CAMERA_FRAME

from ..scenes.scene import CameraQuality
from .neck import NECK, neck
from .world import World

WIDTH, HEIGHT = 640, 480  # pixels of the sensor
FIELD_OF_VIEW = 45.0  # degrees, from top to bottom
NEAR, FAR = 0.2, 5.0  # m
FOCAL = HEIGHT / 2 / math.tan(math.radians(FIELD_OF_VIEW) / 2)  # pixels


def _intrinsics(binning: int) -> np.ndarray:
    focal = FOCAL / binning
    return np.array(
        [
            [focal, 0.0, (WIDTH // binning - 1) / 2],
            [0.0, focal, (HEIGHT // binning - 1) / 2],
            [0.0, 0.0, 1.0],
        ]
    )


INTRINSICS = _intrinsics(1)  # of the sensor
LIGHT = {
    'lightDirection': [1.0, 1.5, 3.0],
    'lightAmbientCoeff': 0.55,
    'lightDiffuseCoeff': 0.5,
    'lightSpecularCoeff': 0.05,
    'shadow': 0,
}
IMAGE_PERIODS = 2  # control periods that an image takes
BASELINE = 0.075  # m, between projector and sensor: gives the steps in which depth comes
EDGE = 0.03  # m: a jump of depth between neighbours from which the edge is lost, mostly
LOST_EDGE = 0.7  # share of the sensor's pixels beside a jump that are lost
DIMMED = 0.6  # brightness below which depth suffers, too
LOST_IN_THE_DARK = 0.04  # share of the depth that is lost without any light but the camera's own


def size_of(world: World) -> Tuple[int, int]:
    """Width and height of the head camera's images, pixels."""
    return WIDTH // world.binning, HEIGHT // world.binning


def intrinsics_of(world: World) -> np.ndarray:
    """(3, 3), of the head camera's images."""
    return _intrinsics(world.binning)


def camera_pose(world: World) -> np.ndarray:
    """4x4, the world from the head camera, in truth."""
    x, y, z, roll, pitch, yaw = world.scene.robot.camera_error
    return world.link_pose(CAMERA_FRAME) @ from_rpy((x, y, z), roll, pitch, yaw)


def believed_camera(world: World) -> np.ndarray:
    """4x4, base_footprint from the head camera, by the encoders and the URDF."""
    return neck().forward(np.array([world.robot.position(name) for name in NECK]))


class RenderedView:
    """The view of a camera without noise.

    It has `colour` (h, w, 3) uint8 RGB, `depth` (h, w) m, and `bodies` (h, w) by their numbers.
    """

    def __init__(
        self,
        world: World,
        world_from_camera: np.ndarray,
        size: Tuple[int, int] = (WIDTH, HEIGHT),
        field_of_view: float = FIELD_OF_VIEW,
        far: float = FAR,
        **light: object,
    ) -> None:
        """Render the world.

        :param world_from_camera: 4x4, m, z forward, x right, y down.
        :param size: width and height, pixels.
        :param field_of_view: degrees, from top to bottom.
        :param far: m, how far it sees.
        :param light: options of pybullet.getCameraImage that override LIGHT.
        """
        width, height = size
        eye, forward, up = (
            world_from_camera[:3, 3],
            world_from_camera[:3, 2],
            -world_from_camera[:3, 1],
        )
        matrix = pybullet.computeViewMatrix(eye.tolist(), (eye + forward).tolist(), up.tolist())
        projection = _projection(size, field_of_view, far)
        image = pybullet.getCameraImage(
            width,
            height,
            matrix,
            projection,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=world.client,
            **dict(LIGHT, **light),
        )
        self.colour = np.asarray(image[2], np.uint8).reshape(height, width, 4)[..., :3].copy()
        buffer = np.asarray(image[3], float).reshape(height, width)
        # m along the axis. `far` where there is nothing
        self.depth = far * NEAR / (far - (far - NEAR) * buffer)
        # numbers in the client, -1 for none
        self.bodies = np.asarray(image[4], int).reshape(height, width)


def _projection(size: Tuple[int, int], field_of_view: float, far: float) -> List[float]:
    """The projection whose axis goes through the middle between the pixels' centres.

    The renderer takes corners for centres.
    """
    width, height = size
    pixel = NEAR * 2 * math.tan(math.radians(field_of_view) / 2) / height
    matrix: List[float] = pybullet.computeProjectionMatrix(
        pixel * (1 - width) / 2,
        pixel * (width + 1) / 2,
        pixel * (1 - height) / 2,
        pixel * (height + 1) / 2,
        NEAR,
        far,
    )
    return matrix


def see(world: World) -> CameraImage:
    """An image of the head camera. The world goes on for the time that it takes."""
    world.step(IMAGE_PERIODS)
    return take_image(world)


def take_image(world: World, counted: bool = True) -> CameraImage:
    """An image of what the head camera sees just now.

    :param counted: False: sets off nothing.
    """
    lights = world.disturbances.lights
    quality = lights.quality(world.scene.camera, world.periods)
    pose = camera_pose(world)
    rendered = RenderedView(world, pose, size_of(world))
    dazzled = lights.dazzled(world.periods, pose, intrinsics_of(world), size_of(world))
    world.labels = rendered.bodies
    generator = np.random.default_rng([world.scene.seed, 102, world.periods])
    image = CameraImage(
        world.time,
        noisy_colour(rendered.colour, quality, generator, dazzled),
        noisy_depth(rendered.depth, quality, generator, world.binning, dazzled),
        intrinsics_of(world),
        believed_camera(world),
    )
    if counted:
        world.happened('see')
    return image


def noisy_colour(
    colour: np.ndarray,
    quality: CameraQuality,
    generator: np.random.Generator,
    dazzled: Optional[np.ndarray] = None,
) -> np.ndarray:
    """(h, w, 3) uint8, as dark as the light is and with noise in every channel.

    :param dazzled: (h, w), the share of each pixel that is lost to glare: white where it is 1.
    """
    noise = generator.standard_normal(colour.shape, np.float32) * np.float32(quality.colour_noise)
    seen = colour * np.float32(quality.brightness) + noise
    if dazzled is not None:
        seen += (255 - seen) * dazzled[..., None]
    return np.clip(seen, 0, 255).astype(np.uint8)


def noisy_depth(
    depth: np.ndarray,
    quality: CameraQuality,
    generator: np.random.Generator,
    binning: int = 1,
    dazzled: Optional[np.ndarray] = None,
) -> np.ndarray:
    """(h, w) float32 m, with a Kinect's noise, steps, lost edges and lost pixels.

    NaN beyond FAR. The camera brings its own light: in the dark it sees a little less, and no
    worse. Of an edge as much is lost, in m, whatever the size of the pixels.

    :param dazzled: (h, w), the chance of each pixel to be lost to glare.
    """
    known = np.asarray(depth, np.float32)
    dark = max(0.0, 1.0 - quality.brightness / DIMMED)
    spread = quality.noise * (0.0012 + 0.0019 * (known - 0.4) ** 2)
    found = known + spread * generator.standard_normal(depth.shape, np.float32)
    steps = BASELINE * FOCAL * 8
    found = steps / np.round(steps / np.maximum(found, NEAR))
    chance = generator.random(depth.shape, np.float32)
    jumps = ndimage.maximum_filter(known, 3) - ndimage.minimum_filter(known, 3) > EDGE
    at_edge = jumps & (chance < LOST_EDGE / binning)
    missing = np.full(depth.shape, quality.dropout + LOST_IN_THE_DARK * dark**2)
    if dazzled is not None:
        missing += dazzled
    lost = at_edge | (chance > 1.0 - np.minimum(1.0, missing))
    found[lost | (known > 0.999 * FAR)] = np.nan
    return found.astype(np.float32)
