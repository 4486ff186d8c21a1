"""Translates the executive's events and rates to OracleEvent and OracleRates messages."""

import json
from typing import Iterable, Optional

import genpy
import rospy
from std_msgs.msg import Header

from smach_common.foreign import ends_program, error_text, text_of
from smach_oracle.msg import OracleEvent, OracleRates, StateRate, TransitionCount
from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.records.visits import StateRateRow, TransitionRow

from .sendable_text import sendable_text


def to_msg(event: Event, stamp: Optional[genpy.Time] = None) -> OracleEvent:
    """Translate one event.

    :param stamp: ROS time of the step. None means now, or zero where this process runs without ROS.
    """
    header = Header(stamp=ros_now() if stamp is None else stamp)
    place = (event.path, event.state, event.outcome, event.target)
    words = (event.query_id, event.by, event.text)
    return OracleEvent(
        int(event.kind),
        header,
        float(event.wall_time),
        sendable_text(event.trial_id),
        event.seq,
        *map(sendable_text, place),
        int(event.failure_kind),
        int(event.failure_class),
        float(event.rate),
        bool(event.continuous),
        *map(sendable_text, words),
        json_of(event.data),
    )


def rates_to_msg(
    trial_id: str, rates: Iterable[StateRateRow], transitions: Iterable[TransitionRow]
) -> OracleRates:
    """Translate what has been learned of one wrapped machine.

    :param rates: rows of `OracleContainer.rates()`.
    :param transitions: rows of `OracleContainer.transition_counts()`.
    :returns: an OracleRates, stamped with ROS time now (zero where this process runs without ROS).
    """
    return OracleRates(
        Header(stamp=ros_now()),
        sendable_text(trial_id),
        [
            StateRate(
                sendable_text(row.path),
                sendable_text(row.state),
                float(row.rate),
                int(row.failure_class),
                row.successes,
                row.failures,
                row.recoveries,
                bool(row.has_preconditions),
            )
            for row in rates
        ],
        [TransitionCount(*map(sendable_text, row[:4]), row[4]) for row in transitions],
    )


def ros_now() -> genpy.Time:
    """ROS time now, or zero where there is none.

    There is none without a node in this process, and before simulated time has begun.
    """
    if not rospy.rostime.is_rostime_initialized():
        return genpy.Time()
    return rospy.rostime.get_rostime()


def json_of(data: object) -> str:
    """Return plain data as JSON. Any other object in it becomes its text."""
    if not data:
        return ''
    try:
        return json.dumps(data, default=text_of)
    except BaseException as err:  # such as of a key, or of data that hold themselves
        if ends_program(err):
            raise
        return json.dumps({'not_told': error_text(err)})
