"""Finds why an action failed: the status text of its goal, or a text in its result."""

import smach
from smach_oracle.oracle.identity import own_mark

# commonly hold the reason
RESULT_FIELDS = ('reason', 'text', 'error_string', 'message')


def describe_failure(state: smach.State) -> str:
    """Return why the action of a SimpleActionState ended as it did, or '' where that is not known.

    Knows our own SimpleActionState and upstream's.
    """
    return _status_text(state) or _result_text(own_mark(state, '_goal_result'))


def _status_text(state: smach.State) -> str:
    own = own_mark(state, '_goal_status_text')
    if isinstance(own, str):
        return own
    client = own_mark(state, '_action_client')  # upstream: a SimpleActionClient
    status_text = getattr(client, 'get_goal_status_text', None)
    if getattr(client, 'gh', None) is None or status_text is None:
        return ''
    return str(status_text())


def _result_text(result: object) -> str:
    for field in RESULT_FIELDS:
        text = getattr(result, field, None)
        if isinstance(text, str) and text:
            return text
    return ''
