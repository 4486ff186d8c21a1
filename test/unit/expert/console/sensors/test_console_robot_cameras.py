"""Whose camera it is, and how old its image, by the clock of the robot whose it is."""

from types import SimpleNamespace

import pytest

from smach_oracle.expert.console.sensors import robot_clocks
from smach_oracle.expert.console.sensors.robot_cameras import RobotCameras, declared_in
from smach_oracle.expert.console.sensors.robot_clocks import ImageAges, RobotClocks
from smach_oracle.expert.console.sensors.sensor_streams import SensorStreams
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.console.web.settings import read_settings
from smach_oracle.oracle.errors import SettingsError

TOPICS = (
    '/head/rgb/image_raw',
    '/alpha/cam/image_raw',
    '/fleet/beta/cam/rgb/image_raw',
    '/fleet/beta/cam/depth/image_raw',
    '/fleet/cam/image_raw',
)


def cameras(**chosen):
    found = SensorStreams()
    found.follow([[topic, 'sensor_msgs/Image'] for topic in TOPICS])
    return RobotCameras(found, {'/' + robot: names for robot, names in chosen.items()})


def topics(made, robot):
    return [each['topic'] for each in made.of(robot)]


def test_a_node_directly_below_the_root_owns_what_bears_its_name_alone():
    assert topics(cameras(), '/alpha') == ['/alpha/cam/image_raw']
    assert topics(cameras(), '/gamma') == []


def test_a_namespace_is_of_those_in_it_and_not_of_their_neighbours():
    made = cameras()
    sections = PageSections()
    made.write_sections(sections, ['/fleet/beta', '/fleet/delta', '/gamma'])
    assert sections.get('cameras') == {
        '/fleet/beta': ['/fleet/beta/cam/rgb/image_raw'],
        '/fleet/delta': ['/fleet/cam/image_raw'],
        '/gamma': [],
    }


def test_its_failure_cameras_are_its_own_and_come_first():
    made = cameras()
    made.write_sections(PageSections(), ['/fleet/beta', '/fleet/delta'])
    made.declare(
        {
            '/gamma': ['head/rgb/image_raw', '/gone/image_raw'],
            '/alpha': 'nonsense',
            '/fleet/delta': ['cam/image_raw'],
            '/alpha2': [1],
        }
    )
    assert topics(made, '/gamma') == ['/head/rgb/image_raw']
    assert topics(made, '/fleet/delta') == ['/fleet/cam/image_raw'], 'as the node resolves it'
    assert topics(made, '/alpha') == ['/alpha/cam/image_raw']
    assert declared_in(['/gamma/failure_cameras', '/gamma/record']) == ['/gamma']


def test_the_setting_goes_before_all_else():
    made = cameras(alpha=('/head', '/fleet/beta/cam/depth/image_raw'))
    made.declare({'/alpha': ['/alpha/cam/image_raw']})
    assert topics(made, '/alpha') == ['/fleet/beta/cam/depth/image_raw', '/head/rgb/image_raw']


def test_the_setting_is_read_and_checked():
    def read(value):
        return read_settings(lambda name, default: value if name == 'cameras' else default).cameras

    assert read({'alpha': ['/head'], '/beta': '/a /b'}) == {
        '/alpha': ('/head',),
        '/beta': ('/a', '/b'),
    }
    assert read('none') == read({}) == {}
    for wrong in ('/head', ['/head'], {'alpha': 3}, {'alpha': ['head']}, {3: ['/head']}):
        with pytest.raises(SettingsError, match='~cameras'):
            read(wrong)


@pytest.fixture(name='clock')
def make_clock(monkeypatch):
    made = SimpleNamespace(now_s=100.0)
    monkeypatch.setattr(robot_clocks, 'time', SimpleNamespace(monotonic=lambda: made.now_s))
    return made


def test_an_age_is_by_the_clock_of_the_robot_whose_camera_it_is(clock):
    clocks, made = RobotClocks(), cameras()
    made.write_sections(PageSections(), ['/alpha', '/fleet/beta'])
    ages = ImageAges(clocks, made)
    assert ages.age_s('/alpha/cam/image_raw', 5000.0) is None, 'no clock is known'
    clocks.take('/alpha', 9000.0)
    clocks.take('/fleet/beta', 20.0)  # simulated time, perhaps
    clock.now_s += 2.0
    assert ages.age_s('/alpha/cam/image_raw', 9002.0 - 3600.0) == 3600.0
    assert ages.age_s('/alpha/cam/image_raw', 9005.0) == -3.0, 'ahead of it'
    assert ages.age_s('/fleet/beta/cam/rgb/image_raw', 21.5) == 0.5
    assert ages.age_s('/alpha/cam/image_raw', 0.0) is None, 'without a stamp'
    assert ages.age_s('/head/rgb/image_raw', 9000.0) is None, 'nobody tells whose clock'


def test_where_all_clocks_agree_one_of_them_serves_every_camera(clock):
    clocks = RobotClocks()
    clocks.take('/alpha', 9000.0)
    clocks.take('/fleet/beta', 9000.4)
    assert ImageAges(clocks, cameras()).age_s('/head/rgb/image_raw', 8999.4) == 1.0


def test_the_newest_word_counts_and_a_stamp_of_nothing_is_none(clock):
    clocks = RobotClocks()
    clocks.take('/alpha', 50.0)
    clocks.take('/alpha', 0.0)
    clocks.take('/alpha', 40.0, clock.now_s - 1.0)
    assert clocks.now_s('/alpha') == 50.0
    clock.now_s += 1.0
    clocks.take('/alpha', 10.0)  # simulated time begins again
    assert clocks.now_s('/alpha') == 10.0
