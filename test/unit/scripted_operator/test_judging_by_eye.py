"""What the scripted operator knows when it decides, by looking about in the world, without ROS."""
from types import SimpleNamespace

import numpy as np
import pytest
from direct_hand import DirectWatcher
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header

from smach_oracle.scripted_operator.judging_by_eye import look_about
from smach_oracle.scripted_operator.ladder import Sight
from smach_oracle.scripted_operator.manual_task import place_in_base
from smach_oracle.scripted_operator.state_plans import StatePlan
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.scene import RobotStart
from smach_oracle.simulation.scenes.tabletop_scene import draw

LOOK = ((0.65, 0.0, 0.75),)
TAKE = StatePlan('take', what='objects', look=LOOK)
PUT = StatePlan('put_down', place='place_pose')


@pytest.fixture(scope='module', name='world')
def make_world():
    world = World()
    yield world
    world.close()


def pose(point):
    return PoseStamped(Header(frame_id='base_footprint'),
                       Pose(Point(*point), Quaternion(0.0, 0.0, 0.0, 1.0)))


def sight(world, plan, **userdata):
    watcher = DirectWatcher(world)
    return look_about(plan, userdata, watcher.look(), watcher)


def test_a_thing_is_looked_for_and_found(world):
    world.reset(draw(2, benign=True))
    truth = world.body_pose('object_0')[:3, 3]
    found = sight(world, TAKE, objects=[pose(truth)])
    assert found.sight == Sight()
    assert np.linalg.norm(found.about - truth) < 0.02


def test_a_thing_that_stands_elsewhere_than_detected_is_noticed(world):
    world.reset(draw(2, benign=True))
    truth = world.body_pose('object_0')[:3, 3]
    assert sight(world, TAKE, objects=[pose(truth + [0.06, 0.0, 0.0])]).sight.moved
    assert not sight(world, TAKE).sight.moved, 'nobody has detected anything'


def test_what_no_hand_reaches_is_known_before_one_tries(world):
    scene = draw(2, benign=True)
    far = tuple(body._replace(position=(0.55, 0.45, body.position[2]))
                if body.name == 'object_0' else body for body in scene.bodies)
    world.reset(scene._replace(bodies=far))
    plan = TAKE._replace(look=((0.6, 0.4, 0.75),))
    assert not sight(world, plan).sight.reachable
    assert sight(world, plan._replace(arm='left')).sight.reachable


def test_a_place_of_the_odometry_is_where_it_was_from_wherever_the_robot_stands(world):
    world.reset(draw(2, benign=True)._replace(robot=RobotStart(base=(0.1, 0.3, 0.0))))
    place = pose((0.6, -0.35, 0.85))
    place.header.frame_id = 'odom_combined'
    means = SimpleNamespace(odom_from_base=world.odom_from_base)
    assert place_in_base(place, means) == pytest.approx([0.5, -0.65, 0.85], abs=1e-3)
    assert place_in_base(pose((0.6, -0.35, 0.85)), means) == pytest.approx([0.6, -0.35, 0.85])


def test_light_in_the_camera_is_noticed(world):
    world.reset(draw(2, benign=True))
    scene = DirectWatcher(world).look_at(np.array(LOOK[0]))
    assert not scene.dazzled()
    scene.image.colour[:60, :60], scene.image.depth[:60, :60] = 255, np.nan
    assert scene.dazzled()


def test_nothing_is_put_down_with_an_empty_hand(world):
    world.reset(draw(2, benign=True))
    assert not sight(world, PUT, place_pose=pose((0.6, -0.35, 0.8))).sight.holds
