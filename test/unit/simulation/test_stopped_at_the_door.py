"""Goals at the refrigerator's door that are sent again, after the robot was told to stop."""

import numpy as np
import pytest
from kitchen_trial import in_kitchen
from support.stopped_robot import stopped_after

from smach_oracle.pr2.planning.arm import SkillError
from smach_oracle.pr2.robot import RobotError
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT


@pytest.mark.parametrize(
    'motions, degrees, gap',
    [
        (6, (-0.1, 5), (0.02, 0.03)),
        (8, (60, 80), (0.02, 0.03)),
        (14, (88, 100), (0.02, 0.03)),
        (16, (88, 100), (0.04, 0.05)),
    ],
)
def test_a_hand_that_was_stopped_at_the_handle_opens_the_door(motions, degrees, gap):
    """It has closed on the bar, pulled with the arm, with the base, and has come off it."""

    def stopped_and_ended(world, trial):
        do = trial.robot._do
        stopped_after(trial.robot, motions, for_good=True)
        with pytest.raises((SkillError, RobotError), match='told to stop'):
            trial.states[2][1]()
        trial.robot._do = do
        assert degrees[0] <= np.degrees(world.body_joint('fridge', DOOR_JOINT)) <= degrees[1]
        assert gap[0] < world.gap('right') < gap[1]
        for _, work in trial.states[1:5]:
            work()
        assert world.body_joint('fridge', DOOR_JOINT) > np.radians(80.0)

    in_kitchen(3, 2, stopped_and_ended)


def test_the_closed_door_is_opened_by_contact_alone_and_the_base_stands_clear_of_it():
    def stands_clear(world, trial):
        assert world.body_joint('fridge', DOOR_JOINT) > np.radians(85.0)
        assert not [contact for contact in world.contacts('fridge') if contact.other == 'robot']

    in_kitchen(3, 3, stands_clear)
