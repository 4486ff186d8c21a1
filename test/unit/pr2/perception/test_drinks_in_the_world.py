"""Detection of drinks in what the simulated PR2's camera sees of its refrigerator, against the
physical truth.
"""

import numpy as np
import pytest

from smach_oracle.geometry.transforms import inverse
from smach_oracle.pr2.kitchen import Kitchen, base_from_fridge, look_point
from smach_oracle.pr2.perception.clusters import NotSeen
from smach_oracle.pr2.perception.drink import find_drink
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT
from smach_oracle.simulation.scenes.kitchen_scene import draw
from smach_oracle.tasks.drink_retrieval import IN_THE_FRIDGE, TORSO_HEIGHT


@pytest.fixture(scope='module', name='world', params=[1, 2], ids=['whole', 'binned'])
def _world(request):
    made = World(binning=request.param)
    yield made
    made.close()


def seen(world, seed, degrees, **sensor):
    """What is found with the robot before the open fridge, and m from it to the nearest drink's
    true place and size.
    """
    scene = draw(seed, benign=True)
    fridge = scene.bodies[0]._replace(joints=((DOOR_JOINT, np.radians(degrees)),))
    world.reset(
        scene._replace(
            bodies=(fridge,) + scene.bodies[1:],
            camera=scene.camera._replace(**sensor),
            robot=scene.robot._replace(
                base=IN_THE_FRIDGE,
                joints=scene.robot.joints + (('torso_lift_joint', TORSO_HEIGHT),),
            ),
        )
    )
    robot = DirectRobot(world)
    believed = base_from_fridge(Kitchen(), robot.odom_from_base())
    robot.look_at(look_point(Kitchen(), believed))
    found = find_drink(robot.see(), Kitchen(), believed)
    base = inverse(world.true_base())
    errors = {
        name: float(np.linalg.norm(found.centre - (base @ world.body_pose(name))[:3, 3]))
        for name in world.movable()
    }
    nearest = min(errors, key=errors.__getitem__)
    size = np.array(world.body(nearest).size) * [2, 2, 1]
    return errors[nearest], float(np.abs(found.size - size).max())


@pytest.mark.parametrize('noise', [1.0, 3.0])
def test_a_drink_is_measured_to_a_centimetre(world, noise):
    measured = np.array([seen(world, seed, 95.0, noise=noise) for seed in range(1, 6)])
    assert np.median(measured[:, 0]) < 0.01 and measured[:, 0].max() < 0.015
    assert measured[:, 1].max() < 0.01 + 0.005 * noise


def test_a_door_that_is_half_shut_is_the_reason(world):
    with pytest.raises(NotSeen, match='the door hides'):
        seen(world, 1, 35.0)
