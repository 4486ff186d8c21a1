"""The camera's view: walls, panels, people, sunlight, and the blur of the robot's own motion."""

import math
from typing import Mapping, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np

from ..rays import Circle, to_circle, to_walls
from ..site import CAMERA_HEIGHT, PANEL_SIDE, PANELS, WALLS, GaugePanel, Pose
from .base import Twist
from .people import BODY_HEIGHT

WIDTH, HEIGHT = 400, 300  # px
FOCAL = 346.0  # px: 60 degrees across
WALL_HEIGHT = 2.6  # m
EXPOSURE_S = 0.06
NOISE = 3.0  # sigma of a pixel's value
PANEL_DEPTH = 0.03  # m that a panel stands off its wall
GLARE_WIDTH = math.radians(20)  # beyond that angle the sunlight misses the camera (sigma)
_COLUMNS = np.arctan2(0.5 * WIDTH - (np.arange(WIDTH) + 0.5), FOCAL)  # rad, to the left
_ROWS = np.arange(HEIGHT)[:, None] + 0.5 - 0.5 * HEIGHT  # px below the middle
STEAM_HEIGHT = 2.2  # m
SEES_INTO_STEAM = 0.25  # m, from where a share of 1/e of the light still comes
_WHITE_STEAM = (222.0, 224.0, 226.0)
_LEGS, _SHIRT, _SKIN = (52, 58, 78), (196, 116, 48), (205, 160, 130)


class Sunlight(NamedTuple):
    """Light that a panel throws back."""

    panel: int
    angle: float  # rad between the panel's normal and the direction in which the light goes


def intrinsics() -> np.ndarray:
    """(3, 3): the camera matrix."""
    return np.array([[FOCAL, 0.0, 0.5 * WIDTH], [0.0, FOCAL, 0.5 * HEIGHT], [0.0, 0.0, 1.0]])


