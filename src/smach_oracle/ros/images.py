"""Images and point clouds between ROS messages and arrays. Needs the message packages, no node."""

from typing import Optional, Tuple

import numpy as np
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header

_COLOURS = {
    'rgb8': (3, (0, 1, 2)),
    'bgr8': (3, (2, 1, 0)),
    'rgba8': (4, (0, 1, 2)),
    'bgra8': (4, (2, 1, 0)),
    'mono8': (1, (0, 0, 0)),
    '8UC1': (1, (0, 0, 0)),
    '8UC3': (3, (2, 1, 0)),
}
_DEPTHS = {'32FC1': ('f4', 1.0), '16UC1': ('u2', 0.001), 'mono16': ('u2', 0.001)}


class ImageError(ValueError):
    """A message that is not the image it should be.

    The text names what it is and what is allowed.
    """


def colour_of(image: Image) -> np.ndarray:
    """Return (h, w, 3) uint8 RGB of a colour or grey image.

    :raises ImageError: where the message is not such an image.
    """
    channels, order = _known(image, _COLOURS)
    return np.ascontiguousarray(_pixels(image, 'u1', channels)[:, :, list(order)])


def depth_of(image: Image) -> np.ndarray:
    """Return (h, w) float32 in m, NaN where nothing was measured.

    REP 118 allows float metres or integer millimetres.

    :raises ImageError: where the message is not such an image.
    """
    kind, unit = _known(image, _DEPTHS)
    depth = _pixels(image, kind, 1)[:, :, 0].astype(np.float32) * np.float32(unit)
    depth[~np.isfinite(depth) | (depth <= 0)] = np.nan
    return depth


def intrinsics_of(info: CameraInfo) -> np.ndarray:
    """Return the (3, 3) camera matrix of a rectified image.

    :raises ImageError: where the camera is not calibrated.
    """
    matrix = np.array(info.P, float).reshape(3, 4)[:, :3]
    if not matrix[0, 0] > 0:
        matrix = np.array(info.K, float).reshape(3, 3)
    if not (np.isfinite(matrix).all() and matrix[0, 0] > 0 and matrix[1, 1] > 0):
        raise ImageError(
            'camera info of {}: focal lengths must be greater than 0; is it calibrated?'.format(
                info.header.frame_id or '(no frame)'
            )
        )
    return matrix


def colour_image(colour: np.ndarray, header: Header) -> Image:
    """Make an rgb8 message of (h, w, 3) uint8."""
    return _image(np.ascontiguousarray(colour, np.uint8), 'rgb8', header)


def depth_image(depth: np.ndarray, header: Header) -> Image:
    """Make a 32FC1 message of (h, w) in m."""
    return _image(np.ascontiguousarray(depth, '<f4'), '32FC1', header)


def mask_image(mask: np.ndarray, header: Header) -> Image:
    """Make a mono8 message of (h, w) bool: 255 and 0."""
    return _image(np.where(mask, 255, 0).astype(np.uint8), 'mono8', header)


def cloud_message(
    points: np.ndarray, header: Header, colours: Optional[np.ndarray] = None
) -> PointCloud2:
    """Make a cloud of points (n, 3) in m, or organised (h, w, 3).

    :param colours: uint8 of the same shape. They become `rgb`.
    """
    fields = [(name, '<f4') for name in 'xyz'] + ([('rgb', '<u4')] if colours is not None else [])
    shape = points.shape[:-1]
    packed = np.zeros(shape, fields)
    for index, name in enumerate('xyz'):
        packed[name] = points[..., index]
    if colours is not None:
        wide: np.ndarray = colours.astype(np.uint32)
        red, green, blue = (wide[..., index] for index in range(3))
        packed['rgb'] = red << 16 | green << 8 | blue
    height, width = (1, shape[0]) if len(shape) == 1 else shape
    return PointCloud2(
        header=header,
        height=height,
        width=width,
        is_bigendian=False,
        point_step=packed.itemsize,
        row_step=packed.itemsize * width,
        data=packed.tobytes(),
        is_dense=bool(np.isfinite(points).all()),
        fields=[
            PointField(name, 4 * index, PointField.FLOAT32, 1)  # rgb, too: so RViz and PCL have it
            for index, (name, _) in enumerate(fields)
        ],
    )


def _known(image: Image, table: dict) -> Tuple:
    if image.encoding not in table:
        raise ImageError(
            'image has encoding {!r}; allowed: {}'.format(image.encoding, ', '.join(sorted(table)))
        )
    return table[image.encoding]


def _pixels(image: Image, kind: str, channels: int) -> np.ndarray:
    """(h, w, channels), rows without their padding."""
    pixel: np.dtype = np.dtype(kind).newbyteorder('>' if image.is_bigendian else '<')
    row = image.width * channels * pixel.itemsize
    if (
        not image.width
        or not image.height
        or image.step < row
        or len(image.data) < image.step * image.height
    ):
        raise ImageError(
            'image of {} x {} {} has {} bytes in rows of {}; it needs {} in rows of {} '
            'or more'.format(
                image.width,
                image.height,
                image.encoding,
                len(image.data),
                image.step,
                row * image.height,
                row,
            )
        )
    rows = np.frombuffer(image.data, np.uint8, image.step * image.height).reshape(
        image.height, image.step
    )[:, :row]
    return np.ascontiguousarray(rows).view(pixel).reshape(image.height, image.width, channels)


def _image(array: np.ndarray, encoding: str, header: Header) -> Image:
    return Image(
        header=header,
        height=array.shape[0],
        width=array.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=array.strides[0],
        data=array.tobytes(),
    )
