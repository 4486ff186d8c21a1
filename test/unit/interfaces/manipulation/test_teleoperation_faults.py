"""What goes wrong while a hand is driven leaves nothing moving; no master."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from waiting import wait_for

from smach_oracle.interfaces.manipulation import server as teleoperation_server
from smach_oracle.interfaces.manipulation.arm_port import GripperReport
from smach_oracle.interfaces.manipulation.cartesian_drive import DriveLimits, no_motion
from smach_oracle.interfaces.manipulation.server import TeleoperationServer
from smach_oracle.interfaces.manipulation.settings import NO_SNAPSHOT, TeleoperationSettings
from smach_oracle.msg import SharedAutonomyGoal, TeleopCommand

SETTINGS = TeleoperationSettings(
    arms={},
    base='base',
    limits=DriveLimits(),
    states={},
    arm_keys=[],
    success=['succeeded'],
    rate_hz=50.0,
    watchdog_s=60.0,
    lease_s=60.0,
    lead=0.1,
    gripper_effort=10.0,
    lock_step=False,
    snapshot=NO_SNAPSHOT,
    clearance=False,
)


class FakeArm:
    """Its gripper is itself; to move it raises the error that it is given."""

    def __init__(self):
        self.gripper = self
        self.report = GripperReport()
        self.moving = False
        self.error = None
        self.stops = 0

    def stop(self):
        self.stops += 1

    def why_not(self, command, frozen):
        return ''

    def begin(self):
        """Nothing to be done."""

    def rest(self, period_s):
        """Nothing to be done."""

    def move(self, command, period_s, held):
        if self.error is not None:
            raise self.error
        return no_motion()._replace(velocities=np.ones(7))

    def poll(self, timeout_s):
        return False

    def tool_pose(self):
        return PoseStamped()

    def in_base(self, twist):
        return Twist()


class FakeGoal:
    """The interface's action, with a goal that goes on."""

    goal = SharedAutonomyGoal(query_id='q1', state='PICK')

    def __init__(self, name, begun, ended):
        pass

    def drop_if_asker_is_gone(self):
        """The asker is there."""


@pytest.fixture(name='interface')
def make_interface(monkeypatch):
    """A server of two arms: its arms, what it publishes, and how to command it."""
    made = SimpleNamespace(arms={'left': FakeArm(), 'right': FakeArm()}, states=[])
    over = threading.Event()
    monkeypatch.setattr(rospy, 'is_shutdown', over.is_set)
    monkeypatch.setattr(rospy, 'get_name', lambda: '/hand')
    monkeypatch.setattr(rospy, 'logerr_throttle', lambda *_: None)
    publisher = SimpleNamespace(publish=made.states.append)
    monkeypatch.setattr(rospy, 'Publisher', lambda *_, **__: publisher)
    monkeypatch.setattr(
        rospy,
        'Subscriber',
        lambda topic, kind, callback, **__: setattr(made, topic.strip('~'), callback),
    )
    monkeypatch.setattr(teleoperation_server, 'InterfaceGoal', FakeGoal)
    monkeypatch.setattr(teleoperation_server, 'FinishServices', lambda *_: None)
    before = threading.enumerate()
    TeleoperationServer(SETTINGS, made.arms)
    yield made
    over.set()
    assert wait_for(lambda: not set(threading.enumerate()) - set(before))


def drive(interface, seq):
    """Command the left hand as ann. Returns the first state in which it moves or is refused."""
    seen = len(interface.states)
    interface.command(TeleopCommand(operator='ann', arm='left', dead_man=True, seq=seq))
    return wait_for(
        lambda: next(
            (state for state in interface.states[seen:] if state.moving or state.refused), None
        )
    )


def test_hand_and_grippers_stand_after_an_error_until_the_next_command(interface):
    assert drive(interface, 1).moving
    left, right = interface.arms.values()
    before = [arm.stops for arm in (left, right)]
    left.error = KeyError('r_elbow')
    assert wait_for(lambda: interface.states[-1].refused)
    state = interface.states[-1]
    assert (state.refused, state.operator, state.moving) == ("error: 'r_elbow'", '', False)
    assert [arm.stops for arm in (left, right)] == [stops + 1 for stops in before]
    left.error = None
    again = drive(interface, 2)
    assert (again.seq, again.refused, again.operator, again.moving) == (2, '', 'ann', True)


def test_a_release_without_a_name_stops_whoever_drives_until_it_is_let_go(interface):
    assert drive(interface, 1).moving
    interface.command(TeleopCommand(arm='left', seq=2))
    assert wait_for(lambda: interface.states[-1].seq == 2)
    assert (interface.states[-1].operator, interface.states[-1].moving) == ('', False)
    assert 'somebody has stopped the hand' in drive(interface, 3).refused, 'held on'
    interface.command(TeleopCommand(operator='ann', arm='left', seq=4))
    assert drive(interface, 5).moving
