"""What goes wrong while a hand is driven leaves nothing moving; no master."""
import time

import pytest
import rospy

from smach_oracle.expert.command_inbox import CommandInbox
from smach_oracle.expert.dead_man import DeadMan
from smach_oracle.expert.teleoperation_server import TeleoperationServer
from smach_oracle.msg import TeleopCommand


class FakeHand:
    """Its gripper is itself."""

    def __init__(self):
        self.gripper = self
        self.stops = 0

    def stop(self):
        self.stops += 1


@pytest.fixture(name='server')
def make_server(monkeypatch):
    """One whose every round of work fails; ann holds it."""
    made = object.__new__(TeleoperationServer)
    made._hands = {'left': FakeHand(), 'right': FakeHand()}
    made._dead_man, made._commands = DeadMan(60.0), CommandInbox()
    made._held, made._gripped, made._refused = TeleopCommand(operator='ann'), (0.0, 10.0), ''
    made._dead_man.press('ann', time.monotonic())
    rounds = iter([False, True])

    def fails(_due_s):
        raise KeyError('r_elbow')
    made._work = fails
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: next(rounds))
    monkeypatch.setattr(rospy, 'get_name', lambda: '/hand')
    monkeypatch.setattr(rospy, 'logerr_throttle', lambda *_: None)
    return made


def test_hand_and_grippers_stand_after_an_error_until_the_next_command(server):
    server._run()
    assert [hand.stops for hand in server._hands.values()] == [1, 1]
    assert server._held is None and server._gripped is None and server._dead_man.holder(time.monotonic()) == ''
    assert server._refused == "error: 'r_elbow'" and not server._step.velocities.any()
    assert server._dead_man.press('ann', time.monotonic()) == ''
