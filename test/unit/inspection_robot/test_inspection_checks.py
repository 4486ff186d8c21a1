"""What the checks make of the robot's messages."""

import math

import pytest
import rospy
from geometry_msgs.msg import Twist, TwistWithCovariance, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, LaserScan
from std_msgs.msg import Bool

from smach_oracle.inspection_robot import checks
from smach_oracle.inspection_robot.site import PANELS, before_panel
from smach_oracle.inspection_robot.world.causes import draw
from smach_oracle.inspection_robot.world.inspection_world import BEAMS, InspectionWorld


def scan(world):
    return LaserScan(
        angle_min=BEAMS[0], angle_increment=BEAMS[1] - BEAMS[0], ranges=world.scan().tolist()
    )


def image(world):
    return Image(data=world.image().tobytes())


def odometry(v, w):
    return Odometry(twist=TwistWithCovariance(twist=Twist(Vector3(v, 0, 0), Vector3(0, 0, w))))


@pytest.fixture
def hears(monkeypatch):
    """Gives a message to whoever subscribes; time stands, as that of a paused simulation."""

    def install(message):
        class Subscription:
            def __init__(self, topic, spec, callback, **options):
                assert isinstance(message, spec)
                callback(message)

            def unregister(self):
                pass

        monkeypatch.setattr(rospy, 'Subscriber', Subscription)

    monkeypatch.setattr(rospy, 'get_time', lambda: 5.0)
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    return install


def test_whether_the_motors_are_on(hears):
    for powered in (True, False):
        hears(Bool(powered))
        assert checks.motors_are_on(None) is powered


@pytest.mark.parametrize('v, w, still', [(0.0, 0.0, True), (0.2, 0.0, False), (0.0, 0.2, False)])
def test_whether_the_wheels_stand(hears, monkeypatch, v, w, still):
    monkeypatch.setattr(checks, 'STOPS_S', 0.0)
    hears(odometry(v, w))
    assert checks.stands_still(None) is still


def test_whether_somebody_stands_between_robot_and_panel(hears):
    world = InspectionWorld(draw(0, only=['person_at_the_panel']))
    x, y = world.scene.errands[1].places[1]
    panel = min(PANELS, key=lambda each: math.hypot(each.x - x, each.y - y))
    world.base.pose = before_panel(panel, 1.5)
    hears(scan(world))
    assert checks.view_is_free(None) and checks.way_is_free(None)
    while world.time_s < world.scene.errands[1].begins_s + 5.0:
        world.step(0.05)
    world.base.pose = before_panel(panel, 1.5)
    hears(scan(world))
    assert not checks.view_is_free(None) and checks.way_is_free(None)


def test_whether_something_is_right_before_the_robot(hears):
    world = InspectionWorld(draw(0, only=[]))
    world.base.pose = before_panel(PANELS[0], 0.7)
    hears(scan(world))
    assert not checks.way_is_free(None)


def test_whether_light_falls_into_the_camera(hears):
    world = InspectionWorld(draw(0, only=['glare']))
    glare = world.scene.glare
    for time_s, fair in ((glare.begins_s + 1.0, False), (glare.ends_s + 1.0, True)):
        while world.time_s < time_s:
            world.step(0.05)
        world.base.pose = before_panel(PANELS[glare.panel - 1], 1.5)
        hears(image(world))
        assert checks.light_is_fair(None) is fair


def test_where_no_message_comes_the_check_does_not_hold(monkeypatch):
    class Silence:
        def __init__(self, *arguments, **options):
            pass

        def unregister(self):
            pass

    monkeypatch.setattr(rospy, 'Subscriber', Silence)
    monkeypatch.setattr(rospy, 'get_time', lambda: 5.0)
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    monkeypatch.setattr(checks, 'COMES_S', 0.1)
    assert not checks.wait_for_motors(None)
