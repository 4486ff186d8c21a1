"""A hand as the console drives it: arms, frames, and no more commands than a world in lock-step can
take.
"""

import time

import pytest
import rospy

from smach_oracle.expert.console.answering import teleop_client, teleoperation
from smach_oracle.expert.console.answering.driving_control import SILENT_S, DrivingSession
from smach_oracle.expert.console.commands.commands import PageCommand
from smach_oracle.expert.console.web.audit import Person
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.interfaces.manipulation.cartesian_drive import GRIPPER_OPEN
from smach_oracle.msg import TeleopState

ARMS = {'left': {'tool': 'l_tool'}, 'right': {'tool': 'r_tool'}}
SAID = {
    'question': 'q',
    'held': True,
    'frame': 'tool',
    'linear': (1.0, 0.0, 0.0),
    'angular': (0.0, 0.0, 0.0),
    'gripper': '',
    'arm': '',
}


class FakePublisher:
    made = None  # the last

    def __init__(self, *_, **__):
        FakePublisher.made = self
        self.sent = []
        self.publish = self.sent.append


class Silent:
    def record(self, *_):
        """Nobody listens."""


class NoQuestions:
    def questions(self):
        return []

    def find(self, _):
        """None is open any more."""


@pytest.fixture(name='make')
def make_hands(monkeypatch):
    """Hands with one of two arms, at the wheel of which is page 1."""

    def make(**parameters):
        known = dict(
            {'/hand/arms': ARMS, '/hand/camera_frame': 'eye'},
            **{'/hand/' + name: value for name, value in parameters.items()},
        )
        monkeypatch.setattr(rospy, 'get_param', lambda name, default=None: known.get(name, default))
        monkeypatch.setattr(rospy, 'Publisher', FakePublisher)
        monkeypatch.setattr(rospy, 'Subscriber', lambda *_, **__: None)
        monkeypatch.setattr(rospy, 'get_name', lambda: '/console')
        monkeypatch.setattr(rospy.Time, 'now', lambda: rospy.Time(7))
        made = teleoperation.Teleoperation(PageSections(), NoQuestions(), Silent())
        client = made._clients['q'] = teleop_client.TeleopClient('/hand')
        client.state = TeleopState(arm='right')
        client.control.take(
            DrivingSession('q', 1, Person('', '', 'teleoperator', 'ann'), None, 0.0), 0.0
        )
        return made, client, FakePublisher.made.sent

    return make


def drive(made, sent_s=None, page=1, **more):
    """As a page says it; `sent_s` by its own clock, now where it is not told."""
    sent_s = time.monotonic() if sent_s is None else sent_s
    return made.drive(PageCommand(1, 'drive', dict(SAID, sent=1e3 * sent_s, **more)), page)


def test_the_arm_is_the_interface_s_own_choice_until_another_is_named(make):
    made, _, sent = make()
    assert drive(made).ok and drive(made, arm='left').ok
    assert [(each.arm, each.header.frame_id, each.dead_man) for each in sent] == [
        ('right', 'r_tool', True),
        ('left', 'l_tool', True),
    ]


@pytest.mark.parametrize('parameters, gap', [({}, GRIPPER_OPEN), ({'gripper_open': 0.07}, 0.07)])
def test_the_gripper_opens_as_far_as_the_interface_says(make, parameters, gap):
    made, _, sent = make(**parameters)
    assert drive(made, gripper='open').ok and sent[-1].move_gripper and sent[-1].gripper == gap


def test_an_arm_that_is_not_there_stops_the_hand(make):
    made, _, sent = make()
    drive(made)
    reply = drive(made, arm='/cmd_vel')
    assert (reply.ok, reply.message) == (False, "unknown arm '/cmd_vel'; allowed: left, right")
    assert [each.dead_man for each in sent] == [True, False] and sent[-1].arm == 'right'


