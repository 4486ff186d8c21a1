"""A small image of a can on a table, as a camera gives it."""

import functools
from typing import Any, NamedTuple

import numpy as np
from pr2_world import TABLE
from ray_camera import camera_at, see

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.simulation.scenes.scene import Body

CAMERA = camera_at((0.05, 0.03, 1.38), (0.75, 0.0, 0.75))
CAN = Body('can', 'cylinder', (0.03, 0.03, 0.12), (0.75, 0.0, 0.78), colour=(0.1, 0.3, 0.8))
COARSER = 3  # of the rows and columns of the camera one is kept


class SmallImage(NamedTuple):
    """The image, and where it shows the can."""

    image: CameraImage
    region: Any  # left, top, width, height, px


@functools.lru_cache(maxsize=None)
def small_image() -> SmallImage:
    """Made once."""
    seen = see([TABLE, CAN], CAMERA, np.random.default_rng(1))
    whole = CameraImage(*seen.image)
    kept = slice(None, None, COARSER)
    scale = np.array([[1 / COARSER], [1 / COARSER], [1.0]])
    rows, columns = np.nonzero(seen.bodies[kept, kept] == 1)
    return SmallImage(
        CameraImage(
            whole.stamp,
            np.ascontiguousarray(whole.colour[kept, kept]),
            np.ascontiguousarray(whole.depth[kept, kept]),
            whole.intrinsics * scale,
            whole.base_from_camera,
        ),
        tuple(
            int(each)
            for each in (columns.min() - 3, rows.min() - 3, np.ptp(columns) + 7, np.ptp(rows) + 7)
        ),
    )
