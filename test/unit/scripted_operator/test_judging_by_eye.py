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
    world = World(binning=2)
    yield world
    world.close()


def pose(point):
    return PoseStamped(
        Header(frame_id='base_footprint'), Pose(Point(*point), Quaternion(0.0, 0.0, 0.0, 1.0))
    )


def sight(world, plan, **userdata):
    watcher = DirectWatcher(world)
    return look_about(plan, userdata, watcher.look(), watcher)


def test_a_thing_is_looked_for_and_found(world):
    world.reset(draw(2, benign=True))
    truth = world.body_pose('object_0')[:3, 3]
    found = sight(world, TAKE, objects=[pose(truth)])
    assert found.sight._replace(place=None, around=()) == Sight()
    assert found.sight.place == tuple(found.about) and len(found.sight.around) <= 3
    assert np.linalg.norm(found.about - truth) < 0.02


def test_a_thing_that_stands_elsewhere_than_detected_is_noticed(world):
    world.reset(draw(2, benign=True))
    truth = world.body_pose('object_0')[:3, 3]
    assert sight(world, TAKE, objects=[pose(truth + [0.06, 0.0, 0.0])]).sight.moved
    assert not sight(world, TAKE).sight.moved, 'nobody has detected anything'


def test_what_no_hand_reaches_is_known_before_one_tries(world):
    scene = draw(2, benign=True)
    far = tuple(
        body._replace(position=(0.55, 0.45, body.position[2])) if body.name == 'object_0' else body
        for body in scene.bodies
    )
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


def lying(world, height):
    """A scene whose object lies at a place, its middle so many m above the floor."""
    scene = draw(2, benign=True)
    world.reset(
        scene._replace(
            bodies=tuple(
                body._replace(position=(0.62, -0.1, height), pitch=np.pi / 2, yaw=0.3)
                if body.name == 'object_0'
                else body
                for body in scene.bodies
            )
        )
    )
    world.step(60)


def table_top(world):
    table = next(body for body in world.scene.bodies if body.name == 'table')
    return table.position[2] + table.size[2] / 2


def test_a_thing_that_lies_on_the_table_is_seen_to_lie_and_is_not_lost(world):
    lying(world, table_top(world) + 0.03)
    for plan in (TAKE, PUT):
        found = sight(world, plan, place_pose=pose((0.6, -0.35, 0.8)))
        assert (found.sight.lies, found.sight.lost, found.sight.located) == (True, False, True)


def test_a_thing_on_the_floor_is_looked_for_there_and_is_lost(world):
    scene = draw(2, benign=True)
    world.reset(
        scene._replace(
            bodies=tuple(
                body._replace(position=(0.75, -0.75, 0.05), pitch=np.pi / 2)
                if body.name == 'object_0'
                else body
                for body in scene.bodies
            )
        )
    )
    world.step(60)
    for plan in (TAKE, PUT, StatePlan('show', look=LOOK)):
        assert sight(world, plan, place_pose=pose((0.6, -0.35, 0.8))).sight.lost


def test_a_thing_that_stands_at_its_place_is_seen_to_be_there(world):
    world.reset(draw(2, benign=True))
    truth = world.body_pose('object_0')[:3, 3]
    assert sight(world, PUT, place_pose=pose(truth)).sight.there
    assert not sight(world, PUT, place_pose=pose(truth + [0.0, -0.3, 0.0])).sight.there


def test_where_other_things_are_seen_nothing_hides_what_is_gone(world):
    scene = draw(2, benign=True)
    world.reset(
        scene._replace(
            bodies=tuple(
                body._replace(position=(-2.0, 0.0, 0.1)) if body.name == 'object_0' else body
                for body in scene.bodies
            )
        )
    )
    found = sight(world, StatePlan('show', look=LOOK))
    assert (found.sight.seen, found.sight.open) == (False, True)
    watcher = DirectWatcher(world)
    plain = watcher.look
    limb = np.zeros(plain().image.depth.shape, bool)
    limb[:40, :40] = True
    watcher.look = lambda *names: plain(*names)._replace(limbs=limb)
    found = look_about(StatePlan('show', look=LOOK), {}, watcher.look(), watcher)
    assert not found.sight.open, 'an arm may hide it'


def test_little_light_is_noticed(world):
    world.reset(draw(2, benign=True))
    scene = DirectWatcher(world).look_at(np.array(LOOK[0]))
    assert not scene.dim()
    scene.image.colour[:] = scene.image.colour * 0.4
    assert scene.dim()
