"""The scripted operator's hand with a thing that lies: taken from above, turned, set upright."""

import numpy as np
import pytest
from direct_hand import DirectHand, DirectWatcher

from smach_oracle.geometry.box import UprightBox
from smach_oracle.scripted_operator.hand_driver import HandDriver
from smach_oracle.scripted_operator.manoeuvres import Attempt, put_down
from smach_oracle.scripted_operator.seen_scene import SeenScene
from smach_oracle.scripted_operator.uprighting import lying_grasps, set_upright, take_upright
from smach_oracle.simulation.physics.judge import RECEIVER
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.tasks import draw
from smach_oracle.tasks.drink_retrieval import HOME, TORSO_HEIGHT

PALM = np.array([0.62, 0.0, 0.85])


@pytest.fixture(scope='module', name='world')
def make_world():
    world = World(binning=2)
    yield world
    world.close()


def attempt(world):
    return Attempt(
        HandDriver(DirectHand(world, 'right')), DirectWatcher(world), 0, lambda: np.zeros(3)
    )


def laid(scene, name, at, on, yaw):
    """A scene in which a thing lies at (2,) m on something."""
    surface = next(body for body in scene.bodies if body.name == on)
    top = surface.position[2] + surface.size[2] / 2
    return scene._replace(
        bodies=tuple(
            body._replace(position=(*at, top + 0.035), pitch=np.pi / 2, yaw=yaw)
            if body.name == name
            else body
            for body in scene.bodies
        )
    )


def uprightness(world, name):
    """1 for a thing whose axis is vertical, whichever of its ends is up."""
    return abs(float(world.body_pose(name)[2, 2]))


def test_a_drink_that_lies_on_the_palm_is_set_upright_there(world):
    scene = draw('drink_retrieval', 7, True)
    palm = next(body for body in scene.bodies if body.name == RECEIVER).position
    joints = tuple(
        (name, TORSO_HEIGHT if name == 'torso_lift_joint' else at)
        for name, at in scene.robot.joints
    )
    scene = scene._replace(robot=scene.robot._replace(base=HOME, joints=joints))
    world.reset(laid(scene, 'drink_0', palm[:2], RECEIVER, 0.9))
    world.step(60)
    at = attempt(world)
    assert at.watcher.look_at(PALM).wanted().lies(None)
    take_upright(at, SeenScene.wanted, PALM)
    assert world.holding('drink_0') == 'right' and uprightness(world, 'drink_0') > 0.95
    top = at.watcher.look_at(PALM, RECEIVER).named(RECEIVER).top
    put_down(at, top, float(top[2]))
    assert uprightness(world, 'drink_0') > 0.99
    assert RECEIVER in {contact.other for contact in world.contacts('drink_0')}


def test_a_thing_that_lies_on_the_table_is_set_upright_where_it_lies(world):
    world.reset(laid(draw('pick_and_place', 2, True), 'object_0', (0.62, -0.1), 'table', 0.3))
    world.step(60)
    set_upright(attempt(world), SeenScene.wanted, np.array([0.62, -0.1, 0.75]))
    assert uprightness(world, 'object_0') > 0.99
    assert np.hypot(*(world.body_pose('object_0')[:2, 3] - (0.62, -0.1))) < 0.08


@pytest.mark.parametrize('yaw', [-1.5, -0.6, 0.0, 0.7, 1.5])
def test_the_fingers_come_across_a_thing_that_lies_and_the_hand_looks_ahead(yaw):
    box = UprightBox(np.array([0.6, -0.19, 0.78]), np.array([0.12, 0.06, 0.06]), yaw)
    for pose in lying_grasps(box, 'right'):
        along = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        assert abs(pose[:3, 1] @ along) < 1e-6, 'the fingers close along y of the tool'
        assert pose[2, 0] < -0.9, 'from above'
        assert pose[0, 2] > -0.1, 'level, it looks ahead and not back'
