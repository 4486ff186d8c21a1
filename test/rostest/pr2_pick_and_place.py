#!/usr/bin/env python3
"""The first use case on the simulated PR2, over its nodes: as the task does it, and with goals that
cannot be.
"""

import math
import threading
import unittest

import actionlib
import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

import smach
from smach_oracle.msg import (
    CollisionBoxes,
    MoveArmsAsideAction,
    MoveArmsAsideGoal,
    PickAction,
    PickGoal,
    PlaceAction,
    PlaceGoal,
    PointHeadAction,
    PointHeadGoal,
)
from smach_oracle.srv import Judge, ResetWorld
from smach_oracle.tasks import pick_and_place

LIMIT = rospy.Duration(900.0)  # of ROS time, which runs fast while nothing moves
BASE = 'base_footprint'
SIZE = Vector3(0.06, 0.06, 0.12)


def pose(x, y, z, frame=BASE):
    return PoseStamped(Header(frame_id=frame), Pose(Point(x, y, z), Quaternion(0.0, 0.0, 0.0, 1.0)))


def picking(target, map_id=''):
    return PickGoal(arm='right', object=target, size=SIZE, map_id=map_id)


def placing(place, grasp, arm='right'):
    return PlaceGoal(arm=arm, pose=place, grasp=grasp)


class PickAndPlaceTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.wait_for_service('world/reset', 60.0)
        cls.reset = rospy.ServiceProxy('world/reset', ResetWorld)
        cls.judge = rospy.ServiceProxy('world/judge', Judge)

    def sent(self, name, spec, goal, **callbacks):
        """A client with its goal under way."""
        client = actionlib.SimpleActionClient(name, spec)
        self.assertTrue(client.wait_for_server(LIMIT), name)
        client.send_goal(goal, **callbacks)
        return client

    def ended(self, client):
        """How it ended: (status, result); the reason is what the status says, too, for those who
        see that alone.
        """
        self.assertTrue(client.wait_for_result(LIMIT), client.action_client.ns)
        if client.get_state() == GoalStatus.ABORTED:
            self.assertEqual(client.get_goal_status_text(), client.get_result().reason)
        return client.get_state(), client.get_result()

    def test_1_bad_goals_are_aborted_and_say_why(self):
        self.assertTrue(self.reset(seed=3).ok)
        good = pose(0.6, -0.1, 0.78)
        for name, spec, goal, text in [
            (
                'move_arms_aside',
                MoveArmsAsideAction,
                MoveArmsAsideGoal(['third']),
                "unknown arm 'third'",
            ),
            (
                'point_head',
                PointHeadAction,
                PointHeadGoal(PointStamped(Header(frame_id='moon'), Point(1, 0, 1))),
                "frame 'moon'; allowed",
            ),
            ('pick', PickAction, picking(pose(math.nan, 0, 0)), 'not finite'),
            ('pick', PickAction, picking(good, 'map of the moon'), 'no collision map'),
            ('pick', PickAction, picking(pose(2.5, 0.0, 0.8)), 'out of reach'),
            ('place', PlaceAction, placing(good, good), 'there is nothing to stand on'),
            ('place', PlaceAction, placing(pose(math.inf, 0, 0), good), 'pose: '),
            ('place', PlaceAction, placing(good, good, 'up'), "unknown arm 'up'"),
        ]:
            status, result = self.ended(self.sent(name, spec, goal))
            self.assertEqual((name, status), (name, GoalStatus.ABORTED))
            self.assertIn(text, result.reason)

    def test_2_what_is_cancelled_stops_and_what_comes_next_is_done(self):
        self.assertTrue(self.reset(seed=3).ok)
        begun = threading.Event()
        client = self.sent(
            'pick',
            PickAction,
            picking(pose(0.6, -0.1, 0.78)),
            feedback_cb=lambda feedback: begun.set(),
        )
        self.assertTrue(begun.wait(60.0))
        client.cancel_goal()
        status, result = self.ended(client)
        self.assertEqual(status, GoalStatus.PREEMPTED)
        self.assertTrue(result.reason)
        aside = self.sent('move_arms_aside', MoveArmsAsideAction, MoveArmsAsideGoal())
        self.assertEqual(self.ended(aside)[0], GoalStatus.SUCCEEDED)

    def test_3_the_task_succeeds_and_the_object_truly_stands_there(self):
        for seed in (4, 9):
            self.assertTrue(self.reset(seed=seed).ok)
            machine = pick_and_place.make_machine()
            machine.userdata = smach.UserData()
            machine.userdata.place_pose = pick_and_place.place_pose()
            self.assertEqual(machine.execute(), 'succeeded', seed)
            verdict = self.judge()
            self.assertTrue(verdict.success, verdict.why)

    def test_4_what_was_planned_in_is_shown_to_those_who_come_late_and_to_rviz(self):
        boxes = rospy.wait_for_message('collision_map', CollisionBoxes, 60.0)
        gone, *cubes = rospy.wait_for_message('collision_map_markers', MarkerArray, 60.0).markers
        self.assertEqual(gone.action, Marker.DELETEALL)
        self.assertIn('table', boxes.names)
        self.assertEqual(
            [(cube.text, cube.pose, cube.scale, cube.header.frame_id) for cube in cubes],
            [
                (name, where, size, 'base_footprint')
                for name, where, size in zip(boxes.names, boxes.poses, boxes.sizes)
            ],
        )
        self.assertEqual(
            {(cube.type, cube.action, cube.ns) for cube in cubes},
            {(Marker.CUBE, Marker.ADD, 'collision_map')},
        )
        self.assertEqual(len({cube.id for cube in cubes}), len(cubes))


if __name__ == '__main__':
    rospy.init_node('pr2_pick_and_place_test')
    rostest.rosrun('smach_oracle', 'pr2_pick_and_place', PickAndPlaceTest)
