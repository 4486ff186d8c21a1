"""ROS messages as plain data for the page. Pure.

A robot's words are passed on as text, never as markup.
"""

import json
import math
from typing import Any, Dict, Optional

from smach_oracle.msg import OracleEvent, OracleRates
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import (
    BRANCHES,
    LAST_SEQ,
    NOT_COUNTED,
    is_counted,
    told_in_words,
)
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.oracle.settings.failure_rule import RULE, rule_in

from ...wording import event_words
from ..shapes.basics import ByPath, ByState
from ..shapes.robots import LearnedRateView
from ..shapes.trials import TrialEventView

LONGEST_LINE = 300
LATEST_S = 1e11  # s since the epoch: a later time is not valid
_KINDS = {int(kind): kind for kind in EventKind}


def event_of(message: OracleEvent) -> Event:
    """Return the event as the executive emitted it. Of its data only what the console needs."""
    kind: Any = _KINDS.get(message.kind, message.kind)
    data: Optional[Dict[str, Any]] = None
    if kind == EventKind.TRIAL_START:
        data = {'recovers': '"recovers": false' not in message.data, **_rule_in(message.data)}
    elif kind == EventKind.RESUMED:
        data = {**_told(message.data, LAST_SEQ), **_rule_in(message.data)}
    elif kind == EventKind.CONTAINER_START:
        data = _told(message.data, BRANCHES)
    elif kind == EventKind.TRANSITION and NOT_COUNTED in message.data:
        data = {NOT_COUNTED: True}
    elif kind in (EventKind.JUMP, EventKind.DECISION):
        data = told_in_words(parsed(message.data))
    time_s = message.wall_time if 0 <= message.wall_time <= LATEST_S else 0.0  # NaN is neither
    return Event(
        kind,
        message.trial_id,
        message.seq,
        time_s,
        message.path,
        message.state,
        message.outcome,
        message.target,
        message.failure_kind,
        message.failure_class,
        message.rate,
        message.continuous,
        message.query_id,
        message.by,
        message.text,
        data,
    )


def parsed(data: str) -> Any:
    """Return what a text of JSON says, None where it is no JSON."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        return None


def _told(data: str, name: str) -> Dict[str, Any]:
    """One of the facts in the data of an event, where it is there."""
    found = parsed(data) if name in data else None
    return {name: found[name]} if isinstance(found, dict) and name in found else {}


def _rule_in(data: str) -> Dict[str, Any]:
    """The rule that tells failures, where the data of an event name one."""
    rule = rule_in(parsed(data))
    return {} if rule is None else {RULE: rule.as_data()}


def event_view(event: Event) -> TrialEventView:
    """Return one event of a trial's time axis."""
    return {
        'seq': event.seq,
        'kind': getattr(event.kind, 'name', str(event.kind)).lower(),
        't': event.wall_time,
        'path': event.path,
        'state': event.state,
        'outcome': event.outcome,
        'target': event.target,
        'class': event.failure_class,
        'rate': number(event.rate),
        'continuous': event.continuous,
        'counted': is_counted(event),
        'query': event.query_id,
        'by': event.by,
        'text': last_line(event.text),
        'words': event_words(event),
    }


def last_line(text: str) -> str:
    """Return the line that says what happened, of a traceback."""
    return shortened(text.strip().rpartition('\n')[2], LONGEST_LINE)


def rates_view(message: OracleRates) -> ByPath[ByState[LearnedRateView]]:
    """Return the learned rates: container path -> label -> rate, class and counts."""
    found: ByPath[ByState[LearnedRateView]] = {}
    for row in message.states:
        found.setdefault(row.path, {})[row.state] = {
            'rate': number(row.rate),
            'class': row.failure_class,
            'successes': row.successes,
            'failures': row.failures,
            'recoveries': row.recoveries,
            'preconditions': row.has_preconditions,
        }
    return found


def number(value: float, digits: int = 4) -> Optional[float]:
    """Return a number that JSON knows: rounded to some digits, or None for what is not finite."""
    return round(float(value), digits) if math.isfinite(value) else None
