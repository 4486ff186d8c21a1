"""What is told of a robot after an answer."""

from types import SimpleNamespace

import pytest
import rosgraph
import rospy
from waiting import stays, wait_for

from smach_oracle.expert.terminal import next_steps
from smach_oracle.expert.terminal.next_steps import NextSteps
from smach_oracle.msg import OracleEvent


@pytest.fixture(name='robot')
def make_robot(monkeypatch):
    """What a robot does reaches who listens at once."""
    robot = SimpleNamespace(does=None)

    def listener(name, topic, kind, take):
        robot.does = take
        return SimpleNamespace(stop=lambda: None)

    monkeypatch.setattr(next_steps, 'RobotTopic', listener)
    return robot


def steps_after(robot, *events):
    steps = NextSteps('/robot', 'trial')
    for each in events:
        robot.does(each)
    return steps


def kinds(steps):
    return [event.kind for event in steps.follow(0.05)]


def event(kind, trial_id='trial'):
    return OracleEvent(kind=kind, trial_id=trial_id)


@pytest.mark.parametrize('name', ['', 'no robot!', '\x1b[31m'])
def test_a_robot_with_an_impossible_name_is_only_silent(name):
    steps = NextSteps(name, 'trial')
    assert kinds(steps) == []
    steps.stop()


def test_nothing_is_subscribed_to_before_the_master_is_there(monkeypatch):
    subscribed, online = [], []
    monkeypatch.setattr(rosgraph, 'is_master_online', lambda: bool(online))
    monkeypatch.setattr(
        rospy, 'Subscriber', lambda *args, **kwargs: subscribed.append(args[0]) or FakeSubscriber()
    )
    steps, gone = NextSteps('/robot', 'trial'), NextSteps('/other', 'trial')
    gone.stop()
    assert stays(lambda: not subscribed, 0.7)
    online.append(True)
    assert wait_for(lambda: subscribed) == ['/robot/oracle/events']
    steps.stop()


class FakeSubscriber:
    def unregister(self):
        pass


def test_the_way_to_the_next_state_is_told_and_no_more(robot):
    steps = steps_after(
        robot,
        event(OracleEvent.QUERY_ANSWERED),
        event(OracleEvent.JUMP),
        event(OracleEvent.STATE_START),
        event(OracleEvent.STATE_START),
    )
    assert kinds(steps) == [OracleEvent.JUMP, OracleEvent.STATE_START]


def test_a_wait_for_health_before_the_next_state_is_told(robot):
    steps = steps_after(
        robot,
        event(OracleEvent.HEALTH_WAIT_START),
        event(OracleEvent.HEALTH_WAIT_END),
        event(OracleEvent.STATE_START),
    )
    assert kinds(steps) == [
        OracleEvent.HEALTH_WAIT_START,
        OracleEvent.HEALTH_WAIT_END,
        OracleEvent.STATE_START,
    ]


def test_other_trials_and_what_came_before_the_answer_are_not_told(robot):
    steps = steps_after(robot, event(OracleEvent.WARNING))
    steps.forget()
    robot.does(event(OracleEvent.JUMP, 'other'))
    robot.does(event(OracleEvent.TRIAL_END))
    assert kinds(steps) == [OracleEvent.TRIAL_END]
