"""The port that listens: what was never heard of, and what was heard too long ago."""

import pytest
import rospy
from std_msgs.msg import Bool

from smach_oracle.oracle.settings.health import checked_health
from smach_oracle.ros.health import health_port, health_topics
from smach_oracle.ros.health.field_rules import Status
from smach_oracle.ros.health.health_topics import Latest


class FakeTopics:
    """A fake of what listens to topics; hears what a test puts into its places."""

    def __init__(self):
        self.heard = {}
        self.watched, self.warned = set(), set()

    def message(self, topic):
        return self.heard.setdefault(topic, Latest())

    status = message


@pytest.fixture
def warnings(monkeypatch):
    texts = []
    monkeypatch.setattr(health_port.rospy, 'logwarn', lambda text, *args: texts.append(text % args))
    monkeypatch.setattr(health_port.rospy, 'is_shutdown', lambda: False)
    return texts


@pytest.fixture
def now(monkeypatch):
    """Monotonic time by which ages are told."""
    clock = [100.0]
    monkeypatch.setattr(health_topics.time, 'monotonic', lambda: clock[0])
    return clock


def port_of(topics, *given):
    return health_port.TopicHealth(checked_health('healthy', list(given)), topics)


def test_what_was_never_heard_of_is_well_and_warned_of_once(warnings):
    port = port_of(FakeTopics(), {'topic': '/motors_on'}, {'diagnostics': 'Power'})
    assert [port.why_unwell(), port.why_unwell()] == ['', '']
    assert warnings == [
        'healthy: topic /motors_on has not published yet, so its condition holds',
        'healthy: diagnostics Power has not published yet, so its condition holds',
    ]


def test_a_machine_for_each_trial_warns_of_it_once_and_starts_one_timer(warnings, monkeypatch):
    started = []
    monkeypatch.setattr(health_port.threading.Timer, 'start', lambda timer: started.append(timer))
    topics = FakeTopics()
    for _ in range(3):
        port_of(topics, {'topic': '/motors_on'}).why_unwell()
    assert len(warnings) == len(started) == 1


def test_with_a_largest_age_it_is_not_well(warnings):
    port = port_of(FakeTopics(), {'topic': '/motors_on', 'max_age_s': 5})
    assert port.why_unwell() == 'motors_on: not heard of yet'
    assert warnings == [
        'healthy: topic /motors_on has not published yet, so its condition does not hold'
    ]


def test_all_that_is_wrong_is_named(warnings, now):
    topics = FakeTopics()
    port = port_of(
        topics,
        {'topic': '/motors_on', 'name': 'motors', 'max_age_s': 5},
        {'diagnostics': 'Power'},
        {'topic': '/other'},
    )
    topics.message('/motors_on').put(Bool(False))
    topics.message('/other').put(Bool(True))
    topics.status('Power').put(Status(2, 'low voltage'))
    assert port.why_unwell() == 'motors: off; Power: error (low voltage)'
    topics.message('/motors_on').put(Bool(True))
    topics.status('Power').put(Status(1, ''))
    assert port.why_unwell() == ''
    now[0] += 7.0
    assert port.why_unwell() == 'motors: not heard of for 7 s'
    assert not warnings


def test_all_that_was_heard_since_the_last_look_counts(warnings, now):
    topics = FakeTopics()
    port = port_of(topics, {'topic': '/motors_on', 'name': 'motors'}, {'diagnostics': 'Power'})
    topics.message('/motors_on').put(Bool(False))
    topics.status('Power').put(Status(2, 'low voltage'))
    looked_s = now[0]
    for says, level in ((True, 1), (False, 2), (True, 0)):
        now[0] += 0.01
        topics.message('/motors_on').put(Bool(says))
        topics.status('Power').put(Status(level, 'low voltage'))
    assert port.why_unwell() == ''
    assert port.why_unwell(looked_s) == 'motors: off; Power: error (low voltage)'
    assert port.why_unwell(now[0]) == ''


def test_a_pause_between_two_messages_counts_that_was_too_long(warnings, now):
    topics = FakeTopics()
    port = port_of(topics, {'topic': '/motors_on', 'name': 'motors', 'max_age_s': 5})
    topics.message('/motors_on').put(Bool(True))
    now[0] += 7.0
    topics.message('/motors_on').put(Bool(True))
    assert port.why_unwell() == ''
    assert port.why_unwell(now[0] - 1.0) == 'motors: not heard of for 7 s'
    assert port.why_unwell(now[0]) == ''


def undecoded(definition, data):
    """A message of a type that is not installed here."""
    message = rospy.AnyMsg()
    message._buff = data
    message._connection_header = {
        'type': 'away_msgs/Battery',
        'md5sum': str(hash(definition)),
        'message_definition': definition,
    }
    return message


def test_a_type_that_is_not_installed_is_read_by_its_definition(warnings):
    topics = FakeTopics()
    port = port_of(topics, {'topic': '/battery', 'field': 'cells.1', 'at_least': 5})
    topics.message('/battery').put(undecoded('uint8[] cells\n', b'\2\0\0\0\x09\x04'))
    assert port.why_unwell() == 'battery: 4, at least 5'
    topics.message('/battery').put(undecoded('uint8[] cells\n', b'\2\0\0\0\x09\x05'))
    assert port.why_unwell() == ''


@pytest.mark.parametrize(
    'definition, data',
    [('nonsense', b''), ('', b'\1'), ('uint8[] cells\n', b'\2'), ('other_msgs/Cell cell\n', b'')],
)
def test_a_message_that_cannot_be_read_is_not_well(definition, data, warnings):
    topics = FakeTopics()
    topics.message('/battery').put(undecoded(definition, data))
    why = port_of(topics, {'topic': '/battery', 'field': 'cells.1'}).why_unwell()
    assert why.startswith('battery: ') and ('cannot be read' in why or 'has no field' in why)