def stop(made, page=9):
    return made.stop(
        PageCommand(1, 'stop_hand', {'question': 'q'}), Person('', '', 'viewer', 'vera'), page
    )


def test_whoever_sees_a_hand_stops_it_and_its_driver_has_lost_the_wheel(make):
    made, client, sent = make()
    drive(made)
    assert stop(made).ok
    assert [(each.operator, each.dead_man) for each in sent[1:]][0] == ('', False), 'at once'
    assert client.control.session is None
    assert drive(made).message == teleoperation.TAKE_FIRST


@pytest.mark.parametrize('name, who', [('vera', 'vera'), ('', 'somebody at 10.0.0.7')])
def test_the_record_of_the_driver_says_who_has_stopped_the_hand(make, monkeypatch, name, who):
    told = []
    monkeypatch.setattr(Silent, 'record', lambda _, *facts: told.append(facts))
    made, _, _ = make()
    made.stop(
        PageCommand(1, 'stop_hand', {'question': 'q'}), Person('10.0.0.7', 's', 'viewer', name), 9
    )
    assert told[0][1] == 'leave_wheel' and told[0][3] == who + ' has stopped the hand'


def test_a_hand_that_no_page_drives_is_stopped_as_well(make):
    made, client, sent = make()
    client.control.leave(0.0)
    assert stop(made).ok and [(each.operator, each.dead_man) for each in sent] == [('', False)]


def test_a_release_that_comes_late_stops_the_hand_all_the_same(make, monkeypatch):
    made, _, sent = make()
    drive(made)
    sent_s = time.monotonic()
    monkeypatch.setattr(time, 'monotonic', lambda: sent_s + 2.0)
    assert drive(made, sent_s=sent_s, held=False).ok and not sent[-1].dead_man


def test_another_page_drives_nothing(make):
    made, _, sent = make()
    assert drive(made, page=2).message == teleoperation.TAKE_FIRST and sent == []


def test_a_world_in_lock_step_gets_the_next_command_when_it_has_carried_out_the_last(
    make, monkeypatch
):
    made, client, sent = make(lock_step=True)
    for _ in range(5):
        drive(made)
    assert [each.seq for each in sent] == [1]
    client.state = TeleopState(arm='right', seq=1, sender=sent[0].operator)
    drive(made)
    drive(made)
    drive(made, held=False)
    assert [(each.seq, each.dead_man) for each in sent] == [(1, True), (2, True), (3, False)], (
        'a release never waits'
    )
    later_s = time.monotonic() + teleop_client.ANSWER_S
    monkeypatch.setattr(time, 'monotonic', lambda: later_s)
    drive(made)
    assert sent[-1].seq == 4, 'an answer may get lost'


def test_a_world_of_its_own_pace_gets_them_all(make):
    made, _, sent = make()
    for _ in range(5):
        drive(made)
    assert len(sent) == 5


def test_a_page_that_has_fallen_silent_loses_the_wheel_and_the_hand_stands(make, monkeypatch):
    made, client, sent = make()
    drive(made)
    made.write_sections()
    assert client.control.session is not None, 'it has just been heard'
    begun_s = time.monotonic()
    monkeypatch.setattr(time, 'monotonic', lambda: begun_s + SILENT_S + 0.1)
    made.write_sections()
    assert client.control.session is None and not sent[-1].dead_man
    assert drive(made).message == teleoperation.TAKE_FIRST


def test_settings_that_are_none_take_nobody_else_s_hand_away(make, monkeypatch):
    made, client, _ = make()
    monkeypatch.setattr(rospy, 'logerr_throttle', lambda *_: None)
    known = rospy.get_param
    monkeypatch.setattr(
        rospy,
        'get_param',
        lambda name, default=None: 'no arms' if name == '/evil/arms' else known(name, default),
    )
    made._begin('e', '/evil')
    made._begin('r', '/hand')
    assert sorted(made._clients) == ['q', 'r'] and made._clients['q'] is client
