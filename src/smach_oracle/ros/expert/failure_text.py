"""What a state knows about its own failure, for the expert: the status text of an action's goal, or its result's."""
from typing import Any

RESULT_FIELDS = ('reason', 'text', 'error_string', 'message')  # where actions tell people why, in common use


def describe_failure(state: Any) -> str:
    """Why the action of a SimpleActionState ended as it did; '' for other states, and where nothing was said.

    Knows our own SimpleActionState and upstream's.
    """
    return _status_text(state) or _result_text(getattr(state, '_goal_result', None))


def _status_text(state: Any) -> str:
    own = getattr(state, '_goal_status_text', None)
    if isinstance(own, str):
        return own
    client = getattr(state, '_action_client', None)  # upstream: a SimpleActionClient
    if getattr(client, 'gh', None) is None or not hasattr(client, 'get_goal_status_text'):
        return ''
    return str(client.get_goal_status_text())


def _result_text(result: Any) -> str:
    for field in RESULT_FIELDS:
        text = getattr(result, field, None)
        if isinstance(text, str) and text:
            return text
    return ''
