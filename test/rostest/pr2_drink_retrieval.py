#!/usr/bin/env python3
"""The second use case on the simulated PR2, over its nodes: the script as it is, and its structure under an oracle."""
import unittest
from pathlib import Path

import rospkg
import rospy
import rostest
import smach
import yaml

from smach_oracle import OracleContainer
from smach_oracle.srv import Judge, ResetWorld
from smach_oracle.tasks import drink_retrieval

STATES = ['RAISE_TORSO', 'OPEN_FRIDGE', 'MOVE_IN', 'DETECT_DRINK', 'PICK_DRINK', 'MOVE_OUT', 'CLOSE_FRIDGE',
          'MOVE_HOME', 'HAND_OVER']
SETTINGS = Path(rospkg.RosPack().get_path('smach_oracle')) / 'src' / 'smach_oracle' / 'tasks' / 'drink_retrieval.yaml'


class DrinkRetrievalTest(unittest.TestCase):

    def test_1_the_script_goes_through_the_papers_states_in_order(self):
        machine = drink_retrieval.make_machine()
        label, passed = machine.get_initial_states()[0], []
        while label in machine.get_children():
            passed.append(label)
            label = next(edge[2] for edge in machine.get_internal_edges()
                         if edge[0] == 'succeeded' and edge[1] == label)
        self.assertEqual((passed, label), (STATES, None))  # None: the machine's own outcome

    def test_2_every_setting_of_its_oracle_is_about_a_state_that_it_has(self):
        settings = yaml.safe_load(SETTINGS.read_text())
        self.assertLessEqual(set(settings['states']), set(STATES))
        oracle = OracleContainer.wrap(drink_retrieval.make_machine(), preconditions={
            state: values['preconditions'] for state, values in settings['states'].items()})
        self.assertLessEqual(set(STATES), set(oracle.get_children()))

    def test_3_the_drink_is_truly_in_the_hand_in_the_end(self):
        rospy.wait_for_service('world/reset', 60.0)
        self.assertTrue(rospy.ServiceProxy('world/reset', ResetWorld)(seed=3).ok)
        machine = drink_retrieval.make_machine()
        machine.userdata = smach.UserData()
        self.assertEqual(machine.execute(), 'succeeded')
        verdict = rospy.ServiceProxy('world/judge', Judge)()
        self.assertTrue(verdict.success, verdict.why)


if __name__ == '__main__':
    rospy.init_node('pr2_drink_retrieval_test')
    rostest.rosrun('smach_oracle', 'pr2_drink_retrieval', DrinkRetrievalTest)
