"""Images, clouds and joints as a browser gets them: what is shown, and what a hostile or broken
message does.
"""

import struct

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage, Image, JointState, PointCloud2
from std_msgs.msg import Header

from smach_oracle.expert.console.sensors.clouds import (
    CloudError,
    encode_cloud,
    encode_joints,
    thinned,
)
from smach_oracle.expert.console.sensors.images import MOST_BYTES, encode_image, false_colours
from smach_oracle.ros.images import ImageError, cloud_message, colour_image, depth_image

HEADER = Header(frame_id='camera')


def shown(encoded):
    """(h, w, 3) RGB of what goes to the browser."""
    return cv2.imdecode(np.frombuffer(encoded.body, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]


def blue(height=60, width=80):
    picture = np.zeros((height, width, 3), np.uint8)
    picture[:, :, 2] = 200
    return picture


def test_colour_is_a_jpeg_in_its_own_colours():
    encoded = encode_image(colour_image(blue(), HEADER), 320)
    assert encoded.content_type == 'image/jpeg' and encoded.body[:2] == b'\xff\xd8'
    assert encoded.facts == {'kind': 'colour', 'size': [80, 60]}
    assert np.abs(shown(encoded).astype(int) - blue()).max() < 10


def test_a_large_image_is_narrowed_and_says_how_large_it_was():
    encoded = encode_image(colour_image(blue(600, 900), HEADER), 320)
    assert shown(encoded).shape == (213, 320, 3) and encoded.facts['size'] == [900, 600]


def test_depth_tells_its_range_and_shows_near_in_red_and_far_in_blue():
    depth = np.full((40, 60), 3.0, np.float32)
    depth[:, :20], depth[:5] = 0.5, np.nan
    encoded = encode_image(depth_image(depth, HEADER), 320)
    assert encoded.content_type == 'image/png' and encoded.facts['range'] == [0.5, 3.0]
    near, far, nothing = (
        shown(encoded)[row, column].astype(int) for row, column in ((20, 5), (20, 50), (2, 30))
    )
    assert near[0] > near[2] + 50 and far[2] > far[0] + 50 and set(nothing) == {40}


def test_a_depth_image_without_any_depth_is_shown_all_the_same():
    encoded = encode_image(depth_image(np.full((8, 8), np.nan, np.float32), HEADER), 320)
    assert encoded.facts['range'] == [0.0, 0.0] and (shown(encoded) == 40).all()
    assert false_colours(np.ones((2, 2)), 1.0, 1.0).shape == (2, 2, 3)


@pytest.mark.parametrize('suffix', ['.jpg', '.png'])
def test_a_compressed_image_is_made_anew_and_not_passed_on(suffix):
    data = bytes(cv2.imencode(suffix, blue()[:, :, ::-1].copy())[1]) + b'<script>'
    encoded = encode_image(CompressedImage(format='jpeg', data=data), 640)
    assert (
        np.abs(shown(encoded).astype(int) - blue()).max() < 10 and b'<script>' not in encoded.body
    )


@pytest.mark.parametrize(
    'kind, header, stored, metres',
    [
        ('16UC1; compressedDepth', (0, 0.0, 0.0), 1500, 1.5),
        ('32FC1; compressedDepth png', (0, 100.0, 50.0), 100, 2.0),
    ],
)
def test_compressed_depth_is_unpacked(kind, header, stored, metres):
    values = np.full((10, 12), stored, np.uint16)
    values[0] = 0
    data = struct.pack('<iff', *header) + bytes(cv2.imencode('.png', values)[1])
    encoded = encode_image(CompressedImage(format=kind, data=data), 640)
    assert encoded.facts['kind'] == 'depth' and encoded.facts['range'] == pytest.approx(
        [metres, metres]
    )


def test_a_bayer_mosaic_is_shown_in_colours():
    mosaic = np.zeros((20, 20), np.uint8)
    mosaic[0::2, 0::2] = 200  # red
    message = Image(height=20, width=20, step=20, encoding='bayer_rggb8', data=mosaic.tobytes())
    red, _, blueness = shown(encode_image(message, 320))[10, 10]
    assert red > 150 and blueness < 60


def huge_png():
    """A few bytes that announce 40000 x 40000 pixels."""
    data = bytes(cv2.imencode('.png', np.zeros((4, 4), np.uint8))[1])
    return data[:16] + struct.pack('>II', 40000, 40000) + data[24:]


@pytest.mark.parametrize(
    'message',
    [
        Image(),
        Image(height=2**30, width=2**30, encoding='rgb8', step=3, data=b'xxx'),
        Image(height=2, width=2, encoding='rgb8', step=6, data=b'short'),
        Image(height=2, width=2, encoding='<b>', step=6, data=b'x' * 12),
        CompressedImage(),
        CompressedImage(format='png', data=b'GIF89a'),
        CompressedImage(format='png', data=huge_png()),
        CompressedImage(format='compressedDepth', data=b'x'),
        CompressedImage(format='compressedDepth', data=b'x' * 40),
        CompressedImage(format='jpeg', data=bytes(MOST_BYTES + 1)),
    ],
)
def test_what_is_no_image_is_refused_with_a_reason(message):
    with pytest.raises(ImageError) as error:
        encode_image(message, 640)
    assert str(error.value)


def unpacked(encoded):
    count, data = encoded.facts['count'], encoded.body
    places = np.frombuffer(data, '<u2', 3 * count).reshape(count, 3) / 65535.0
    return (
        places * encoded.facts['scale'] + encoded.facts['offset'],
        np.frombuffer(data, np.uint8, 3 * count, 6 * count).reshape(count, 3),
    )


def test_a_cloud_comes_back_as_it_was_with_its_colours():
    points = np.random.default_rng(3).uniform(-2, 3, (500, 3))
    colours = np.random.default_rng(4).integers(0, 255, (500, 3)).astype(np.uint8)
    found, shades = unpacked(encode_cloud(cloud_message(points, HEADER, colours)))
    assert np.abs(found - points).max() < 1e-4 and (shades == colours).all()


def test_a_large_organised_cloud_is_thinned_and_its_holes_are_left_out():
    points = np.random.default_rng(3).uniform(-1, 1, (480, 640, 3))
    points[::2] = np.nan
    encoded = encode_cloud(cloud_message(points, HEADER))
    assert (
        encoded.facts['count'] == 20000
        and encoded.facts['of'] == 480 * 640
        and len(encoded.body) == 9 * 20000
    )
    assert np.isfinite(unpacked(encoded)[0]).all()


def test_a_cloud_without_colours_is_coloured_by_height():
    points = np.zeros((50, 3))
    points[:, 2] = np.linspace(0, 1, 50)
    _, shades = unpacked(encode_cloud(cloud_message(points, HEADER)))
    assert tuple(shades[0]) == (60, 110, 220) and tuple(shades[-1]) == (250, 190, 60)


def test_an_empty_cloud_is_empty():
    assert encode_cloud(cloud_message(np.zeros((0, 3)), HEADER)).facts['count'] == 0
    assert encode_cloud(cloud_message(np.full((9, 3), np.nan), HEADER)).facts['count'] == 0


def lying(**fields):
    message = cloud_message(np.zeros((10, 3)), HEADER)
    for name, value in fields.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize(
    'message',
    [
        PointCloud2(width=1, height=1),
        lying(width=2**31, height=2**31),
        lying(data=b'short'),
        lying(row_step=1),
        lying(point_step=2),
        lying(point_step=0, row_step=0),
        lying(fields=[]),
    ],
)
def test_what_is_no_cloud_is_refused(message):
    with pytest.raises(CloudError):
        thinned(message)


def test_joints_are_told_with_what_there_is_of_them():
    joints = encode_joints(
        JointState(name=['a', 'b'], position=[1.0, float('nan')], velocity=[2.0])
    ).facts['joints']
    assert joints == [['a', 1.0, 2.0, None], ['b', None, None, None]]
