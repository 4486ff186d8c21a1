#!/usr/bin/env python3
"""The simulated PR2's eyes over ROS, and an expert's in their place, against where things truly
are.
"""

import unittest
from typing import Any

import actionlib
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from waiting import wait_for

from smach_oracle.msg import (
    DetectDrinkAction,
    DetectDrinkGoal,
    DetectTabletopAction,
    DetectTabletopGoal,
    SharedAutonomyAction,
    SharedAutonomyGoal,
)
from smach_oracle.pr2.ros_robot import RosRobot
from smach_oracle.ros.userdata_codec import decode_all
from smach_oracle.srv import (
    FinishInterface,
    ResetWorld,
    Reveal,
    SegmentObject,
    SegmentObjectRequest,
)

LIMIT_S = 60.0
NEAR_M = 0.02  # what the camera measures, and what it is off on its mounting


def call(name: str, kind: Any, *fields: Any, **named: Any) -> Any:
    rospy.wait_for_service(name, LIMIT_S)
    return rospy.ServiceProxy(name, kind)(*fields, **named)


def place(pose: Any) -> np.ndarray:
    return np.array([pose.pose.position.x, pose.pose.position.y, pose.pose.position.z])


class Eyes(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.robot = RosRobot()

    def setUp(self) -> None:
        self.assertTrue(call('world/reset', ResetWorld, 4).ok)
        self.robot.look_at((0.75, 0.0, 0.75))
        self.things = [body for body in call('world/reveal', Reveal, []).bodies if body.movable]
        self.assertTrue(self.things)

    def ended(self, name: str, spec: Any, goal: Any) -> Any:
        client = actionlib.ActionClient(name, spec)
        self.assertTrue(wait_for(client.wait_for_server, LIMIT_S))
        handle = client.send_goal(goal)
        self.assertTrue(
            wait_for(lambda: handle.get_comm_state() == actionlib.CommState.DONE, LIMIT_S)
        )
        return handle

    def off_by(self, pose: Any) -> float:
        """m to the nearest thing, truly."""
        self.assertEqual(pose.header.frame_id, 'base_footprint')
        return min(float(np.linalg.norm(place(pose) - place(body.pose))) for body in self.things)

    def test_the_table_s_objects_are_where_they_are(self) -> None:
        handle = self.ended(
            'detect_tabletop', DetectTabletopAction, DetectTabletopGoal(min_height=0.02)
        )
        result = handle.get_result()
        self.assertEqual(handle.get_goal_status(), GoalStatus.SUCCEEDED, result.reason)
        self.assertEqual(len(result.objects), len(result.sizes))
        for pose in result.objects:
            self.assertLess(self.off_by(pose), NEAR_M)
        distances = [float(np.hypot(*place(pose)[:2])) for pose in result.objects]
        self.assertEqual(distances, sorted(distances))

    def test_a_height_that_is_none_aborts_with_what_is_allowed(self) -> None:
        for height in (float('nan'), -1.0, 7.0):
            handle = self.ended(
                'detect_tabletop', DetectTabletopAction, DetectTabletopGoal(min_height=height)
            )
            self.assertEqual(handle.get_goal_status(), GoalStatus.ABORTED)
            self.assertIn('allowed: 0 to 0.3', handle.get_result().reason)

    def test_an_empty_scene_aborts_and_says_what_is_missing(self) -> None:
        for target, height, words in (
            ((0.75, 0.0, 0.75), 0.3, 'there is nothing on the table that stands higher than'),
            ((0.5, -1.5, 1.6), 0.02, 'no table in view'),
        ):
            self.robot.look_at(target)
            handle = self.ended(
                'detect_tabletop', DetectTabletopAction, DetectTabletopGoal(min_height=height)
            )
            self.assertEqual(handle.get_goal_status(), GoalStatus.ABORTED)
            self.assertIn(words, handle.get_result().reason)
            self.assertEqual(handle.get_goal_status_text(), handle.get_result().reason)
            self.assertEqual(handle.get_result().objects, [])

    def test_there_is_no_refrigerator_here(self) -> None:
        handle = self.ended('detect_drink', DetectDrinkAction, DetectDrinkGoal())
        self.assertEqual(handle.get_goal_status(), GoalStatus.ABORTED)
        self.assertIn('shelf', handle.get_result().reason)

    def test_an_expert_marks_what_the_detection_would_have_found(self) -> None:
        client = actionlib.ActionClient('perception_interface', SharedAutonomyAction)
        self.assertTrue(wait_for(client.wait_for_server, LIMIT_S))
        handle = client.send_goal(
            SharedAutonomyGoal(
                query_id='q',
                state='DETECT_TABLETOP',
                outcomes=['succeeded', 'aborted'],
                output_keys=['table', 'objects', 'sizes'],
            )
        )
        self.assertTrue(wait_for(lambda: handle.get_goal_status() == GoalStatus.ACTIVE, LIMIT_S))
        seen = max(self.things, key=lambda body: body.region.width * body.region.height)
        answer = call(
            'perception_interface/segment', SegmentObject, SegmentObjectRequest(region=seen.region)
        )
        self.assertTrue(answer.ok, answer.message)
        self.assertLess(float(np.linalg.norm(place(answer.object) - place(seen.pose))), 2 * NEAR_M)
        self.assertTrue(
            call('perception_interface/finish', FinishInterface, 'succeeded', [], '', '').ok
        )
        self.assertTrue(
            wait_for(lambda: handle.get_comm_state() == actionlib.CommState.DONE, LIMIT_S)
        )
        outputs = decode_all(handle.get_result().outputs)
        self.assertEqual(sorted(outputs), ['objects', 'sizes', 'table'])
        self.assertLess(
            float(np.linalg.norm(place(outputs['objects'][0]) - place(seen.pose))), 2 * NEAR_M
        )


if __name__ == '__main__':
    import rostest

    rospy.init_node('pr2_perception_test')
    rostest.rosrun('smach_oracle', 'pr2_perception', Eyes)
