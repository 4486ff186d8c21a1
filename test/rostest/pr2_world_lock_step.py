#!/usr/bin/env python3
"""The simulated PR2 in lock-step, as its users meet it: actions, topics, transforms, snapshots."""

import unittest
import xml.etree.ElementTree as ElementTree
from typing import Any, Dict, List

import actionlib
import numpy as np
import rospy
import tf2_ros
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from waiting import wait_for

from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    GripperCommandAction,
    GripperCommandGoal,
    PointHeadAction,
    PointHeadGoal,
    SingleJointPositionAction,
    SingleJointPositionGoal,
)
from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.msg import TrialCause
from smach_oracle.pr2.robot import ARM_JOINTS, RobotError
from smach_oracle.pr2.ros_robot import RosRobot
from smach_oracle.srv import Judge, PassTime, ResetWorld, Reveal, Snapshot

RIGHT = ARM_JOINTS['right']
LIMIT_S = 40.0


def call(name: str, kind: Any, *fields: Any) -> Any:
    rospy.wait_for_service(name, LIMIT_S)
    return rospy.ServiceProxy(name, kind)(*fields)


class Heard:
    """All messages of a topic."""

    def __init__(self, topic: str, kind: Any) -> None:
        self.messages: List[Any] = []
        self.subscriber = rospy.Subscriber(topic, kind, self.messages.append, queue_size=100)

    def stamped(self, stamp: rospy.Time) -> Any:
        return wait_for(
            lambda: next((each for each in self.messages if each.header.stamp == stamp), None),
            LIMIT_S,
        )


class Goal:
    """A goal that was sent, until it ends."""

    clients: Dict[str, Any] = {}

    def __init__(self, name: str, spec: Any, goal: Any) -> None:
        if name not in self.clients:
            self.clients[name] = actionlib.ActionClient(name, spec)
            assert wait_for(self.clients[name].wait_for_server, LIMIT_S)
        self.feedback: List[Any] = []
        self.handle = self.clients[name].send_goal(
            goal, feedback_cb=lambda _, feedback: self.feedback.append(feedback)
        )

    def status(self) -> int:
        assert wait_for(lambda: self.handle.get_comm_state() == actionlib.CommState.DONE, LIMIT_S)
        return self.handle.get_terminal_state()

    @property
    def text(self) -> str:
        return self.handle.get_goal_status_text()


def arm_goal(
    positions: List[List[float]], times: List[float], joints: Any = None
) -> FollowJointTrajectoryGoal:
    points = [
        JointTrajectoryPoint(positions=position, time_from_start=rospy.Duration(moment))
        for position, moment in zip(positions, times)
    ]
    return FollowJointTrajectoryGoal(
        trajectory=JointTrajectory(joint_names=RIGHT if joints is None else joints, points=points)
    )


def send_arm(goal: FollowJointTrajectoryGoal) -> Goal:
    return Goal('r_arm_controller/follow_joint_trajectory', FollowJointTrajectoryAction, goal)


