"""A camera that sees boxes and upright cylinders, a ray per pixel: exact depth, colour, and whose
pixel it is.
"""

import functools
from typing import NamedTuple, Sequence

import numpy as np

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import pixels_of
from smach_oracle.geometry.transforms import apply, from_rpy, transform
from smach_oracle.simulation.scenes.scene import Body

WIDTH, HEIGHT = 640, 480
FOCAL = HEIGHT / 2 / np.tan(np.radians(45) / 2)
INTRINSICS = np.array([[FOCAL, 0, (WIDTH - 1) / 2], [0, FOCAL, (HEIGHT - 1) / 2], [0, 0, 1]])
LIGHT = np.array([-0.4, 0.3, 0.85])


class Seen(NamedTuple):
    """An image and, for each pixel, the index of the body that it shows; -1 for none."""

    image: CameraImage
    bodies: np.ndarray


def camera_at(eye: Sequence[float], target: Sequence[float]) -> np.ndarray:
    """4x4 of a camera that looks from one point at another, upright."""
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return transform(eye, np.column_stack([right, np.cross(forward, right), forward]))


def see(
    bodies: Sequence[Body],
    camera: np.ndarray,
    generator: np.random.Generator,
    noise: float = 1.0,
    colour_noise: float = 6.0,
) -> Seen:
    """What a Kinect-like camera sees: `noise` scales that of depth, 0 is a perfect one."""
    depth, whose = np.full((HEIGHT, WIDTH), np.inf), np.full((HEIGHT, WIDTH), -1)
    colour = np.full((HEIGHT, WIDTH, 3), 0.75)
    for index, body in enumerate(bodies):
        part, found, shade = _shown(body, camera.tobytes())
        nearer = found < depth[part]
        depth[part][nearer], whose[part][nearer] = found[nearer], index
        colour[part][nearer] = (np.array(body.colour) * shade[..., None])[nearer]
    image = 255 * colour + generator.normal(0, colour_noise, colour.shape)
    return Seen(
        CameraImage(
            1.0,
            np.clip(image, 0, 255).astype(np.uint8),
            _measured(depth, generator, noise),
            INTRINSICS,
            camera,
        ),
        whose,
    )


@functools.lru_cache(maxsize=32)  # floors and tables are in most images, and take longest
def _shown(body: Body, camera: bytes):
    """Where a body may be in the image, its distance there along each ray, and its shade."""
    pose = np.frombuffer(camera).reshape(4, 4)
    part = _part_of_image(body, pose)
    rows, columns = (each[part] for each in np.indices((HEIGHT, WIDTH)))
    rays = (
        np.stack(
            [
                (columns - INTRINSICS[0, 2]) / FOCAL,
                (rows - INTRINSICS[1, 2]) / FOCAL,
                np.ones(rows.shape),
            ],
            axis=-1,
        )
        @ pose[:3, :3].T
    )
    found, normal = _cast(body, pose[:3, 3], rays)
    return part, found, 0.55 + 0.45 * np.clip(normal @ LIGHT, 0, 1)


def _measured(depth: np.ndarray, generator: np.random.Generator, noise: float) -> np.ndarray:
    known = np.where(np.isfinite(depth), depth, np.nan)
    if noise == 0:
        return known.astype(np.float32)
    measured = known + generator.normal(0, 1, depth.shape) * noise * (
        0.0012 + 0.0019 * (known - 0.4) ** 2
    )
    measured[generator.random(depth.shape) < 0.005 * noise] = np.nan
    jump = np.abs(np.gradient(np.where(np.isfinite(depth), depth, 9.0))).max(axis=0) > 0.03
    measured[jump & (generator.random(depth.shape) < 0.7)] = np.nan
    steps = 0.075 * FOCAL * 8  # the disparity of a Kinect comes in eighths of a pixel
    return (steps / np.round(steps / measured)).astype(np.float32)


def _part_of_image(body: Body, camera: np.ndarray):
    """Rows and columns of which all that the body covers lies; the whole image where it reaches
    behind the camera.
    """
    size = np.array(body.size) * ([2, 2, 1] if body.shape == 'cylinder' else [1, 1, 1])
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    corners = apply(from_rpy(body.position, yaw=body.yaw), signs * size / 2)
    seen = pixels_of(corners, INTRINSICS, camera)
    if seen[:, 2].min() < 0.05:
        return slice(None), slice(None)
    low = np.clip(np.floor(seen[:, :2].min(axis=0)).astype(int), 0, (WIDTH, HEIGHT))
    high = np.clip(np.ceil(seen[:, :2].max(axis=0)).astype(int) + 1, 0, (WIDTH, HEIGHT))
    return slice(low[1], high[1]), slice(low[0], high[0])


def _cast(body: Body, eye: np.ndarray, rays: np.ndarray):
    """Distance along each ray (in units of the ray), inf where it misses, and the surface's normal
    there.
    """
    cos, sin = np.cos(body.yaw), np.sin(body.yaw)
    turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    start, along = turn @ (eye - body.position), rays @ turn.T
    along = np.where(np.abs(along) < 1e-9, 1e-9, along)
    distance, normal = (_box if body.shape == 'box' else _cylinder)(
        np.array(body.size), start, along
    )
    return distance, normal @ turn


def _box(size, start, along):
    one, other = (-size / 2 - start) / along, (size / 2 - start) / along
    entry, leave = np.minimum(one, other), np.maximum(one, other).min(axis=-1)
    distance = entry.max(axis=-1)
    normal = np.eye(3)[entry.argmax(axis=-1)] * -np.sign(along)
    return np.where((distance < leave) & (distance > 0), distance, np.inf), normal


def _cylinder(size, start, along):
    radius, half = size[0], size[2] / 2
    a = (along[..., :2] ** 2).sum(axis=-1)
    b = along[..., :2] @ start[:2]
    root = b * b - a * (start[:2] @ start[:2] - radius**2)
    with np.errstate(invalid='ignore'):
        side = (-b - np.sqrt(root)) / a
    side_z = start[2] + side * along[..., 2]
    side = np.where((root > 0) & (np.abs(side_z) <= half) & (side > 0), side, np.inf)
    top = (half - start[2]) / along[..., 2]
    top_point = start[:2] + top[..., None] * along[..., :2]
    top = np.where(
        (top > 0) & ((top_point**2).sum(axis=-1) <= radius**2) & (start[2] > half), top, np.inf
    )
    hit = start[:2] + np.where(np.isfinite(side), side, 0)[..., None] * along[..., :2]
    normal = np.concatenate([hit / radius, np.zeros(hit.shape[:2] + (1,))], axis=-1)
    return np.minimum(side, top), np.where((top < side)[..., None], [0.0, 0.0, 1.0], normal)
