"""Whole tasks watched by physics: of all that stands around, the robot touches what it takes, and
nothing else.
"""

import numpy as np
import pytest
from watched_world import WatchedWorld

from smach_oracle.pr2.skills import pick
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.pick_and_place import PickAndPlaceRehearsal, rehearse
from smach_oracle.simulation.scenes import tabletop_scene


@pytest.mark.parametrize('seed, binning', [(4, 1), (9, 2)])
def test_the_robot_touches_what_it_takes_and_nothing_else(seed, binning):
    """Test_kitchen.py sees the same of the other task."""
    world = WatchedWorld(binning=binning)
    done = rehearse(tabletop_scene.draw(seed, benign=True), world)
    assert done.success, (done.failed, done.reason, done.why)
    assert len(world.movable()) > 1 and world.touched == {'object_0'}
    world.close()


def test_a_grasp_from_which_the_arm_cannot_lift_is_left_out(monkeypatch):
    """The first that is in reach is said to be too high up for that."""
    grasps, way_up = [], pick.way_up

    def none_from_the_first(hand, start, grasp, heights):
        grasps.append(grasp)
        if np.allclose(grasp, grasps[0]):
            return None
        return way_up(hand, start, grasp, heights)

    monkeypatch.setattr(pick, 'way_up', none_from_the_first)
    world = World(binning=2)
    done = rehearse(tabletop_scene.draw(4, benign=True), world)
    assert done.success, (done.failed, done.reason, done.why)
    assert np.abs(grasps[-1] - grasps[0]).max() > 0.02
    world.close()


def test_what_was_moved_meanwhile_is_not_knocked_over():
    world = World(binning=2)
    done = rehearse(tabletop_scene.draw(313), world)
    assert done.failed == 'PICK' and 'no longer where it was seen' in done.reason
    assert not world.harm.found(world)
    world.close()


@pytest.mark.parametrize('seed', [69, 354])
def test_what_stands_beside_the_image_is_not_overlooked_for_what_is_farther_away(seed):
    """The nearest thing stands far to the left there."""
    world = World(binning=2)
    done = rehearse(tabletop_scene.draw(seed), world)
    assert done.failed == 'DETECT_TABLETOP' and 'something nearer' in done.reason
    world.close()


def test_a_glance_aside_that_shows_nothing_nearer_costs_the_trial_nothing():
    """The nearest thing stands about as far away as the table's nearest part beside the image."""
    world = World(binning=2)
    world.reset(tabletop_scene.draw(29, benign=True))
    trial, seen = PickAndPlaceRehearsal(world), []
    look_at = trial.robot.look_at
    trial.robot.look_at = lambda point: (seen.append(point), look_at(point))
    for _, work in trial.states[:2]:
        work()
    eye = world.link_pose('wide_stereo_optical_frame')
    trial.states[2][1]()
    assert len(seen) in (3, 4), 'at the table, to a side or both, and back'
    back = world.link_pose('wide_stereo_optical_frame')
    assert np.abs(back - eye).max() < 0.02
    world.close()
