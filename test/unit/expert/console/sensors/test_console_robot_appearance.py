"""Robots as the browser draws them: which files are read, what is sent, where clouds are; and what
would do harm.
"""

import json
import os
import struct
import time

import console_case
import numpy as np
import pytest
import rospkg
import rospy
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_msgs.msg import Header

from smach_oracle.expert.console.sensors import (
    depth_clouds,
    robot_appearance,
    robot_stream,
    sensor_streams,
)
from smach_oracle.expert.console.sensors.depth_clouds import (
    DepthCamera,
    DepthCloudStream,
    cloud_of_depth,
    depth_cameras,
)
from smach_oracle.expert.console.sensors.mesh_files import MeshFiles
from smach_oracle.expert.console.sensors.robot_appearance import RobotAppearance
from smach_oracle.expert.console.sensors.robot_stream import RobotStream, robots_in
from smach_oracle.expert.console.sensors.sensor_streams import DerivedStream
from smach_oracle.geometry.meshes import MeshError
from smach_oracle.ros.images import ImageError, cloud_message, colour_image, depth_image

OBJ = b'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n'
ROBOT = """<robot name="arm">
<link name="base"><visual><geometry><box size="1 2 4"/></geometry></visual></link>
<link name="hand"><visual><geometry><mesh filename="{}"/></geometry></visual>
<collision><geometry><sphere radius="0.5"/></geometry></collision></link>
<joint name="slide" type="prismatic">
<parent link="base"/><child link="hand"/><axis xyz="1 0 0"/></joint></robot>"""
BALL_HANDED = ROBOT.format('none')  # its mesh is missing


class Packages:
    """One package."""

    def __init__(self, path):
        self._path = path

    def get_path(self, name):
        if name != 'arm':
            raise rospkg.ResourceNotFound(name)
        return self._path


@pytest.fixture
def files(tmp_path):
    package = tmp_path / 'arm'
    package.mkdir()
    (package / 'hand.obj').write_bytes(OBJ)
    (package / 'big hand.OBJ').write_bytes(OBJ)
    (tmp_path / 'secret.obj').write_bytes(OBJ)
    (package / 'passwd').write_text('root:x:0:0')
    (package / 'broken.stl').write_text('root:x:0:0')
    os.mkfifo(str(package / 'pipe.stl'))
    return MeshFiles(Packages(str(package)))


def unpacked(body):
    (length,) = struct.unpack('<I', body[:4])
    assert length % 4 == 0
    return json.loads(body[4 : 4 + length]), body[4 + length :]


def test_meshes_are_found_in_packages_and_at_absolute_paths(files, tmp_path):
    absolute = str(tmp_path / 'arm' / 'hand.obj')
    for name in (
        'package://arm/hand.obj',
        'package://arm/big%20hand.OBJ',
        absolute,
        'file://' + absolute,
    ):
        assert len(files.mesh(name).triangles) == 1


@pytest.mark.parametrize(
    'name, info',
    [
        ('package://arm/../secret.obj', 'stay within'),
        ('package://arm/%2e%2e/secret.obj', 'stay within'),
        ('package://arm//etc/passwd', 'stay within'),
        ('package://../arm/hand.obj', 'stay within'),
        ('package://arm', 'stay within'),
        ('package://other/hand.obj', 'no package other'),
        ('package://arm/passwd', 'ends with'),
        ('package://arm/broken.stl', 'no STL'),
        ('package://arm/pipe.stl', 'no plain file'),
        ('package://arm/gone.obj', 'No such file'),
        ('/etc/passwd', 'ends with'),
        ('/dev/zero', 'ends with'),
        ('file:///etc/../etc/shadow', 'ends with'),
        ('hand.obj', 'neither'),
        ('http://evil.example/x.stl', 'neither'),
        ('package://arm/hand.obj\0.stl', 'no file name'),
        ('package://arm/hand%00.obj', 'stay within'),
        ('', 'neither'),
        ('package://arm/' + 'x' * 5000, 'no file name'),
    ],
)
def test_names_that_lead_elsewhere_are_refused_without_a_word_of_what_is_there(files, name, info):
    with pytest.raises(MeshError) as error:
        files.mesh(name)
    assert info in str(error.value) and 'root:' not in str(error.value)