class Pr2World(unittest.TestCase):
    """One world; each test begins with a reset."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.robot = RosRobot(timeout_s=LIMIT_S)

    def setUp(self) -> None:
        answer = call('world/reset', ResetWorld, 3)
        self.assertTrue(answer.ok, answer.message)

    def course(self, seed: int) -> List[bytes]:
        """What the robot feels and sees in the course of a few commands."""
        call('world/reset', ResetWorld, seed)
        felt = []

        def feel() -> None:
            felt.append(repr(sorted(self.robot.joints().items())).encode())

        feel()
        self.robot.look_at((0.8, 0.0, 0.7))
        image = self.robot.see()
        felt += [image.colour.tobytes(), image.depth.tobytes(), image.base_from_camera.tobytes()]
        self.robot.follow(RIGHT[:2], np.array([[-1.2, 0.3], [-1.0, 0.1]]), np.array([0.6, 1.2]))
        feel()
        self.robot.gripper('right', 0.03)
        self.robot.drive(from_rpy((-0.05, 0.02, 0.0), yaw=0.05))
        feel()
        felt += [self.robot.see().depth.tobytes(), self.robot.odom_from_base().tobytes()]
        return felt

    def test_the_same_seed_and_commands_give_the_same_world_to_the_bit(self) -> None:
        first = self.course(3)
        other = self.course(4)
        self.assertEqual([a == b for a, b in zip(first, self.course(3))], [True] * len(first))
        self.assertNotEqual(first, other)

    def test_the_controllers_take_the_robot_to_where_they_are_told(self) -> None:
        self.robot.torso(0.23)
        self.robot.follow(RIGHT[:1], np.array([[-1.3]]), np.array([0.6]))
        held = self.robot.gripper('left', 0.02)
        self.robot.drive(from_rpy((-0.1, 0.0, 0.0)))
        self.robot.look_at((0.9, 0.2, 0.7))
        joints = self.robot.joints()
        self.assertAlmostEqual(joints['torso_lift_joint'], 0.23, delta=0.01)
        self.assertAlmostEqual(joints[RIGHT[0]], -1.3, delta=0.011)
        self.assertTrue(held.reached and not held.stalled)
        self.assertAlmostEqual(held.position, 0.02, delta=0.003)
        self.assertAlmostEqual(self.robot.odom_from_base()[0, 3], -0.1, delta=0.02)
        axis = self.robot.see().base_from_camera
        way = np.array([0.9, 0.2, 0.7]) - axis[:3, 3]
        self.assertGreater(axis[:3, 2] @ way / np.linalg.norm(way), 0.9995)

    def test_the_robot_believes_to_stand_where_it_is_told(self) -> None:
        told = from_rpy((0.07, -0.04, 0.0), yaw=0.03)
        self.robot.localise(told)
        self.assertTrue(np.allclose(self.robot.odom_from_base(), told, atol=1e-6))
        self.robot.drive(from_rpy((0.0, 0.0, 0.0)))
        self.assertTrue(np.allclose(self.robot.odom_from_base(), np.eye(4), atol=0.02))

    def test_a_snapshot_is_of_one_moment_and_no_two_have_the_same(self) -> None:
        topics = [
            Heard(name, kind)
            for name, kind in (
                ('joint_states', JointState),
                ('head_camera/rgb/image_raw', Image),
                ('head_camera/rgb/camera_info', CameraInfo),
                ('head_camera/depth_registered/image_raw', Image),
                ('head_camera/depth_registered/points', PointCloud2),
            )
        ]
        self.assertTrue(
            wait_for(lambda: all(topic.subscriber.get_num_connections() for topic in topics))
        )
        first, second = (call('world/snapshot', Snapshot, camera) for camera in (False, True))
        self.assertTrue(first.ok and second.ok)
        self.assertLess(first.stamp, second.stamp)
        self.assertTrue(topics[0].stamped(first.stamp))
        state, colour, info, depth, cloud = (topic.stamped(second.stamp) for topic in topics)
        self.assertEqual(len(state.position), len(state.name))
        self.assertEqual((colour.encoding, depth.encoding), ('rgb8', '32FC1'))
        self.assertEqual((cloud.width, cloud.height), (info.width, info.height))
        self.assertEqual(len({each.header.frame_id for each in (colour, info, depth, cloud)}), 1)
        self.assertFalse([each for each in topics[1].messages if each.header.stamp != second.stamp])

    def test_who_comes_late_learns_how_the_robot_stands_though_nothing_moves(self) -> None:
        states, odometry = Heard('joint_states', JointState), Heard('base_odometry/odom', Odometry)
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        self.assertTrue(wait_for(lambda: states.messages and odometry.messages, LIMIT_S))
        self.assertTrue(
            wait_for(
                lambda: buffer.can_transform('odom_combined', 'r_gripper_tool_frame', rospy.Time()),
                LIMIT_S,
            )
        )
        place = odometry.messages[-1].pose.pose.position
        self.assertTrue(np.allclose((place.x, place.y), self.robot.odom_from_base()[:2, 3]))
        states.subscriber.unregister()
        odometry.subscriber.unregister()
        listener.unregister()

    def test_tf_takes_odometry_to_every_link_of_the_description(self) -> None:
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        links = [
            link.get('name')
            for link in ElementTree.fromstring(rospy.get_param('robot_description')).iter('link')
        ]
        self.assertGreater(len(links), 60)

        def missing() -> List[str]:
            stamp = call('world/snapshot', Snapshot, False).stamp
            return [
                link
                for link in links
                if not wait_for(
                    lambda link=link: buffer.can_transform('odom_combined', link, stamp), 0.5
                )
            ][:3]

        self.assertTrue(wait_for(lambda: not missing(), LIMIT_S), missing())
        listener.unregister()

    def test_while_nobody_commands_the_clock_goes_on_and_nothing_moves(self) -> None:
        def things() -> Any:
            bodies = call('world/reveal', Reveal, []).bodies
            return self.robot.joints(), [body.pose.pose for body in bodies]

        before, time = things(), rospy.get_time()
        self.assertTrue(wait_for(lambda: rospy.get_time() > time + 3.0, LIMIT_S))
        self.assertEqual(things(), before)

    def test_time_passes_for_who_asks_for_it_in_one_leap(self) -> None:
        before = call('world/snapshot', Snapshot, False).stamp
        stamp = call('world/pass_time', PassTime, 3600.0, 'thinking').stamp
        self.assertGreaterEqual((stamp - before).to_sec(), 3600.0)
        for seconds in (-1.0, float('nan'), float('inf'), 36001.0):
            with self.assertRaisesRegex(rospy.ServiceException, 'allowed: 0 to 36000'):
                call('world/pass_time', PassTime, seconds, 'thinking')

    def test_motions_go_on_while_time_passes(self) -> None:
        sent = send_arm(arm_goal([[-1.3]], [0.6], RIGHT[:1]))
        call('world/pass_time', PassTime, 10.0, 'thinking')
        self.assertEqual(sent.status(), GoalStatus.SUCCEEDED)
        self.assertAlmostEqual(self.robot.joints()[RIGHT[0]], -1.3, delta=0.011)

    def test_bad_goals_are_rejected_in_words(self) -> None:
        here = [0.0] * 7
        bad = [
            (arm_goal([here], [1.0], ['elbow'] + RIGHT[1:]), "unknown joint 'elbow'"),
            (arm_goal([], []), 'no points'),
            (arm_goal([[float('nan')] * 7], [1.0]), 'cannot be at nan'),
            (arm_goal([here[:3]], [1.0]), '3 positions'),
            (
                arm_goal(
                    [
                        [-1.6, 0.2, -1.5, -1.5, 0.5, -0.6, 0.0],
                        [0.5, 0.2, -1.5, -1.5, 0.5, -0.6, 0.0],
                    ],
                    [0.1, 0.2],
                ),
                'its limit is',
            ),
        ]
        for goal, words in bad:
            sent = send_arm(goal)
            self.assertEqual(sent.status(), GoalStatus.REJECTED)
            self.assertIn(words, sent.text)
            self.assertIn(words, sent.handle.get_result().error_string)
        others = [
            Goal('r_gripper_controller/gripper_action', GripperCommandAction, GripperCommandGoal()),
            Goal('head_traj_controller/point_head_action', PointHeadAction, PointHeadGoal()),
            Goal(
                'torso_controller/position_joint_action',
                SingleJointPositionAction,
                SingleJointPositionGoal(position=3.0),
            ),
            Goal(
                'move_base',
                MoveBaseAction,
                MoveBaseGoal(
                    PoseStamped(
                        Header(frame_id='map'), Pose(Point(), Quaternion(0.0, 0.0, 0.0, 1.0))
                    )
                ),
            ),
        ]
        self.assertEqual(
            [goal.status() for goal in others], [GoalStatus.SUCCEEDED] + [GoalStatus.REJECTED] * 3
        )
        self.assertIn('allowed: 0', others[2].text)
        self.assertIn("unknown frame 'map'", others[3].text)
        with self.assertRaisesRegex(RobotError, 'head: rejected: target'):
            self.robot.look_at((float('nan'), 0.0, 0.0))
        self.assertIn("no body 'cup'", call('world/reveal', Reveal, ['cup']).message)

    def moving(self) -> Goal:
        """A long motion of the right arm that has begun."""
        sent = send_arm(arm_goal([[-0.6, 0.2, -1.5, -1.5, 0.5, -0.6, 0.0]], [60.0]))
        self.assertTrue(wait_for(lambda: sent.feedback, LIMIT_S))
        return sent

    def test_a_preempted_motion_stops_where_it_is(self) -> None:
        sent = self.moving()
        sent.handle.cancel()
        self.assertEqual(sent.status(), GoalStatus.PREEMPTED)
        rest = self.robot.joints()[RIGHT[0]]
        self.assertTrue(-1.6 < rest < -0.61, rest)
        self.robot.look_at((0.8, 0.0, 0.7))
        self.assertAlmostEqual(self.robot.joints()[RIGHT[0]], rest, delta=0.02)

    def test_of_two_who_command_an_arm_the_newer_wins(self) -> None:
        older = self.moving()
        newer = send_arm(arm_goal([[-1.55]], [0.5], RIGHT[:1]))
        self.assertEqual(
            (older.status(), newer.status()), (GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED)
        )
        self.assertIn('newer', older.text)
        self.assertEqual(
            newer.handle.get_result().error_code, FollowJointTrajectoryResult.SUCCESSFUL
        )

    def test_a_reset_aborts_what_moves_and_tells_the_cause(self) -> None:
        sent = self.moving()
        self.assertTrue(call('world/reset', ResetWorld, 5).ok)
        self.assertEqual((sent.status(), sent.text), (GoalStatus.ABORTED, 'the world was reset'))
        cause = rospy.wait_for_message('world/cause', TrialCause, LIMIT_S)
        self.assertEqual((cause.seed, cause.task, list(cause.kinds)), (5, 'pick_and_place', []))
        verdict = call('world/judge', Judge)
        self.assertTrue(verdict.ok and not verdict.success and verdict.why)

    def test_a_stream_of_targets_is_answered_target_by_target(self) -> None:
        states = Heard('joint_states', JointState)
        stream = rospy.Publisher('r_arm_controller/command', JointTrajectory, queue_size=1)
        self.assertTrue(
            wait_for(
                lambda: stream.get_num_connections() and states.subscriber.get_num_connections()
            )
        )
        position = self.robot.joints()[RIGHT[0]]
        for _ in range(5):
            position += 0.01
            said = len(states.messages)
            stream.publish(
                JointTrajectory(
                    joint_names=RIGHT[:1],
                    points=[
                        JointTrajectoryPoint(
                            positions=[position], time_from_start=rospy.Duration(2 / 60)
                        )
                    ],
                )
            )
            self.assertTrue(wait_for(lambda before=said: len(states.messages) > before, LIMIT_S))
            self.assertEqual(len(states.messages), said + 1)
            found = dict(zip(states.messages[-1].name, states.messages[-1].position))
            self.assertAlmostEqual(found[RIGHT[0]], position, delta=0.005)

    def test_a_robot_that_was_told_to_stop_takes_no_calls_until_it_may(self) -> None:
        self.robot.abort()
        for what in (self.robot.joints, self.robot.see, lambda: self.robot.torso(0.2)):
            with self.assertRaisesRegex(RobotError, 'told to stop'):
                what()
        self.robot.resume()
        self.robot.joints()


if __name__ == '__main__':
    import rostest

    rospy.init_node('pr2_world_lock_step')
    rostest.rosrun('smach_oracle', 'pr2_world_lock_step', Pr2World)
