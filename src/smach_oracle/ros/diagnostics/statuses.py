"""Statuses for /diagnostics, from what the oracle knows. Messages only, no node."""

from typing import Mapping, Optional, Sequence

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from smach_oracle.msg import OpenQuery, RecorderStatus
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.records.visits import StateRateRow

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def questions_status(node: str, queries: Sequence[OpenQuery]) -> DiagnosticStatus:
    """Whether a question of this node waits for an expert: WARN."""
    own = [each for each in queries if each.query.robot == node]
    text = _counted(len(own), 'open question') if own else 'no open question'
    return _status(
        node,
        'questions',
        WARN if own else OK,
        text,
        {
            each.query.query_id: '{} of {}, for {:.0f} s'.format(
                each.query.failed_state, each.query.container_path, each.age
            )
            for each in own
        },
    )


def states_status(node: str, rows: Sequence[StateRateRow]) -> DiagnosticStatus:
    """Whether states fail so often that they are in class HIGH: WARN."""
    high = [row for row in rows if row.failure_class == FailureClass.HIGH]
    text = (
        '{} in class HIGH'.format(_counted(len(high), 'state'))
        if high
        else 'no state in class HIGH'
    )
    return _status(
        node,
        'states',
        WARN if high else OK,
        text,
        {
            '{}/{}'.format(row.path, row.state): 'failure rate {:.2f}'.format(row.rate)
            for row in high
        },
    )


def recorder_status(node: str, told: Optional[RecorderStatus]) -> DiagnosticStatus:
    """Whether the recorder loses events: ERROR while it does, WARN afterwards."""
    if told is None:
        return _status(node, 'recorder', OK, 'nothing is recorded')
    lost = told.events_lost_in_total + told.messages_dropped
    dropping = told.state == RecorderStatus.DROPPING
    text = told.text or {
        RecorderStatus.IDLE: 'between two trials',
        RecorderStatus.RECORDING: 'recording',
        RecorderStatus.DROPPING: 'the disk does not take the events',
        RecorderStatus.CLOSED: 'closed',
    }.get(told.state, 'unknown state')
    return _status(
        node,
        'recorder',
        ERROR if dropping else WARN if lost else OK,
        text,
        {
            'file': told.file,
            'events lost': str(told.events_lost_in_total),
            'messages dropped': str(told.messages_dropped),
        },
    )


def store_status(node: str, behind: Mapping[str, str], stores: int) -> DiagnosticStatus:
    """Whether trials cannot be stored: ERROR.

    :param behind: the reason by the path of each store that misses moments.
    :param stores: the number of stores in use.
    """
    text = (
        '{} behind: a crash now would lose steps'.format(_counted(len(behind), 'store'))
        if behind
        else '{} up to date'.format(_counted(stores, 'store'))
        if stores
        else 'no trial is stored'
    )
    return _status(node, 'store', ERROR if behind else OK, text, behind)


def _counted(count: int, word: str) -> str:
    return '{} {}{}'.format(count, word, '' if count == 1 else 's')


def _status(
    node: str, part: str, level: bytes, text: str, values: Optional[Mapping[str, str]] = None
) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=level,
        name='{}: oracle {}'.format(node.lstrip('/'), part),
        message=text,
        hardware_id='smach_oracle',
        values=[KeyValue(key, value) for key, value in (values or {}).items()],
    )