def test_a_robot_is_sent_with_its_geometry(files):
    appearance = RobotAppearance(ROBOT.format('package://arm/hand.obj'), files)
    shown, data = unpacked(appearance.encoded().body)
    assert (shown['name'], shown['links'], shown['missing'], shown['root']) == (
        'arm',
        ['base', 'hand'],
        [],
        'base',
    )
    (link, geometry, place, colour), hand = shown['parts']
    assert (link, place[0], place[5], place[10]) == (0, 1, 2, 4) and hand[0] == 1
    box = shown['geometries'][geometry]
    corners = (
        np.frombuffer(data, '<u2', 3 * box['corners']).reshape(-1, 3) / 65535.0 * box['scale']
        + box['offset']
    )
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], [[-0.5] * 3, [0.5] * 3])
    assert len(data) == sum(
        6 * each['corners'] + 6 * each['triangles'] for each in shown['geometries']
    )
    np.testing.assert_allclose(
        appearance.places({'slide': 0.25})[1].reshape(3, 4)[:, 3], [0.25, 0, 0]
    )


def test_where_a_mesh_is_missing_stands_what_the_link_collides_with(files):
    shown, _ = unpacked(
        RobotAppearance(ROBOT.format('package://arm/../secret.obj'), files).encoded().body
    )
    assert shown['lost'] == 1 and 'stay within' in shown['missing'][0] and len(shown['parts']) == 2
    assert shown['geometries'][1]['triangles'] == len(
        robot_appearance._PRIMITIVES['sphere'].triangles
    )


def test_the_triangles_of_all_links_together_are_limited(files, monkeypatch):
    assert robot_appearance._share([10] * 10) == robot_appearance.MOST_TRIANGLES
    counts = [100] * 20 + [10**6] * 30
    most = robot_appearance._share(counts)
    assert (
        sum(min(count, most) for count in counts)
        <= robot_appearance.MOST_TRIANGLES
        < 30 * (most + 70)
    )


def test_a_robot_of_very_many_round_parts_is_drawn_of_boxes(files):
    balls = '<visual><geometry><sphere radius="1"/></geometry></visual>' * (
        robot_appearance.MOST_ROUND + 1
    )
    shown, _ = unpacked(
        RobotAppearance('<robot name="r"><link name="l">{}</link></robot>'.format(balls))
        .encoded()
        .body
    )
    assert [each['triangles'] for each in shown['geometries']] == [12]
    assert len(shown['parts']) == robot_appearance.MOST_ROUND + 1


class Silent:
    """A subscriber, or transforms, of which nothing comes."""

    alive = 0

    def __init__(self, *_, **__):
        Silent.alive += 1

    def unregister(self):
        Silent.alive -= 1

    stop = unregister

    def at(self, target, source, stamp):
        return None


@pytest.fixture
def quiet(monkeypatch):
    Silent.alive = 0
    for module in (sensor_streams, robot_stream, depth_clouds):
        monkeypatch.setattr(module.rospy, 'Subscriber', Silent)
    monkeypatch.setattr(robot_stream, '_RecentTransforms', Silent)


def looked_at(parameter='/robot_description', urdf=BALL_HANDED, number=1):
    robot = RobotStream(number, parameter, {parameter: urdf}.__getitem__)
    robot.newer(0)
    robot.update_subscription(True)
    return robot


def test_a_robot_is_seen_before_its_joints_speak_and_moves_with_them(quiet):
    robot = looked_at()
    encoded, facts = robot.file_of(robot.newer(0), 640)
    assert json.loads(facts)['joints'] == 0 and len(encoded.body) == 2 * 12 * 4
    robot.take(JointState(name=['slide', 'odd'], position=[0.5, float('nan')]))
    robot.take(JointState(name=['other'], position=[1.0]))
    encoded, facts = robot.file_of(robot.newer(1), 640)
    assert np.frombuffer(encoded.body, '<f4')[15] == 0.5 and json.loads(facts)['joints'] == 2


