"""A hand that closes is not cut off by a stop: a PR2's gripper then has no force left."""

import pytest
from actionlib_msgs.msg import GoalStatus

from control_msgs.msg import GripperCommandResult
from smach_oracle.pr2 import ros_robot
from smach_oracle.pr2.robot import RobotError
from smach_oracle.ros.goal_link import GoalEvent


class FakeGoal:
    """Ends well after so many polls, or preempted at the next one once it is cancelled."""

    def __init__(self, polls, told):
        self.left, self.told, self.cancelled = polls, told, False

    def poll(self):
        self.told()
        self.left -= 1
        if self.cancelled:
            return GoalEvent(status=GoalStatus.PREEMPTED)
        if self.left > 0:
            return None
        return GoalEvent(
            status=GoalStatus.SUCCEEDED, result=GripperCommandResult(0.05, 40.0, True, False)
        )

    def unheard(self, now_s):
        return False

    def cancel(self):
        self.cancelled = True


class FakeGripper:
    """Takes one goal; the robot is told to stop meanwhile."""

    name = 'gripper'

    def __init__(self, polls, told):
        self.goal = FakeGoal(polls, told)

    def ready(self):
        return True

    alive = ready

    def send(self, goal):
        return self.goal


@pytest.fixture(name='stopped')
def _stopped(monkeypatch):
    def make(polls):
        gripper = FakeGripper(polls, lambda: robot.abort())
        monkeypatch.setattr(ros_robot, 'GoalLink', lambda name, spec: gripper)
        for part in ('RosSenses', 'WorldTime', 'PoseTeller'):
            monkeypatch.setattr(ros_robot, part, lambda *_: None)
        robot = ros_robot.RosRobot()
        return robot, gripper.goal

    return make


def test_a_hand_that_closes_has_closed_before_it_stops_and_then_nothing_else_is_done(stopped):
    robot, goal = stopped(20)
    assert robot.gripper('right', 0.0).stalled and not goal.cancelled
    with pytest.raises(RobotError, match='told to stop'):
        robot.gripper('right', 0.0)


def test_a_hand_that_opens_stops_at_once(stopped):
    robot, goal = stopped(20)
    with pytest.raises(RobotError, match='preempted'):
        robot.gripper('right', 0.09)
    assert goal.cancelled and goal.left > 15


def test_a_hand_that_does_not_get_closed_is_stopped_in_the_end(stopped, monkeypatch):
    monkeypatch.setattr(ros_robot, 'CLOSING_S', 0.05)
    robot, goal = stopped(10**6)
    with pytest.raises(RobotError, match='preempted'):
        robot.gripper('right', 0.0)
    assert goal.cancelled
