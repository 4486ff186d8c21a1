"""Whether a thing that was seen before is gone: the camera sees past where it stood."""

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import pixels_of

HEIGHTS = (0.35, 0.5, 0.65, 0.8)  # of the thing's own
ASIDE = (-0.2, 0.0, 0.2)  # of its narrower side, across the line of sight
LEAST = 6  # of these points must be in the image, with a depth
MOST = 0.7  # share of them that the camera sees past, where the thing is gone
BEYOND = 0.005  # m


def sees_past(image: CameraImage, box: UprightBox) -> bool:
    """Whether an image shows that a thing is no longer where it was.

    The points that are looked at lie inside of it, so the camera can see none of them while it
    stands there. False also where too little of the place is in the image, or hidden.

    :param box: where it stood, in the frame of the base.
    """
    across = np.cross(box.centre - image.base_from_camera[:3, 3], (0.0, 0.0, 1.0))
    across /= max(float(np.linalg.norm(across)), 1e-9)
    points = np.array(
        [
            box.centre + [0.0, 0.0, (height - 0.5) * box.size[2]] + aside * box.narrow * across
            for height in HEIGHTS
            for aside in ASIDE
        ]
    )
    pixels = pixels_of(points, image.intrinsics, image.base_from_camera)
    columns, rows = np.round(pixels[:, :2]).astype(int).T
    height, width = image.depth.shape
    inside = (pixels[:, 2] > 0) & (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    depth = image.depth[rows[inside], columns[inside]]
    measured = np.isfinite(depth) & (depth > 0)
    if measured.sum() < LEAST:
        return False
    past = depth[measured] > pixels[inside, 2][measured] + BEYOND
    return bool(past.mean() > MOST)
