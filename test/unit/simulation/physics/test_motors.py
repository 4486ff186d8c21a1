"""The robot's motors: as strong as a PR2's, and with arms to carry that springs balance."""

import numpy as np
import pybullet
import pytest
from worlds import CAN, TABLE, Hand, empty, scene

from smach_oracle.pr2.robot import ARM_JOINTS, ARMS
from smach_oracle.simulation.physics.pr2_body import SUBSTEPS
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot

WEIGHT = 9.81  # N/kg


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def pushed(world, link, force, periods):
    """Push a link for so many control periods; how far it gave way, m."""
    before = world.link_pose(link)[:3, 3]
    for _ in range(periods):
        for _ in range(SUBSTEPS):
            where = world.link_pose(link)[:3, 3]
            pybullet.applyExternalForce(
                world.robot.index,
                world.robot.links[link],
                force,
                where.tolist(),
                pybullet.WORLD_FRAME,
                physicsClientId=world.client,
            )
            pybullet.stepSimulation(physicsClientId=world.client)
    return float(np.linalg.norm(world.link_pose(link)[:3, 3] - before))


def test_an_arm_weighs_nothing_to_its_motors(world):
    world.reset(empty())
    robot = DirectRobot(world)
    names = ARM_JOINTS['right']
    stretched = np.array([[-0.3, 0.0, -1.2, -0.3, 0.0, -0.2, 0.0]])
    robot.follow(names, stretched, np.array([4.0]))
    world.step(60)
    assert [world.joints()[name] for name in names] == pytest.approx(stretched[0], abs=2e-3)
    assert all(abs(world.joint_efforts()[name]) < 0.5 for name in names)


def test_no_motor_gives_more_than_the_urdf_says(world):
    world.reset(empty())
    limits = world.robot.efforts
    assert limits['r_shoulder_pan_joint'] == 30.0 and limits['l_wrist_roll_joint'] == 10.0
    pushed(world, 'r_wrist_flex_link', [0.0, 400.0, 0.0], 6)
    for arm in ARMS:
        for name in ARM_JOINTS[arm]:
            assert abs(world.joint_efforts()[name]) <= limits[name] + 1e-6, name


def test_an_arm_gives_way_to_a_person_but_not_to_a_touch(world):
    world.reset(empty())
    assert pushed(world, 'r_wrist_flex_link', [0.0, 10.0, 0.0], 60) < 0.005
    assert pushed(world, 'r_wrist_flex_link', [0.0, 120.0, 0.0], 60) > 0.05


def test_a_hand_carries_as_much_as_a_pr2_s_does(world):
    """1.8 kg is what a PR2's arm is said to lift."""
    world.reset(scene(TABLE, CAN._replace(mass=1.8)))
    hand = Hand(world, DirectRobot(world))
    hand.take('can', effort=100.0)
    assert world.holding('can') == 'right'
    assert world.body_pose('can')[2, 3] > CAN.position[2] + 0.06


def test_things_have_their_weight(world):
    """On the table, and in the air."""
    world.reset(scene(TABLE, CAN, CAN._replace(name='falling', position=(0.7, 0.3, 3.0))))
    assert sum(each.force for each in world.contacts('can')) == pytest.approx(0.33 * WEIGHT, 0.02)
    # by half a second of falling after a reset
    assert world.body_speed('falling')[0] == pytest.approx(0.5 * WEIGHT, rel=0.06)
