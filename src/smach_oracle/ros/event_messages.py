"""From the executive's events and rates to the messages of the ROS interface (OracleEvent, OracleRates)."""
import json
from typing import Any, Iterable, Optional

import genpy
import rospy
from std_msgs.msg import Header

from smach_oracle.msg import OracleEvent, OracleRates, StateRate, TransitionCount
from smach_oracle.oracle.events import Event


def to_msg(event: Event, stamp: Optional[genpy.Time] = None) -> OracleEvent:
    """Translate one event.

    :param stamp: ROS time of the step; none: now, or zero where this process runs without ROS.
    """
    header = Header(stamp=ros_now() if stamp is None else stamp)
    return OracleEvent(
        int(event.kind), header, float(event.wall_time), _text(event.trial_id), event.seq, _text(event.path),
        _text(event.state), _text(event.outcome), _text(event.target), int(event.failure_kind),
        int(event.failure_class), float(event.rate), bool(event.continuous), _text(event.query_id), _text(event.by),
        _text(event.text), _json(event.data))


def rates_to_msg(trial_id: str, rates: Iterable[Any], transitions: Iterable[Any]) -> OracleRates:
    """Translate what has been learned of one wrapped machine.

    :param rates: rows of `OracleContainer.rates()`.
    :param transitions: rows of `OracleContainer.transition_counts()`: path, state, outcome, target, count.
    :returns: an OracleRates, stamped with ROS time now (zero where this process runs without ROS).
    """
    return OracleRates(
        Header(stamp=ros_now()), _text(trial_id),
        [StateRate(_text(row.path), _text(row.state), float(row.rate), int(row.failure_class), row.successes,
                   row.failures, row.recoveries, bool(row.has_preconditions)) for row in rates],
        [TransitionCount(*[_text(part) for part in row[:4]], row[4]) for row in transitions])


def ros_now() -> genpy.Time:
    """ROS time, or zero where there is none (no node in this process, or simulated time that has not begun)."""
    if not rospy.rostime.is_rostime_initialized():
        return genpy.Time()
    return rospy.rostime.get_rostime()


def _text(value: Any) -> str:
    """A string that can be put on the wire: a state's exception text may hold halves of surrogate pairs."""
    text = value if isinstance(value, str) else str(value)
    if text.isascii():
        return text
    return text.encode('utf-8', 'backslashreplace').decode('utf-8')


def _json(data: Any) -> str:
    return json.dumps(data, default=str) if data else ''
