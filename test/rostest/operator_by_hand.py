#!/usr/bin/env python3
"""The scripted operator does three states' work in the simulated world, with the means that people
have.
"""

import os
import sys
import threading
import unittest

import actionlib
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from std_msgs.msg import Header

from control_msgs.msg import PointHeadAction, PointHeadGoal

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from expert_fixtures import Asked, make_question

from smach_oracle.oracle.asking.question import AnswerKind, InterfaceOffer, OutcomeChoice
from smach_oracle.ros.expert.client import ExpertQueryClient
from smach_oracle.srv import Judge, ResetWorld, Reveal

OFFERS = (
    InterfaceOffer('perception', '/perception_interface'),
    InterfaceOffer('manipulation', '/manipulation_interface'),
)
GOAL = (0.60, -0.35)


class ByHand(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.wait_for_service('world/reset', 60.0)
        cls.client = ExpertQueryClient(server_wait_s=30.0)

    def look_at_the_table(self):
        head = actionlib.SimpleActionClient(
            'head_traj_controller/point_head_action', PointHeadAction
        )
        # of a clock that runs ahead while nothing moves
        self.assertTrue(head.wait_for_server(rospy.Duration(600)))
        goal = PointHeadGoal(
            target=PointStamped(Header(frame_id='base_link'), Point(0.65, 0.0, 0.75)),
            pointing_axis=Vector3(0, 0, 1),
            pointing_frame='wide_stereo_optical_frame',
        )
        head.send_goal_and_wait(goal)
        self.assertEqual(head.get_state(), GoalStatus.SUCCEEDED, head.get_goal_status_text())

    def superseded(self, state, outputs, userdata):
        """Ask about a state, run what the operator chose, and return the outputs."""
        question = make_question(
            'q-' + state,
            failed_state=state,
            interfaces=OFFERS,
            output_keys=tuple(outputs),
            userdata=userdata,
            input_userdata=userdata,
            supersede_outcomes=(OutcomeChoice('succeeded', 'NEXT'),),
        )
        asked = Asked(self.client, question)
        self.assertTrue(asked.wait(60.0), 'nobody answered')
        self.assertEqual(asked.answer.kind, AnswerKind.INTERFACE, asked.answer)
        offer = next(each for each in OFFERS if each.name == asked.answer.interface)
        answer = self.client.run_interface(offer, question, threading.Event(), lambda *_: None)
        self.assertIsNotNone(answer, 'it did not work by hand')
        self.assertEqual(answer.outcome, 'succeeded')
        return answer.outputs or {}

    def test_a_thing_is_shown_taken_and_put_down(self):
        self.assertTrue(rospy.ServiceProxy('world/reset', ResetWorld)(4).ok)
        self.look_at_the_table()
        reveal = rospy.ServiceProxy('world/reveal', Reveal)
        thing = reveal(['object_0']).bodies[0]
        outputs = self.superseded('DETECT_TABLETOP', ('table', 'objects', 'sizes'), {})
        self.assertEqual(sorted(outputs), ['objects', 'sizes', 'table'])
        shown, truth = outputs['objects'][0].pose.position, thing.pose.pose.position
        self.assertLess(np.hypot(shown.x - truth.x, shown.y - truth.y), 0.03)

        grasp = self.superseded(
            'PICK',
            ('grasp',),
            {'objects': outputs['objects'], 'sizes': outputs['sizes'], 'map_id': ''},
        )['grasp']
        at = grasp.pose.position
        self.assertLess(
            np.linalg.norm([at.x - truth.x, at.y - truth.y]),
            0.04,
            'the grasp was where the thing stood',
        )
        self.assertEqual(reveal(['object_0']).bodies[0].held, 'right')

        place = PoseStamped(
            Header(frame_id='base_link'), Pose(Point(GOAL[0], GOAL[1], 0.8), Quaternion(0, 0, 0, 1))
        )
        self.superseded('PLACE', (), {'place_pose': place, 'grasp': grasp, 'map_id': ''})
        verdict = rospy.ServiceProxy('world/judge', Judge)()
        self.assertTrue(verdict.success, verdict.why)


if __name__ == '__main__':
    import rostest

    rospy.init_node('operator_by_hand')
    rostest.rosrun('smach_oracle', 'operator_by_hand', ByHand)
