"""Camera images as files for the browser: JPEG for colour, PNG with false colours for depth.

Messages only, no node. The images of a robot are decoded here and encoded again: none of their
bytes reaches a browser.
"""

import os
import struct
from typing import Any, Dict, List, NamedTuple, Union, cast

# before cv2 is there: small files of huge images
os.environ.setdefault('OPENCV_IO_MAX_IMAGE_PIXELS', str(2**26))

import numpy as np
from sensor_msgs.msg import CompressedImage, Image

from smach_oracle.packages import optional
from smach_oracle.ros.images import ImageError, colour_of, depth_of

cv2 = optional('cv2')  # without it the page has everything but pictures
NO_PICTURES = (
    'OpenCV is missing, so the console shows no pictures; install python3-opencv, or '
    'opencv-python-headless by pip, and start the console again'
)
WIDTHS = (160, 320, 640, 1280)  # px that a browser may ask for
USUAL_WIDTH = 640  # px
MOST_BYTES = 2**26  # of a message
MOST_PIXELS = 2**26
JPEG_QUALITY = 88
_DEPTHS = ('32FC1', '16UC1', 'mono16')
_BAYER = {
    'bayer_rggb8': 'COLOR_BayerBG2RGB',
    'bayer_bggr8': 'COLOR_BayerRG2RGB',
    'bayer_gbrg8': 'COLOR_BayerGR2RGB',
    'bayer_grbg8': 'COLOR_BayerGB2RGB',
}
_DEPTH_HEADER = struct.Struct('<iff')  # compressed_depth_image_transport: format, quantisation


class BrowserFile(NamedTuple):
    """A file for the browser."""

    content_type: str
    body: bytes
    facts: Dict[str, Any]  # plain data about it


def encode_image(message: Union[Image, CompressedImage], width: int) -> BrowserFile:
    """Return a file of at most `width` pixels across.

    Its facts: `size` of the original in px, `range` in m of a depth image.

    :raises ImageError: for what is no image, or too large a one, and where OpenCV is missing.
    """
    if cv2 is None:
        raise ImageError(NO_PICTURES)
    if len(message.data) > MOST_BYTES:
        raise ImageError(
            'the image has {} bytes; allowed: {}'.format(len(message.data), MOST_BYTES)
        )
    if not isinstance(message, Image):
        if 'compressedDepth' in message.format:
            return _depth_file(_unpacked_depth(message), width)
        return _colour_file(_decoded(bytes(message.data), cv2.IMREAD_COLOR)[:, :, ::-1], width)
    if message.height * message.width > MOST_PIXELS:
        raise ImageError(
            'the image has {} x {} pixels; allowed: {}'.format(
                message.width, message.height, MOST_PIXELS
            )
        )
    if message.encoding in _DEPTHS:
        return _depth_file(depth_of(message), width)
    if message.encoding in _BAYER:
        mosaic = colour_of(
            Image(
                height=message.height,
                width=message.width,
                step=message.step,
                data=message.data,
                encoding='mono8',
            )
        )[:, :, 0]
        return _colour_file(
            cv2.cvtColor(np.ascontiguousarray(mosaic), getattr(cv2, _BAYER[message.encoding])),
            width,
        )
    return _colour_file(colour_of(message), width)


def false_colours(depth: np.ndarray, near: float, far: float) -> np.ndarray:
    """(h, w, 3) RGB of (h, w) m: red is near, blue is far, dark grey where nothing was measured."""
    share = np.clip((depth - near) / max(far - near, 1e-3), 0.0, 1.0)
    level = np.nan_to_num(255 * (1.0 - 0.9 * share), nan=0.0).astype(np.uint8)
    colours = cv2.applyColorMap(level, cv2.COLORMAP_TURBO)[:, :, ::-1].copy()
    colours[~np.isfinite(depth)] = 40
    return colours


def _colour_file(colour: np.ndarray, width: int) -> BrowserFile:
    height, original = colour.shape[:2]
    return BrowserFile(
        'image/jpeg',
        _file(
            '.jpg',
            _narrowed(colour, width, cv2.INTER_AREA),
            [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY],
        ),
        {'kind': 'colour', 'size': [original, height]},
    )


def _depth_file(depth: np.ndarray, width: int) -> BrowserFile:
    height, original = depth.shape
    small = _narrowed(depth, width, cv2.INTER_NEAREST)
    measured = small[np.isfinite(small)]
    near, far = 0.0, 0.0
    if measured.size:
        # an array, which numpy's types may take for one number
        near, far = (float(each) for each in cast('np.ndarray', np.percentile(measured, (2, 98))))
    return BrowserFile(
        'image/png',
        _file('.png', false_colours(small, near, far), [cv2.IMWRITE_PNG_COMPRESSION, 1]),
        {'kind': 'depth', 'size': [original, height], 'range': [round(near, 3), round(far, 3)]},
    )


def _narrowed(image: np.ndarray, width: int, how: int) -> np.ndarray:
    height, original = image.shape[:2]
    if original <= width:
        return image
    return cv2.resize(image, (width, max(1, round(height * width / original))), interpolation=how)


def _file(suffix: str, colour: np.ndarray, settings: List[int]) -> bytes:
    done, data = cv2.imencode(suffix, np.ascontiguousarray(colour[:, :, ::-1]), settings)
    if not done:
        raise ImageError('the image cannot be encoded')
    return bytes(data)


def _decoded(data: bytes, how: int) -> np.ndarray:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), how) if data else None
    except cv2.error as err:
        raise ImageError('the compressed image cannot be read: {}'.format(str(err)[:200])) from err
    if image is None:
        raise ImageError('the compressed image cannot be read: it is neither JPEG nor PNG')
    return image


def _unpacked_depth(message: CompressedImage) -> np.ndarray:
    """(h, w) float32 m of a message of compressed_depth_image_transport."""
    data = bytes(message.data)
    if len(data) <= _DEPTH_HEADER.size:
        raise ImageError('the compressed depth image has {} bytes'.format(len(data)))
    _, factor, offset = _DEPTH_HEADER.unpack_from(data)
    stored = _decoded(data[_DEPTH_HEADER.size :], cv2.IMREAD_UNCHANGED)
    if stored.ndim != 2 or stored.dtype != np.uint16:
        raise ImageError('the compressed depth image holds no 16 bit depth')
    depth: np.ndarray = stored.astype(np.float32)
    with np.errstate(divide='ignore', invalid='ignore'):
        depth = (
            factor / (depth - offset)
            if message.format.startswith('32FC1')
            else depth * np.float32(0.001)
        )
    depth[(stored == 0) | ~np.isfinite(depth) | (depth <= 0)] = np.nan
    return depth