def view(
    pose: Pose,
    twist: Twist,
    fronts: Mapping[int, np.ndarray],
    people: Sequence[Circle],
    light: Optional[Sunlight],
    rng: np.random.Generator,
    steam: Optional[Circle] = None,
) -> np.ndarray:
    """(HEIGHT, WIDTH, 3) uint8 RGB.

    :param pose: of the camera, which looks forward, level.
    :param fronts: what is painted on each panel, by its number.
    :param steam: outline of a plume, seen from above.
    """
    angles = _COLUMNS + pose[2]
    walls = to_walls(pose, angles, WALLS) * np.cos(_COLUMNS)  # m along the optical axis
    image = _hall(walls)
    for panel in PANELS:
        _hang(image, pose, panel, fronts[panel.number], walls)
    for person in sorted(people, key=lambda each: -_distance(pose, each)):
        _stand(image, to_circle(pose, angles, person) * np.cos(_COLUMNS), walls)
    bright: np.ndarray = image.astype(np.float32)
    if steam is not None:
        bright = _misted(bright, pose, angles, steam, walls)
    if light is not None:
        bright += _glare(pose, light)
    bright = _blurred(bright, twist, float(walls[WIDTH // 2]))
    noisy = rng.normal(0.0, NOISE, bright.shape)
    noisy += bright
    return np.clip(noisy, 0, 255, out=noisy).astype(np.uint8)


def _distance(pose: Pose, place: Sequence[float]) -> float:
    return math.hypot(place[0] - pose[0], place[1] - pose[1])


def _hall(walls: np.ndarray) -> np.ndarray:
    """Floor, walls and ceiling. Walls are darker far away, and at every joint of their slabs."""
    image = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    image[:] = (118, 112, 104)
    image[: HEIGHT // 2] = (206, 208, 212)
    shade = (176 - 7 * np.minimum(walls, 9.0))[None, :, None] * np.array([1.0, 1.0, 0.96])
    below, above = FOCAL * CAMERA_HEIGHT / walls, FOCAL * (WALL_HEIGHT - CAMERA_HEIGHT) / walls
    on_wall = (_ROWS < below) & (_ROWS > -above)
    return np.where(on_wall[..., None], shade.astype(np.uint8), image)


def _in_camera(pose: Pose, x: float, y: float) -> Tuple[float, float]:
    """Metres along the optical axis, and to the right of it."""
    ahead, left = x - pose[0], y - pose[1]
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    return ahead * cosine + left * sine, ahead * sine - left * cosine


def _hang(
    image: np.ndarray, pose: Pose, panel: GaugePanel, front: np.ndarray, walls: np.ndarray
) -> None:
    """Paint a panel where the camera looks at its front, and no wall is before it."""
    x = panel.x + PANEL_DEPTH * math.cos(panel.facing)
    y = panel.y + PANEL_DEPTH * math.sin(panel.facing)
    aside = (-0.5 * PANEL_SIDE * math.sin(panel.facing), 0.5 * PANEL_SIDE * math.cos(panel.facing))
    # its left end, as one sees it who looks at it, is on the panel's own right
    left = _in_camera(pose, x - aside[0], y - aside[1])
    right = _in_camera(pose, x + aside[0], y + aside[1])
    toward = (pose[0] - x) * math.cos(panel.facing) + (pose[1] - y) * math.sin(panel.facing)
    if min(left[0], right[0]) < 0.15 or toward <= 0:
        return
    half = 0.5 * PANEL_SIDE
    corners = np.array(
        [
            (0.5 * WIDTH + FOCAL * end[1] / end[0], 0.5 * HEIGHT + FOCAL * up / end[0])
            for end, up in ((left, -half), (right, -half), (right, half), (left, half))
        ],
        np.float32,
    )
    before_walls = walls > min(left[0], right[0]) - 0.3
    size, side = (WIDTH, HEIGHT), front.shape[0]
    texel = 1 + float(np.ptp(corners, axis=0).max()) / side  # it reaches beyond its corner
    if (corners.max(0) < -texel).any() or (corners.min(0) > np.add(size, texel)).any():
        return  # beside the image
    if not before_walls.any():
        return
    texture = np.array([(0, 0), (side, 0), (side, side), (0, side)], np.float32)
    # where the panel is small, its picture is averaged first, or lines would break into dots
    shrink = max(1.0, side / max(4.0, float(np.ptp(corners[:, 1]))))
    soft = cv2.GaussianBlur(front, (0, 0), 0.4 * shrink) if shrink > 1.2 else front
    warp = cv2.getPerspectiveTransform(texture, corners)
    seen = cv2.warpPerspective(soft, warp, size, flags=cv2.INTER_LINEAR)
    whole = cv2.warpPerspective(np.full((side, side), 255, np.uint8), warp, size)
    there = np.greater(whole, 127) & before_walls[None, :]
    image[there] = seen[there]


def _stand(image: np.ndarray, near: np.ndarray, walls: np.ndarray) -> None:
    """Paint a person. `near`: m along the optical axis in each column, inf beside them."""
    seen = near < walls
    safe = np.where(seen, np.maximum(near, 0.1), 1.0)
    for low, high, colour in ((0.0, 0.85, _LEGS), (0.85, 1.45, _SHIRT), (1.45, BODY_HEIGHT, _SKIN)):
        below, above = (FOCAL * (CAMERA_HEIGHT - height) / safe for height in (low, high))
        image[seen & (_ROWS < below) & (_ROWS >= above)] = colour


def _misted(
    image: np.ndarray, pose: Pose, angles: np.ndarray, steam: Circle, walls: np.ndarray
) -> np.ndarray:
    """Return the image with a plume before it: the deeper one looks into it, the less is left."""
    along = (steam[0] - pose[0]) * np.cos(angles) + (steam[1] - pose[1]) * np.sin(angles)
    aside = (steam[0] - pose[0]) * np.sin(angles) - (steam[1] - pose[1]) * np.cos(angles)
    half = np.sqrt(np.maximum(0.0, steam[2] ** 2 - aside**2))
    near = np.maximum(along - half, 0.0)
    deep = np.maximum(0.0, np.minimum(along + half, walls / np.cos(_COLUMNS)) - near)
    top = FOCAL * (CAMERA_HEIGHT - STEAM_HEIGHT) / np.maximum(near * np.cos(_COLUMNS), 0.1)
    share = np.where(_ROWS >= top, -np.expm1(-deep / SEES_INTO_STEAM), 0.0)[..., None]
    return np.asarray(image + share * (np.array(_WHITE_STEAM) - image), np.float32)


def _glare(pose: Pose, light: Sunlight) -> np.ndarray:
    """Return the light that is added to the image: a blot on the panel, and a veil around it."""
    panel = next(each for each in PANELS if each.number == light.panel)
    ahead, right = _in_camera(pose, panel.x, panel.y)
    if ahead < 0.15:
        return np.zeros((1, 1, 1), np.float32)
    seen_from = math.atan2(pose[1] - panel.y, pose[0] - panel.x) - panel.facing
    off = math.remainder(seen_from - light.angle, 2 * math.pi) / GLARE_WIDTH
    strength = 420.0 * math.exp(-0.5 * off * off)
    across = np.arange(WIDTH)[None, :] + 0.5 - 0.5 * WIDTH - FOCAL * right / ahead
    spread = 0.45 * FOCAL * PANEL_SIDE / ahead
    blot = np.exp(-0.5 * (across**2 + _ROWS**2) / spread**2)
    return (strength * (blot + 0.08))[..., None].astype(np.float32)


def _blurred(image: np.ndarray, twist: Twist, distance: float) -> np.ndarray:
    """Drawn out along the rows by the turning, and a little by the driving."""
    turned = FOCAL * abs(twist.w) * EXPOSURE_S
    driven = 0.25 * WIDTH * abs(twist.v) * EXPOSURE_S / max(distance, 0.5)
    length = int(round(turned + driven))
    return image if length < 2 else np.asarray(cv2.blur(image, (length, 1)))
