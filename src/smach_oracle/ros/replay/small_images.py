"""Makes small JPEGs of camera images. Broken and giant ones are refused before they take memory."""

import struct
from typing import Optional, Tuple, Union

import numpy as np
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from ..images import ImageError, colour_of

MOST_BYTES = 2**26  # of a message
MOST_PIXELS = 2**26
JPEG_QUALITY = 75
_PNG = b'\x89PNG\r\n\x1a\n'
_PNG_SIZE = struct.Struct('>II')  # width, height
_JPEG_SIZE = struct.Struct('>HH')  # height, width
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # the markers that bear a size
_WITHOUT_LENGTH = frozenset([0x01, *range(0xD0, 0xDA)])

CameraMessage = Union[Image, CompressedImage]


def small_jpeg(message: CameraMessage, width: int) -> CompressedImage:
    """Return a JPEG of at most `width` px across, with the header of the original.

    :raises ImageError: where the message is no image in colour or grey, broken or too large.
    """
    if len(message.data) > MOST_BYTES:
        raise ImageError(
            'the image has {} bytes; allowed: {}'.format(len(message.data), MOST_BYTES)
        )
    colour = _pixels(message) if isinstance(message, Image) else _decoded(bytes(message.data))
    import cv2  # takes a moment, and is wanted only where there are cameras

    height, original = colour.shape[:2]
    if original > width:
        colour = cv2.resize(
            colour, (width, max(1, round(height * width / original))), interpolation=cv2.INTER_AREA
        )
    return jpeg_of(colour, message.header, JPEG_QUALITY)


def jpeg_of(colour: np.ndarray, header: Header, quality: int) -> CompressedImage:
    """Return a JPEG of an image in colour: rows, columns, RGB of uint8.

    :param quality: 0 to 100.
    :raises ImageError: where it cannot be encoded.
    """
    import cv2

    done, data = cv2.imencode(
        '.jpg', np.ascontiguousarray(colour[:, :, ::-1]), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    if not done:
        raise ImageError('the image cannot be encoded')
    return CompressedImage(header, 'jpeg', bytes(data))


def compressed_size(data: bytes) -> Optional[Tuple[int, int]]:
    """Return width and height in px, as the header of a PNG or JPEG says. None for all else."""
    if data.startswith(_PNG) and len(data) >= 24:
        width, height = _PNG_SIZE.unpack_from(data, 16)
        return width, height
    if not data.startswith(b'\xff\xd8'):
        return None
    place = 2
    while place + 9 <= len(data) and data[place] == 0xFF:
        marker = data[place + 1]
        if marker in _JPEG_FRAMES:
            height, width = _JPEG_SIZE.unpack_from(data, place + 5)
            return width, height
        if marker == 0xFF:
            place += 1  # padding
        elif marker in _WITHOUT_LENGTH:
            place += 2
        else:
            place += 2 + int.from_bytes(data[place + 2 : place + 4], 'big')
    return None


def _pixels(image: Image) -> np.ndarray:
    if image.width * image.height > MOST_PIXELS:
        raise _too_large(image.width, image.height)
    return colour_of(image)


def _decoded(data: bytes) -> np.ndarray:
    size = compressed_size(data)
    if size is None:
        raise ImageError('the compressed image cannot be read: it is neither JPEG nor PNG')
    if size[0] * size[1] > MOST_PIXELS:
        raise _too_large(*size)
    import cv2

    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error as err:
        raise ImageError('the compressed image cannot be read: {}'.format(str(err)[:200])) from err
    if image is None:
        raise ImageError('the compressed image cannot be read: it is broken')
    return image[:, :, ::-1]


def _too_large(width: int, height: int) -> ImageError:
    return ImageError(
        'the image has {} x {} pixels; allowed: {}'.format(width, height, MOST_PIXELS)
    )
