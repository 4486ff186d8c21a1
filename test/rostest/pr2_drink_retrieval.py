#!/usr/bin/env python3
"""The second use case on the simulated PR2, over its nodes: the script as it is, and under an
oracle; bad goals.
"""

import math
import subprocess
import tempfile
import unittest
from pathlib import Path

import actionlib
import rospkg
import rospy
import rostest
import yaml
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from roslib.packages import find_node
from std_msgs.msg import Header

import smach
from control_msgs.msg import SingleJointPositionAction, SingleJointPositionGoal
from smach_oracle import OracleContainer
from smach_oracle.analysis.trials import load_trials
from smach_oracle.msg import (
    CloseDoorAction,
    CloseDoorGoal,
    DetectDrinkAction,
    DetectDrinkGoal,
    HandOverAction,
    HandOverGoal,
    OpenDoorAction,
    OpenDoorGoal,
)
from smach_oracle.simulation.scenes.kitchen_scene import draw
from smach_oracle.srv import Judge, ResetWorld
from smach_oracle.tasks import drink_retrieval

STATES = [
    'RAISE_TORSO',
    'LOCALISE',
    'OPEN_FRIDGE',
    'MOVE_IN',
    'DETECT_DRINK',
    'PICK_DRINK',
    'MOVE_OUT',
    'CLOSE_FRIDGE',
    'MOVE_HOME',
    'HAND_OVER',
]
TASKS = Path(rospkg.RosPack().get_path('smach_oracle')) / 'src' / 'smach_oracle' / 'tasks'
SETTINGS = TASKS / 'drink_retrieval.yaml'
PEACEFUL = (0, 2, 9)  # the first seeds without a cause
LIMIT = rospy.Duration(900.0)  # of ROS time, which runs fast while nothing moves
NOWHERE = PoseStamped(
    Header(frame_id='odom_combined'), Pose(Point(math.nan, 0, 0), Quaternion(0, 0, 0, 1))
)


def seed_with(kind):
    """The first seed of which this is the only cause to fail."""
    return next(
        seed for seed in range(10000) if [cause.kind for cause in draw(seed).causes] == [kind]
    )


class DrinkRetrievalTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.wait_for_service('world/reset', 60.0)
        cls.reset = rospy.ServiceProxy('world/reset', ResetWorld)

    def assert_true_success(self):
        verdict = rospy.ServiceProxy('world/judge', Judge)()
        self.assertTrue(verdict.success, verdict.why)

    def test_1_the_script_goes_through_the_papers_states_in_order(self):
        machine = drink_retrieval.make_machine()
        label, passed = machine.get_initial_states()[0], []
        while label in machine.get_children():
            passed.append(label)
            label = next(
                edge[2]
                for edge in machine.get_internal_edges()
                if edge[0] == 'succeeded' and edge[1] == label
            )
        self.assertEqual((passed, label), (STATES, None))  # None: the machine's own outcome

    def test_2_every_setting_of_its_oracle_is_about_a_state_that_it_has(self):
        settings = yaml.safe_load(SETTINGS.read_text())
        self.assertLessEqual(set(settings['states']), set(STATES))
        oracle = OracleContainer.wrap(
            drink_retrieval.make_machine(),
            preconditions={
                state: values['preconditions'] for state, values in settings['states'].items()
            },
        )
        self.assertLessEqual(set(STATES), set(oracle.get_children()))

    def test_3_bad_goals_end_with_the_reason(self):
        self.assertTrue(self.reset(seed=PEACEFUL[0]).ok)
        for name, spec, goal, status, text in [
            (
                'open_door',
                OpenDoorAction,
                OpenDoorGoal('third'),
                GoalStatus.ABORTED,
                "unknown arm 'third'",
            ),
            (
                'close_door',
                CloseDoorAction,
                CloseDoorGoal(''),
                GoalStatus.ABORTED,
                "unknown arm ''",
            ),
            (
                'hand_over',
                HandOverAction,
                HandOverGoal('right', NOWHERE),
                GoalStatus.ABORTED,
                'not finite',
            ),
            (
                'detect_drink',
                DetectDrinkAction,
                DetectDrinkGoal(min_height=math.nan),
                GoalStatus.ABORTED,
                'min_height is nan',
            ),
            (
                'detect_drink',
                DetectDrinkAction,
                DetectDrinkGoal(min_height=0.05),
                GoalStatus.ABORTED,
                'the door hides',
            ),
            ('move_base', MoveBaseAction, MoveBaseGoal(NOWHERE), GoalStatus.REJECTED, 'finite'),
            (
                'torso_controller/position_joint_action',
                SingleJointPositionAction,
                SingleJointPositionGoal(position=math.nan),
                GoalStatus.REJECTED,
                'nan',
            ),
        ]:
            client = actionlib.SimpleActionClient(name, spec)
            self.assertTrue(client.wait_for_server(LIMIT), name)
            client.send_goal(goal)
            self.assertTrue(client.wait_for_result(LIMIT), name)
            self.assertEqual((name, client.get_state()), (name, status))
            self.assertIn(text, client.get_goal_status_text())
            if status == GoalStatus.ABORTED:
                self.assertEqual(client.get_goal_status_text(), client.get_result().reason)

    def test_4_the_drink_is_truly_in_the_hand_in_the_end(self):
        """A calm trial can fail too, in 1 of 111. Contacts differ in the last digits from one
        kind of processor to the next, and so do the seeds that fail. So two of three are asked.
        The third is tried only where one of the others has failed.
        """
        reached = 0
        for seed in PEACEFUL:
            if reached == 2:
                break
            self.assertEqual(draw(seed).causes, ())
            self.assertTrue(self.reset(seed=seed).ok)
            machine = drink_retrieval.make_machine()
            machine.userdata = smach.UserData()
            if machine.execute() == 'succeeded':
                self.assert_true_success()
                reached += 1
        self.assertEqual(reached, 2)

    def test_5_with_the_oracle_a_drink_that_was_moved_is_picked_where_it_is(self):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(
                [
                    find_node('smach_oracle', 'oracle_run')[0],
                    '--config',
                    str(SETTINGS),
                    '--record',
                    folder,
                    str(TASKS / 'drink_retrieval.py'),
                    '--seed',
                    str(seed_with('drink_moved')),
                ],
                check=True,
                timeout=140,
            )
            (trial,) = load_trials([folder]).trials
        self.assertEqual((trial.outcome, trial.questions), ('succeeded', 0))
        self.assertIn('drink_retrieval/PICK_DRINK', dict(trial.failures_by_state))
        self.assertGreater(trial.recoveries, 0)
        self.assert_true_success()


if __name__ == '__main__':
    rospy.init_node('pr2_drink_retrieval_test')
    rostest.rosrun('smach_oracle', 'pr2_drink_retrieval', DrinkRetrievalTest)