@pytest.mark.parametrize(
    'make, topics',
    [
        (lambda: RobotStream(1, '/robot_description', lambda _: BALL_HANDED), 2),
        (lambda: DepthCloudStream(1, DepthCamera('/d', '/info', '/colour')), 3),
    ],
)
def test_nothing_is_listened_to_unless_somebody_looks_and_not_for_longer(
    quiet, monkeypatch, make, topics
):
    sensor = make()
    sensor.update_subscription(True)
    assert Silent.alive == 0
    sensor.newer(0)
    sensor.update_subscription(True)
    sensor.update_subscription(True)
    assert Silent.alive == topics
    later = time.monotonic() + sensor_streams.IDLE_S
    monkeypatch.setattr(sensor_streams.time, 'monotonic', lambda: later)
    sensor.update_subscription(True)
    assert Silent.alive == 0 and sensor.newer(0) is None


@pytest.mark.parametrize(
    'urdf, info', [('<robot', 'not XML'), (7, 'holds no text'), ('<!DOCTYPE a>', 'not allowed')]
)
def test_a_description_that_is_none_is_told_in_a_sentence(quiet, urdf, info):
    robot = looked_at(urdf=urdf)
    for _ in range(2):
        with pytest.raises(ValueError, match=info):
            robot.file_of(robot.newer(0), 640)
    assert robot.place_of('base', rospy.Time())[0] is None


def test_a_cloud_is_placed_at_its_robot_by_its_links_and_those_of_a_namespace(quiet):
    robot = looked_at('/alpha/robot_description')
    assert robot.place_of('hand', rospy.Time()) == (None, 'The robot is not known yet.')
    robot.take(JointState(name=['slide'], position=[0.5]))
    robot.appearance()
    for frame in ('hand', '/hand', 'alpha/hand'):
        place, astray = robot.place_of(frame, rospy.Time())
        assert (place[0, 3], astray) == (0.5, '')
    assert robot.place_of('camera', rospy.Time()) == (None, 'No transform from camera to base.')


def test_robots_are_found_by_the_names_of_their_descriptions():
    assert robots_in(
        ['/robot_description', '/a/robot_description', '/robot_description_semantic', '/x']
    ) == ['/a/robot_description', '/robot_description']


PUBLISHED = [
    ['/cam/depth/image_raw', 'sensor_msgs/Image'],
    ['/cam/depth/camera_info', 'sensor_msgs/CameraInfo'],
    ['/cam/rgb/image_raw', 'sensor_msgs/Image'],
    ['/cam/rgb/camera_info', 'sensor_msgs/CameraInfo'],
]


def test_cameras_with_depth_and_calibration_but_no_cloud_are_found():
    assert depth_cameras(PUBLISHED) == [
        DepthCamera('/cam/depth/image_raw', '/cam/depth/camera_info', None)
    ]
    registered = [
        [topic.replace('/depth/image', '/depth_registered/image'), kind]
        for topic, kind in PUBLISHED
    ]
    assert depth_cameras(registered) == [
        DepthCamera('/cam/depth_registered/image_raw', '/cam/rgb/camera_info', '/cam/rgb/image_raw')
    ]
    assert depth_cameras(PUBLISHED + [['/cam/depth/points', 'sensor_msgs/PointCloud2']]) == []
    assert depth_cameras(PUBLISHED[:1] + PUBLISHED[2:3]) == [], (
        'without a calibration there is no cloud'
    )


def calibration(focal=100.0):
    return CameraInfo(width=64, height=48, K=[focal, 0, 32, 0, focal, 24, 0, 0, 1])


def test_depth_becomes_points_with_the_colours_of_the_same_moment():
    depth = np.full((48, 64), 2.0)
    depth[:, :32] = np.nan
    colour = colour_image(np.full((48, 64, 3), 9, np.uint8), Header(stamp=rospy.Time(5)))
    cloud = cloud_of_depth(depth_image(depth, Header(stamp=rospy.Time(5))), calibration(), colour)
    assert len(cloud.points) == 48 * 32 and (cloud.colours == 9).all()
    np.testing.assert_allclose(cloud.points[0], [0.0, -0.48, 2.0])
    later = cloud_of_depth(depth_image(depth, Header(stamp=rospy.Time(6))), calibration(), colour)
    assert not (later.colours == 9).all(), 'colours of another moment are not those of these points'
    large = cloud_of_depth(
        depth_image(np.full((480, 640), 2.0), Header()), calibration(), most=1000
    )
    assert len(large.points) == 1000
    np.testing.assert_allclose(
        np.ptp(large.points[:, 0]), 1.27, atol=0.03, err_msg='scaled with the calibration'
    )


