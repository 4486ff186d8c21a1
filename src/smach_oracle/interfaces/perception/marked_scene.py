"""The surface that a marked object stands on, and the other things there."""

from typing import List, NamedTuple, Tuple, cast

import numpy as np
from scipy import ndimage

from smach_oracle.geometry.box import UprightBox, upright_box
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.depth import points_of
from smach_oracle.geometry.pieces import largest_patch, standing_on

from .segmentation import SegmentedObject

COLUMNS = 320  # that are looked at
OFF_SURFACE = 0.012  # m that a point of the surface may seem to lie off it
LOWEST = 0.02  # m above the surface: lower things are noise
HIGHEST = 0.8
LARGEST = 0.35  # m: what is wider or higher is no object
REACH = 2.5  # m of depth
GROWN = 3  # px around the mask that belong to nothing
MARGIN = 0.01  # m from the surface's edge


class MarkedSceneError(Exception):
    """The surface cannot be made out. The text says why."""


class MarkedScene(NamedTuple):
    """The marked object and what surrounds it, in the frame of the base."""

    surface: UprightBox  # what is seen of it. Its height is 0
    others: List[UprightBox]  # other things on it, nearest to the base first


def scene_of(image: CameraImage, segmented: SegmentedObject) -> MarkedScene:
    """Return the scene around an object.

    :raises MarkedSceneError: where the surface below it is not seen.
    """
    plane = segmented.surface
    if plane is None:
        raise MarkedSceneError('what the object stands on cannot be made out around it')
    stride = image.stride(COLUMNS)
    depth = image.depth[::stride, ::stride].copy()
    depth[
        ndimage.binary_dilation(segmented.mask, iterations=GROWN)[::stride, ::stride]
        | (depth > REACH)
    ] = np.nan
    points = points_of(depth, image.intrinsics, image.base_from_camera, stride=stride).reshape(
        -1, 3
    )
    points = points[np.isfinite(points[:, 2])]
    patch = largest_patch(points[np.abs(plane.height(points)) < OFF_SURFACE])
    if len(patch) < 3:
        raise MarkedSceneError('too little is seen of what the object stands on')
    others = []
    for chosen in standing_on(points, plane, patch, LOWEST, HIGHEST, MARGIN):
        own = points[chosen]
        box = upright_box(own, plane.z_at(*own[:, :2].mean(axis=0)))
        if max(box.wide, float(box.size[2])) <= LARGEST:
            others.append(box)
    others.sort(key=lambda box: float(np.hypot(*box.centre[:2])))
    top = upright_box(patch, float(patch[:, 2].min()))
    # elements, which numpy's types may take for arrays
    x, y = cast('Tuple[float, float]', top.centre[:2])
    centre = np.array([x, y, plane.z_at(x, y)])
    return MarkedScene(UprightBox(centre, top.size * [1, 1, 0], top.yaw), others)
