"""What a node logs of a question: no error and no warning as it goes down while one is open."""

import threading
from types import SimpleNamespace

import pytest
import rospy
from expert_fixtures import make_question
from waiting import wait_for

from smach_oracle.ros.expert import client, server
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.ros.expert.server import ExpertQueryServer


class FakeTopic:
    """A publisher as rospy's: it refuses to publish once it was unregistered."""

    def __init__(self, *_, **__):
        self.sent = []
        self.closed = False
        self.impl = self
        self.connections = []

    def publish(self, message):
        if self.closed:
            raise rospy.ROSException('publish() to a closed topic')
        self.sent.append(message)

    def unregister(self):
        self.closed = True


class FakeTimer:
    """Publishes the status now and then."""

    def __init__(self):
        self.running = True

    def shutdown(self):
        self.running = False


class FakeActionServer:
    """Its topics are closed when it is stopped."""

    def __init__(self, _name, _kind, goal_callback, cancel_callback, auto_start):
        self.lock = threading.RLock()
        self.on_goal, self.on_cancel = goal_callback, cancel_callback
        self.status_pub = FakeTopic()
        self.status_timer = FakeTimer()

    def start(self):
        pass

    def publish_status(self):
        self.status_pub.publish('status')

    def stop(self):
        self.status_pub.unregister()


class FakeHandle:
    """The goal of one question."""

    def __init__(self, goal, topic):
        self._goal = goal
        self._topic = topic
        self.status_tracker = self
        self.goal = self
        self._connection_header = {'callerid': '/robot'}

    def get_goal(self):
        return self._goal

    def set_accepted(self):
        self._topic.publish('accepted')

    def publish_feedback(self, _feedback):
        self._topic.publish('feedback')

    def set_canceled(self, *_):
        self._topic.publish('cancelled')


@pytest.fixture(name='hooks')
def shutdown_hooks(monkeypatch):
    """What a node does first when it goes down; no master."""
    hooks = []
    monkeypatch.setattr(rospy, 'on_shutdown', hooks.append)
    monkeypatch.setattr(rospy, 'Publisher', FakeTopic)
    monkeypatch.setattr(rospy, 'resolve_name', lambda name: '/robot/' + name.lstrip('~'))
    monkeypatch.setattr(rospy.Time, 'now', lambda: rospy.Time(1))
    monkeypatch.setattr(rospy, 'Service', lambda *_: FakeTopic())
    monkeypatch.setattr(server, 'QuietActionServer', FakeActionServer)
    return hooks


def test_a_question_that_is_taken_back_in_a_shutdown_is_published_on_open_topics(hooks):
    hosted = ExpertQueryServer()
    action = hosted._action
    handle = FakeHandle(to_goal(make_question(), '/robot', rospy.Time(1)), action.status_pub)
    action.on_goal(handle)
    for hook in hooks:
        hook()
    action.on_cancel(handle)
    assert action.status_pub.sent[-1] == 'cancelled'


def test_a_server_that_goes_down_does_not_publish_its_status_on_closed_topics(hooks):
    hosted = ExpertQueryServer()
    assert hosted._action.status_timer.running
    for hook in hooks:
        hook()
    assert not hosted._action.status_timer.running


def test_a_list_of_questions_meets_a_closed_topic_in_a_shutdown_only(hooks, monkeypatch):
    hosted = ExpertQueryServer()
    hosted._open_publisher.closed = True
    with pytest.raises(rospy.ROSException):
        hosted._publish_list()
    monkeypatch.setattr(rospy.core, 'is_shutdown_requested', lambda: True)
    hosted._publish_list()
    assert len(hosted._open_publisher.sent) == 1  # at the start


@pytest.mark.parametrize(
    'front_ends, said', [([], 1), (['/robot'], 1), (['/console'], 0), (['/robot', '/console'], 0)]
)
def test_how_a_question_is_answered_is_said_once_where_no_front_end_shows_it(
    hooks, monkeypatch, front_ends, said
):
    told = []
    monkeypatch.setattr(rospy, 'logwarn', told.append)
    monkeypatch.setattr(rospy, 'get_name', lambda: '/robot')  # it listens for its diagnostics
    hosted = ExpertQueryServer()
    hosted._open_publisher.connections = [SimpleNamespace(endpoint_id=each) for each in front_ends]
    for number in '12':
        goal = to_goal(make_question(number), '/robot', rospy.Time(1))
        hosted._action.on_goal(FakeHandle(goal, hosted._action.status_pub))
    assert told == [server.HOW_TO_ANSWER] * said


class LostLink:
    """The connection to a server that took a question and died."""

    name = '/robot/expert_query'

    def __init__(self):
        self.polled = threading.Event()

    def ready(self):
        return True

    def alive(self):
        return False

    def send(self, *_):
        return self

    def poll(self):
        self.polled.set()

    def cancel(self):
        pass


@pytest.mark.parametrize('going_down', [True, False])
def test_the_loss_of_the_server_is_a_warning_unless_the_node_goes_down(monkeypatch, going_down):
    warnings, cancelled, link = [], threading.Event(), LostLink()
    monkeypatch.setattr(rospy, 'logwarn', lambda text, *values: warnings.append(text % values))
    monkeypatch.setattr(rospy.core, 'is_shutdown_requested', lambda: going_down)
    goal = to_goal(make_question(), '/robot', rospy.Time(1))
    sent = client._SentQuestion(link, goal, lambda *_: None)
    asking = threading.Thread(target=sent.run, args=(cancelled,))
    asking.start()
    assert link.polled.wait(5.0)
    assert going_down or wait_for(lambda: warnings)
    cancelled.set()
    asking.join(5.0)
    assert any('is gone' in text for text in warnings) is not going_down
