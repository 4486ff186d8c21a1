"""Images are made small, and hostile ones are refused before they take memory."""

import struct
import tracemalloc
import zlib

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from smach_oracle.ros.images import ImageError, colour_image
from smach_oracle.ros.replay.small_images import MOST_BYTES, compressed_size, small_jpeg

SHADES = np.add.outer(np.arange(480), np.arange(640)).astype(np.uint8)
PICTURE = np.stack([SHADES, 255 - SHADES, SHADES // 2], 2)


def encoded(suffix, colour=PICTURE, *options):
    return bytes(cv2.imencode(suffix, colour[:, :, ::-1], list(options))[1])


def png_bomb(width, height):
    """A few bytes that claim to be a huge picture."""

    def chunk(name, data):
        return (
            struct.pack('>I', len(data)) + name + data + struct.pack('>I', zlib.crc32(name + data))
        )

    head = struct.pack('>IIBBBBB', width, height, 8, 2, 0, 0, 0)
    data = zlib.compress(bytes(100000))
    return b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', head) + chunk(b'IDAT', data) + chunk(b'IEND', b'')


def jpeg_bomb():
    """A JPEG that claims to be 65,500 px wide and high."""
    data = encoded('.jpg')
    place = data.index(b'\xff\xc0')
    return data[: place + 5] + struct.pack('>HH', 65500, 65500) + data[place + 9 :]


@pytest.mark.parametrize(
    'message',
    [
        colour_image(PICTURE, Header(frame_id='eye')),
        CompressedImage(Header(frame_id='eye'), 'jpeg', encoded('.jpg')),
        CompressedImage(Header(frame_id='eye'), 'png', encoded('.png')),
        CompressedImage(
            Header(frame_id='eye'),
            'jpeg',
            encoded('.jpg', PICTURE, cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
        ),
    ],
    ids=['image', 'jpeg', 'png', 'progressive'],
)
def test_an_image_is_scaled_down_and_keeps_its_header_and_colours(message):
    small = small_jpeg(message, 320)
    assert (small.header.frame_id, small.format) == ('eye', 'jpeg')
    shown = cv2.imdecode(np.frombuffer(small.data, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    assert shown.shape == (240, 320, 3)
    wanted = cv2.resize(PICTURE, (320, 240), interpolation=cv2.INTER_AREA)
    assert np.median(np.abs(shown.astype(int) - wanted)) < 8


def test_a_small_image_is_not_made_larger():
    small = small_jpeg(colour_image(PICTURE[:20, :30], Header()), 320)
    assert compressed_size(small.data) == (30, 20)


@pytest.mark.parametrize(
    'message, why',
    [
        (Image(encoding='32FC1', width=4, height=4, step=16, data=bytes(64)), "encoding '32FC1'"),
        (Image(encoding='rgb8', width=4, height=4, step=12, data=bytes(47)), '47 bytes'),
        (Image(encoding='rgb8', width=0, height=4, step=0, data=b''), 'image of 0 x 4'),
        (Image(encoding='mono8', width=2**31, height=2, step=2**31), 'pixels; allowed'),
        (CompressedImage(data=b''), 'neither JPEG nor PNG'),
        (CompressedImage(data=b'\xff\xd8\xff'), 'neither JPEG nor PNG'),
        (CompressedImage(data=b'GIF89a' + bytes(100)), 'neither JPEG nor PNG'),
        (CompressedImage(data=encoded('.png')[:60]), 'it is broken'),
        (CompressedImage(data=bytes(MOST_BYTES + 1)), 'bytes; allowed'),
        (CompressedImage(data=png_bomb(60000, 60000)), '60000 x 60000 pixels; allowed'),
        (CompressedImage(data=jpeg_bomb()), '65500 x 65500 pixels; allowed'),
    ],
)
def test_a_hostile_image_is_refused_in_words(message, why):
    with pytest.raises(ImageError) as caught:
        small_jpeg(message, 320)
    assert why in str(caught.value)


def test_an_image_bomb_takes_no_memory():
    bomb = CompressedImage(data=png_bomb(60000, 60000))
    tracemalloc.start()
    with pytest.raises(ImageError):
        small_jpeg(bomb, 320)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2**20


def test_no_bytes_break_the_look_at_a_size():
    chance = np.random.default_rng(7)
    whole = encoded('.jpg')
    for size in range(700):
        assert compressed_size(whole[:size]) in (None, (640, 480))
        found = compressed_size(b'\xff\xd8' + chance.bytes(size))
        assert found is None or all(0 <= side < 2**16 for side in found)
