"""What is told of a robot after an answer."""
import pytest
import rosgraph
import rospy
from waiting import wait_for

from smach_oracle.expert.next_steps import NextSteps
from smach_oracle.msg import OracleEvent


def steps_after(*events):
    steps = NextSteps('', 'trial')  # no robot of that name: nothing is subscribed to
    for event in events:
        steps._take(event)
    return steps


def kinds(steps):
    return [event.kind for event in steps.follow(0.05)]


def event(kind, trial_id='trial'):
    return OracleEvent(kind=kind, trial_id=trial_id)


@pytest.mark.parametrize('robot', ['', 'no robot!', '\x1b[31m'])
def test_a_robot_with_an_impossible_name_is_only_silent(robot):
    steps = NextSteps(robot, 'trial')
    assert kinds(steps) == []
    steps.stop()


def test_nothing_is_subscribed_to_before_the_master_is_there(monkeypatch):
    subscribed, online = [], []
    monkeypatch.setattr(rosgraph, 'is_master_online', lambda: bool(online))
    monkeypatch.setattr(rospy, 'Subscriber', lambda *args, **kwargs: subscribed.append(args[0]) or FakeSubscriber())
    steps, gone = NextSteps('/robot', 'trial'), NextSteps('/other', 'trial')
    gone.stop()
    assert not wait_for(lambda: subscribed, 0.7)
    online.append(True)
    assert wait_for(lambda: subscribed) == ['/robot/oracle/events']
    steps.stop()


class FakeSubscriber:
    def unregister(self):
        pass


def test_the_way_to_the_next_state_is_told_and_no_more():
    steps = steps_after(event(OracleEvent.QUERY_ANSWERED), event(OracleEvent.JUMP), event(OracleEvent.STATE_START),
                        event(OracleEvent.STATE_START))
    assert kinds(steps) == [OracleEvent.JUMP, OracleEvent.STATE_START]


def test_other_trials_and_what_came_before_the_answer_are_not_told():
    steps = steps_after(event(OracleEvent.WARNING), event(OracleEvent.JUMP, 'other'))
    steps.forget()
    steps._take(event(OracleEvent.TRIAL_END))
    assert kinds(steps) == [OracleEvent.TRIAL_END]
