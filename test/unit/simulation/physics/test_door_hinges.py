"""A door that falls shut: from where it is left, unless that is past its stop."""

import numpy as np
import pytest

from smach_oracle.pr2.kitchen import Kitchen
from smach_oracle.simulation.physics.bodies import SceneBuildError
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT, fridge
from smach_oracle.simulation.scenes.scene import ClosingHinge, Disturbance, Goal, Scene

HINGE = ClosingHinge(5.0, np.radians(70.0))


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def kitchen(degrees, hinge, *disturbances):
    body = fridge(Kitchen(), hinge)._replace(joints=((DOOR_JOINT, np.radians(degrees)),))
    return Scene('test', 1, (body,), Goal('stands_at', ''), disturbances=disturbances)


def degrees_after(world, seconds):
    world.step(round(60 * seconds))
    return np.degrees(world.body_joint('fridge', DOOR_JOINT))


def test_a_door_before_its_stop_falls_shut_and_past_it_stays(world):
    world.reset(kitchen(65.0, HINGE))
    assert 20.0 < degrees_after(world, 1.0) < 60.0
    assert degrees_after(world, 4.0) == pytest.approx(0.0, abs=1.0)
    world.reset(kitchen(75.0, HINGE))
    assert degrees_after(world, 5.0) == pytest.approx(75.0, abs=1.0)


def test_a_usual_door_stays_where_it_is_left(world):
    world.reset(kitchen(30.0, None))
    assert degrees_after(world, 5.0) == pytest.approx(30.0, abs=1.0)


def test_who_pushes_it_past_its_stop_can_let_go_of_it(world):
    for goal, rest in ((50.0, 0.0), (85.0, 85.0)):
        swing = Disturbance('swing:fridge', 'torso', (('angle', np.radians(goal)),))
        world.reset(kitchen(0.0, HINGE, swing))
        world.happened('torso')
        world.step(90)
        assert np.degrees(world.body_joint('fridge', DOOR_JOINT)) == pytest.approx(goal, abs=3.0)
        assert degrees_after(world, 5.0) == pytest.approx(rest, abs=3.0)


def test_a_hinge_that_cannot_be_is_refused(world):
    with pytest.raises(SceneBuildError, match="joint 'door_hinge' closes with"):
        world.reset(kitchen(0.0, HINGE._replace(torque=-1.0)))
    body = kitchen(0.0, HINGE).bodies[0]._replace(joint_closing=(('lid', HINGE),))
    with pytest.raises(SceneBuildError, match="no joint 'lid'"):
        world.reset(kitchen(0.0, None)._replace(bodies=(body,)))