def test_depth_without_a_calibration_or_of_another_kind_is_told(quiet):
    sensor = DepthCloudStream(
        3, DepthCamera('/cam/depth/image_raw', '/cam/depth/camera_info', None)
    )
    sensor.newer(0)
    sensor.update_subscription(True)
    sensor.take(depth_image(np.ones((4, 4)), Header()))
    with pytest.raises(ImageError, match='nothing comes on /cam/depth/camera_info'):
        sensor.file_of(sensor.newer(0), 640)
    sensor.take_info(calibration(0.0))
    with pytest.raises(ImageError, match='calibrated'):
        sensor.file_of(sensor.newer(0), 640)
    sensor.take_info(calibration())
    facts = json.loads(sensor.file_of(sensor.newer(0), 640)[1])
    assert (facts['kind'], facts['count'], facts['of']) == ('cloud', 16, 16)
    sensor.take(Image(encoding='rgb8', width=100000, height=100000))
    with pytest.raises(ImageError, match='allowed'):
        sensor.file_of(sensor.newer(0), 640)


@pytest.mark.usefixtures('quiet')
class TestModels(console_case.ConsoleCase):
    def setUp(self):
        super().setUp()
        self.sensors.follow(
            [['/points', 'sensor_msgs/PointCloud2']],
            [
                DerivedStream(
                    '/robot_description',
                    robot_stream.DESCRIPTION,
                    lambda number: looked_at(number=number),
                )
            ],
        )
        self.cloud, self.robot = (
            self.sensors.on(topic) for topic in ('/points', '/robot_description')
        )
        self.number = self.robot.number
        self.cookie, self.info = self.sign_in('viewer')

    def get(self, path, **headers):
        return self.ask(
            path, **dict({'Cookie': self.cookie, 'X_Xsrf': self.info['xsrf']}, **headers)
        )

    def test_a_model_is_told_to_those_who_are_signed_in(self):
        path = '/model/{}'.format(self.number)
        answer = self.get(path)
        assert (answer.code, unpacked(answer.body)[0]['name']) == (200, 'arm')
        for headers, code in (
            ({'Cookie': None}, 401),
            ({'X_Xsrf': None}, 403),
            ({'Host': 'evil.example'}, 421),
            ({'Origin': 'http://evil.example'}, 403),
        ):
            assert self.get(path, **headers).code == code, headers

    def test_no_file_and_no_parameter_can_be_named(self):
        for path in (
            '/model/robot_description',
            '/model/..%2f..%2fetc%2fpasswd',
            '/model/99',
            '/model/-1',
            '/model/',
            '/model/{}'.format(self.cloud.number),
            '/mesh/1',
            '/model/1/hand.obj',
        ):
            assert self.get(path).code == 404, path

    def test_a_model_that_cannot_be_drawn_is_told_as_text(self):
        self.robot._urdf = '<!DOCTYPE robot [<!ENTITY a "b">]><robot/>'
        answer = self.get('/model/{}'.format(self.number))
        assert answer.code == 422 and b'not allowed' in answer.body
        assert answer.headers['Content-Type'].startswith('text/plain')

    def test_a_cloud_is_told_with_its_place_at_a_robot(self):
        self.robot.appearance()
        self.cloud.take(cloud_message(np.ones((5, 3)), Header(frame_id='hand')))
        path = '/sample/{}?robot={}'.format(self.cloud.number, self.number)
        assert json.loads(self.get(path).headers['X-Facts'])['place'] == [
            1,
            0,
            0,
            0,
            0,
            1,
            0,
            0,
            0,
            0,
            1,
            0,
        ]
        self.cloud.take(cloud_message(np.ones((5, 3)), Header(frame_id='nowhere')))
        assert (
            json.loads(self.get(path).headers['X-Facts'])['astray']
            == 'No transform from nowhere to base.'
        )
        for robot, code in (
            (self.cloud.number, 404),
            (99, 404),
            ('x', 400),
            ('1&robot=1', 400),
            ('-1', 400),
        ):
            assert self.get('/sample/{}?robot={}'.format(self.cloud.number, robot)).code == code, (
                robot
            )
        assert isinstance(self.cloud._sample.message, PointCloud2)
