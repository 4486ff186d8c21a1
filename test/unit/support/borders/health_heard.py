"""Border of the health port: messages of topics and diagnostics, by conditions of any field."""

import io
import threading
from typing import Any, Dict, List, Tuple
from unittest import mock

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hypothesis import strategies as st
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, Float64, String

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.health import checked_health
from smach_oracle.ros.health import health_topics
from smach_oracle.ros.health.health_port import TopicHealth

from .border import TAKEN, Border, refused
from .fake_ros import fake_ros
from .values import damages, message, words

LONGEST = 2000  # letters of what is said, beside the field's name
KINDS = (Bool, Float64, String, BatteryState)
_fields = words(
    'data',
    'percentage',
    'cell_voltage.0',
    'data.\u00b2',
    'header.stamp.secs',
    'data.' + '9' * 5000,
    'cell_voltage',
    'data.__class__',
    'raw',
)


_definitions = st.sampled_from(('', '', '', 'int8 data', 'no definition'))  # '': the true one


class UnknownBytes(rospy.AnyMsg):
    """A message of a type that is not installed, as it came."""

    def __init__(self, raw: bytes, header: Dict[str, str]) -> None:
        super().__init__()
        self._buff, self._connection_header = raw, header

    def __repr__(self) -> str:
        return 'UnknownBytes({!r}, {!r})'.format(self._buff, self._connection_header)


def _wire(kind: Any) -> Any:
    """A message of a type that is not installed here, damaged perhaps."""

    def told(drawn: Tuple[Any, Any, str]) -> rospy.AnyMsg:
        one, damage, definition = drawn
        return UnknownBytes(
            damage.of(_bytes_of(one)),
            {
                'type': kind._type,
                'md5sum': kind._md5sum if not definition else definition,
                'message_definition': definition or kind._full_text,
            },
        )

    return st.tuples(message(kind), damages, _definitions).map(told)


def _bytes_of(one: Any) -> bytes:
    buffer = io.BytesIO()
    one.serialize(buffer)
    return buffer.getvalue()


_limits = st.one_of(
    st.just({}),
    st.fixed_dictionaries({'equals': st.sampled_from((True, 0, 'on'))}),
    st.fixed_dictionaries({'at_least': st.floats(0.0, 1.0)}),
)
_by_topic = st.tuples(
    _fields,
    _limits,
    st.lists(
        st.one_of(*[message(kind) for kind in KINDS], _wire(Bool), _wire(BatteryState)), max_size=2
    ),
)
_status = message(DiagnosticStatus, {'name': words('Power', '/Power/'), 'level': st.integers(0, 3)})
_by_diagnostics = st.tuples(
    st.sampled_from(('ok', 'warn')),
    st.lists(
        st.one_of(
            message(DiagnosticArray, {'status': st.lists(_status, max_size=2)}),
            _wire(DiagnosticArray),
        ),
        max_size=2,
    ),
)


def _heard(condition: Dict[str, Any], topic: str, messages: List[Any]) -> str:
    conditions = checked_health('healthy', [dict(condition, name='robot')])
    types = dict.fromkeys(('/health', *health_topics.DIAGNOSTICS), rospy.AnyMsg)
    with fake_ros() as offered, mock.patch.multiple(
        health_topics, types_at_master=lambda: types, types_in_process=dict
    ), mock.patch.object(threading, 'Timer', mock.Mock()):
        port = TopicHealth(conditions, health_topics.HealthTopics())
        for each in messages:
            offered.topics[topic](each)
        why = port.why_unwell()
    assert len(why) < LONGEST + len(condition.get('field', ''))
    return refused(why, 'robot: ') if why else TAKEN


def _take_topic(given: Tuple[str, Dict[str, Any], List[Any]]) -> str:
    field, limits, messages = given
    try:
        return _heard(dict(limits, topic='/health', field=field), '/health', messages)
    except SettingsError as err:
        return refused(err, 'healthy[0].field')


def _take_diagnostics(given: Tuple[str, List[Any]]) -> str:
    worst, messages = given
    return _heard({'diagnostics': 'Power', 'worst': worst}, '/diagnostics', messages)


BORDERS = [
    Border('topic of a health condition', _by_topic, _take_topic),
    Border('topic of the diagnostics', _by_diagnostics, _take_diagnostics),
]
