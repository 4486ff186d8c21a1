"""The scripted operator's hand in the kitchen, without ROS: a drink taken off its shelf, and handed
over.
"""

import numpy as np
import pytest
from direct_hand import DirectHand, DirectWatcher

from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.scripted_operator.hand_driver import HandDriver
from smach_oracle.scripted_operator.manoeuvres import Attempt, ManoeuvreError, pull_out, put_down
from smach_oracle.scripted_operator.seen_scene import SeenScene
from smach_oracle.simulation.physics.judge import judge
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT
from smach_oracle.simulation.scenes.kitchen_scene import draw
from smach_oracle.tasks.drink_retrieval import HOME, IN_THE_FRIDGE, OUT_OF_THE_FRIDGE, TORSO_HEIGHT

SHELF = np.array([0.7, 0.15, 0.88])  # m, base_footprint, where a person looks
PALM = np.array([0.62, 0.0, 0.85])


@pytest.fixture(scope='module', name='world')
def make_world():
    world = World(binning=2)
    yield world
    world.close()


def before_the_shelf(seed):
    """A benign kitchen with its door open and the robot before the drinks."""
    scene = draw(seed, benign=True)
    fridge = scene.bodies[0]._replace(joints=((DOOR_JOINT, 1.7),))
    joints = tuple(
        (name, TORSO_HEIGHT if name == 'torso_lift_joint' else at)
        for name, at in scene.robot.joints
    )
    return scene._replace(
        bodies=(fridge,) + scene.bodies[1:],
        robot=scene.robot._replace(joints=joints, base=IN_THE_FRIDGE),
    )


def attempt(world, number=0, sigma=0.004):
    generator = np.random.default_rng(number)
    return Attempt(
        HandDriver(DirectHand(world, 'right')),
        DirectWatcher(world),
        number,
        lambda: generator.normal(0.0, sigma, 3),
    )


def test_a_drink_is_taken_off_its_shelf_by_hand_and_put_on_the_palm_by_hand(world):
    world.reset(before_the_shelf(3))
    pull_out(attempt(world), SeenScene.wanted, SHELF)
    assert world.holding('drink_0') == 'right'
    robot = DirectRobot(world)
    for x, y, yaw in (OUT_OF_THE_FRIDGE, HOME):
        robot.drive(from_rpy((x, y, 0.0), yaw=yaw))
    at = attempt(world)
    palm = at.watcher.look_at(PALM, 'palm').named('palm')
    put_down(at, palm.top, float(palm.top[2]))
    verdict = judge(world, world.scene.goal)
    assert verdict.success, verdict.why


@pytest.mark.parametrize('seed', [2, 6])
def test_a_drink_that_two_fingers_press_on_counts_as_held(world, seed):
    """Though there be a hair's breadth between a finger and the drink, as the solver has it."""
    world.reset(before_the_shelf(seed))
    pull_out(attempt(world), SeenScene.wanted, SHELF)
    assert world.holding('drink_0') == 'right'


def test_a_hand_that_stands_half_open_is_felt_to_hold_nothing(world):
    """As it does when it has let go of the door's handle."""
    world.reset(before_the_shelf(3))
    DirectRobot(world).gripper('right', 0.045)
    with pytest.raises(ManoeuvreError, match='holds nothing'):
        put_down(attempt(world), PALM, float(PALM[2]))
    DirectRobot(world).gripper('right', 0.045)
    pull_out(attempt(world), SeenScene.wanted, SHELF)
    assert world.holding('drink_0') == 'right'


def test_a_hand_that_misses_in_the_fridge_comes_out_open(world):
    world.reset(before_the_shelf(3))
    at = attempt(world)._replace(slip=lambda: np.array([0.0, 0.0, 0.10]))
    with pytest.raises(ManoeuvreError, match='closed on nothing'):
        pull_out(at, SeenScene.wanted, SHELF)
    assert world.gap('right') > 0.07
    assert not [each for each in world.contacts('fridge') if each.other == 'robot']
