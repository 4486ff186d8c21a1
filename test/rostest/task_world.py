#!/usr/bin/env python3
"""The world of the pick and place task, seen through its actions."""
import unittest

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus

from smach_oracle.msg import (DetectTabletopAction, DetectTabletopGoal, MoveArmsAsideAction, MoveArmsAsideGoal,
                              PlaceAction, PlaceGoal, SharedAutonomyAction, SharedAutonomyGoal, TrialCause)
from smach_oracle.ros.userdata_codec import decode_all
from smach_oracle.srv import ResetWorld

LIMIT = rospy.Duration(10.0)


class TaskWorld(unittest.TestCase):
    """Each trial begins with a reset to a seed without faults."""

    def setUp(self) -> None:
        rospy.wait_for_service('world/reset', 10.0)
        self.assertTrue(rospy.ServiceProxy('world/reset', ResetWorld)(seed=3).ok)

    def run_goal(self, name: str, spec: type, goal: object) -> actionlib.SimpleActionClient:
        client = actionlib.SimpleActionClient(name, spec)
        self.assertTrue(client.wait_for_server(LIMIT))
        client.send_goal(goal)
        self.assertTrue(client.wait_for_result(LIMIT))
        return client

    def test_a_detection_gives_as_many_sizes_as_objects(self) -> None:
        client = self.run_goal('detect_tabletop', DetectTabletopAction, DetectTabletopGoal())
        self.assertEqual(client.get_state(), GoalStatus.SUCCEEDED)
        self.assertEqual(len(client.get_result().objects), len(client.get_result().sizes))
        self.assertGreater(len(client.get_result().objects), 0)

    def test_an_unknown_arm_is_refused_with_the_arms_there_are(self) -> None:
        client = self.run_goal('move_arms_aside', MoveArmsAsideAction, MoveArmsAsideGoal(arms=['middle']))
        self.assertEqual(client.get_state(), GoalStatus.ABORTED)
        self.assertIn("unknown arm 'middle'; allowed: left, right", client.get_result().reason)
        self.assertEqual(client.get_goal_status_text(), client.get_result().reason)

    def test_nothing_is_placed_until_something_was_picked_be_it_by_an_experts_hand(self) -> None:
        client = self.run_goal('place', PlaceAction, PlaceGoal(arm='right'))
        self.assertEqual(client.get_result().reason, 'nothing in the gripper')
        hand = self.run_goal('world/assist', SharedAutonomyAction,
                             SharedAutonomyGoal(state='PICK', output_keys=['grasp', 'nonsense']))
        self.assertEqual(hand.get_result().outcome, 'succeeded')
        self.assertEqual(list(decode_all(hand.get_result().outputs)), ['grasp'])
        client = self.run_goal('place', PlaceAction, PlaceGoal(arm='right'))
        self.assertEqual(client.get_state(), GoalStatus.SUCCEEDED)

    def test_the_hand_refuses_work_that_is_not_there(self) -> None:
        hand = self.run_goal('world/assist', SharedAutonomyAction, SharedAutonomyGoal(state='DANCE'))
        self.assertEqual(hand.get_state(), GoalStatus.ABORTED)
        self.assertIn("'DANCE'", hand.get_result().text)

    def test_the_hidden_cause_is_told_for_the_record(self) -> None:
        cause = rospy.wait_for_message('world/cause', TrialCause, 10.0)
        self.assertEqual((cause.seed, cause.kinds), (3, []))


if __name__ == '__main__':
    import rostest
    rospy.init_node('task_world')
    rostest.rosrun('smach_oracle', 'task_world', TaskWorld)
