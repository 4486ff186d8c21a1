"""rospy closes topics before `rospy.is_shutdown` says so: whoever publishes then is quiet."""

from types import SimpleNamespace

import pytest
import rospy
from sensor_msgs.msg import CompressedImage

from smach_oracle.msg import ExpertQueryAction, InterfaceOutput
from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.expert.failure_images import FailureCameras
from smach_oracle.ros.expert.quiet_action_server import QuietActionServer
from smach_oracle.ros.interfaces.starting import InterfaceStarter
from smach_oracle.ros.publishers import EventPublisher, RatesPublisher
from smach_oracle.ros.recorder import StatusPublisher
from smach_oracle.ros.recording.recorder_status import RecorderState, RecordingStatus


class ClosedTopic:
    """As rospy has left it."""

    tried = 0
    impl = SimpleNamespace(connections=[])

    def __init__(self, *_, **__):
        type(self).tried = 0

    def publish(self, _message):
        type(self).tried += 1
        raise rospy.ROSException('publish() to a closed topic')

    def get_num_connections(self):
        return 1

    def unregister(self):
        """It has been."""


class TornTopic(ClosedTopic):
    """As it is while rospy takes it apart."""

    def publish(self, _message):
        type(self).tried += 1
        raise AttributeError("'NoneType' object has no attribute 'acquire'")


class Machine:
    """A machine that has learned nothing."""

    trial_id = 'trial-1'

    def __init__(self, report):
        self.events = EventSource(report)

    def rates(self):
        return []

    def transition_counts(self):
        return []


@pytest.fixture(name='going_down', params=[True, False], ids=['going down', 'not going down'])
def is_going_down(request, monkeypatch):
    monkeypatch.setattr(rospy.core, 'is_shutdown_requested', lambda: request.param)
    return request.param


@pytest.fixture(name='topic', params=[ClosedTopic, TornTopic])
def closed_topic(request, monkeypatch):
    """The class of every topic; no master."""
    monkeypatch.setattr(rospy, 'Publisher', request.param)
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    monkeypatch.setattr(rospy, 'on_shutdown', lambda _hook: None)
    monkeypatch.setattr(rospy, 'resolve_name', lambda name: '/robot/' + name.lstrip('~'))
    monkeypatch.setattr(rospy.Time, 'now', lambda: rospy.Time(1))
    monkeypatch.setattr(rospy, 'get_rostime', lambda: rospy.Time(1))
    return request.param


def events(report):
    machine = Machine(report)
    machine.events.observers.append(EventPublisher())
    machine.events.emit(EventKind.TRIAL_END, 'TOP')


def rates_of_the_machines_thread(report):
    publisher, machine = RatesPublisher(period_s=3600.0), Machine(report)
    publisher.watch(machine)
    machine.events.emit(EventKind.TRIAL_END, 'TOP')
    publisher.close()


def rates_of_their_own_thread(report):
    publisher = RatesPublisher(period_s=3600.0)
    publisher._publish_quietly(Machine(report))
    publisher.close()


def recorder_status(_report):
    StatusPublisher()(RecordingStatus(RecorderState.CLOSED))


def interface_output(_report):
    InterfaceStarter()._publish(InterfaceOutput())


def failure_images(_report):
    cameras = FailureCameras([])
    cameras._publisher = rospy.Publisher()
    question = SimpleNamespace(trial_id='trial-1', question_id='question-1')
    cameras._publish(question, [('/camera', CompressedImage())])


def action_server():
    server = QuietActionServer('/robot/expert_query', ExpertQueryAction, print, auto_start=False)
    server.started = True
    server.status_pub = server.result_pub = server.feedback_pub = rospy.Publisher()
    return server


def status_of_the_servers_timer(_report):
    action_server().publish_status_async(None)


def feedback_of_a_question(_report):
    action_server().publish_feedback(None, None)


def end_of_a_question(_report):
    action_server().publish_result(None, None)


@pytest.mark.parametrize(
    'publish',
    [
        events,
        rates_of_the_machines_thread,
        rates_of_their_own_thread,
        recorder_status,
        interface_output,
        failure_images,
        status_of_the_servers_timer,
        feedback_of_a_question,
        end_of_a_question,
    ],
    ids=lambda function: function.__name__,
)
def test_a_closed_topic_is_an_error_unless_the_node_goes_down(
    monkeypatch, topic, going_down, publish
):
    errors = []

    def report(*words):
        errors.append(words)

    monkeypatch.setattr(rospy, 'logerr', report)
    try:
        publish(report)
    except (rospy.ROSException, AttributeError) as err:
        errors.append(err)
    assert topic.tried
    assert bool(errors) is not going_down, errors
