"""Goals at the refrigerator's door that are sent again, after the robot was told to stop."""

import numpy as np
import pytest
from kitchen_trial import in_kitchen, stopped_in_kitchen

from smach_oracle.simulation.scenes.fridge import DOOR_JOINT

# degrees that the door stands open where the robot is stopped after so many motions, and m that
# the hand does. It has closed on the bar, pulled with the arm, with the base, and has come off it
STOPS = {
    6: ((-0.1, 5), (0.02, 0.03)),
    8: ((60, 80), (0.02, 0.03)),
    14: ((88, 100), (0.02, 0.03)),
    16: ((88, 100), (0.04, 0.05)),
}


@pytest.fixture(name='stopped', scope='module')
def _stopped():
    def opened(world, trial):
        angle, gap = world.body_joint('fridge', DOOR_JOINT), world.gap('right')
        for _, work in trial.states[1:5]:
            work()
        return angle, gap, world.body_joint('fridge', DOOR_JOINT)

    return stopped_in_kitchen(3, 2, STOPS, opened)


@pytest.mark.parametrize('motions', STOPS)
def test_a_hand_that_was_stopped_at_the_handle_opens_the_door(stopped, motions):
    degrees, gaps = STOPS[motions]
    angle, gap, opened = stopped[motions].answer()
    assert degrees[0] <= np.degrees(angle) <= degrees[1]
    assert gaps[0] < gap < gaps[1]
    assert opened > np.radians(80.0)


def test_the_closed_door_is_opened_by_contact_alone_and_the_base_stands_clear_of_it():
    def stands_clear(world, trial):
        assert world.body_joint('fridge', DOOR_JOINT) > np.radians(85.0)
        assert not [contact for contact in world.contacts('fridge') if contact.other == 'robot']

    in_kitchen(3, 3, stands_clear)
