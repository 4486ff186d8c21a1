"""ROS messages as plain data for the page. Pure: what a robot says is passed on as text, never as markup."""
import math
from typing import Any, Callable, Dict, List, Optional

from smach_oracle.msg import ExpertQueryGoal, OpenQuery, OracleEvent, OracleRates, UserdataItem

from ...oracle.events import Event, EventKind
from ...ros.userdata_codec import UserdataCodecError, decode
from ..followed_server import Listed
from ..render import what_failed, what_happened
from .helped import Score

LONGEST_TEXT = 8000
LONGEST_VALUE = 4000
_KINDS = {int(kind): kind for kind in EventKind}
_VISITS = {1: 'success', 2: 'failure', 3: 'superseded', 4: 'preempted'}
_STATUS = {OpenQuery.PENDING: 'pending', OpenQuery.CLAIMED: 'claimed', OpenQuery.INTERFACE_RUNNING: 'interface'}


def event_of(message: OracleEvent) -> Event:
    """The event as the executive emitted it, without its data but for what a trial's start tells."""
    kind: Any = _KINDS.get(message.kind, message.kind)
    data = {'recovers': '"recovers": false' not in message.data} if kind == EventKind.TRIAL_START else None
    return Event(kind, message.trial_id, message.seq, message.wall_time, message.path, message.state, message.outcome,
                 message.target, message.failure_kind, message.failure_class, message.rate, message.continuous,
                 message.query_id, message.by, message.text, data)


def event_view(event: Event) -> Dict[str, Any]:
    """One event of a trial's time axis."""
    return {'seq': event.seq, 'kind': getattr(event.kind, 'name', str(event.kind)).lower(), 't': event.wall_time,
            'path': event.path, 'state': event.state, 'outcome': event.outcome, 'target': event.target,
            'class': event.failure_class, 'rate': number(event.rate), 'continuous': event.continuous,
            'query': event.query_id, 'by': event.by, 'text': event.text[:LONGEST_TEXT], 'words': words(event)}


def words(event: Event) -> str:
    """What happened, in a sentence."""
    by = ' by ' + event.by if event.by else ''
    said = {
        EventKind.TRIAL_START: lambda: 'The trial of {} began.'.format(event.path),
        EventKind.CONTAINER_START: lambda: '{} began in {}.'.format(event.path, event.state),
        EventKind.CONTAINER_END: lambda: '{} ended{}.'.format(event.path, _with(event.outcome)),
        EventKind.TRANSITION: lambda: '{} ended{}; next: {}.'.format(event.state, _with(event.outcome), event.target),
        EventKind.FAILURE: lambda: '{} failed{}.'.format(event.state, _with(event.outcome)),
        EventKind.PRECONDITION_START: lambda: 'Precondition {} of {} is made to hold.'.format(
            event.target, event.state),
        EventKind.PRECONDITION_END: lambda: 'Precondition {} of {}: {}.'.format(
            event.target, event.state, event.outcome),
        EventKind.DECISION: lambda: 'The oracle decides: {}{}.'.format(
            event.outcome.replace('_', ' '), ' to ' + event.target if event.target else ''),
        EventKind.QUERY_OPENED: lambda: 'The expert is asked about {}.'.format(event.state),
        EventKind.QUERY_CLAIMED: lambda: 'The question was taken{}.'.format(by),
        EventKind.QUERY_RELEASED: lambda: 'The question was given back{}.'.format(by),
        EventKind.QUERY_ANSWERED: lambda: 'The question was answered{}: {}{}.'.format(
            by, event.outcome.replace('_', ' '), ' ' + event.target if event.target else ''),
        EventKind.QUERY_EXPIRED: lambda: 'Nobody answered in time.',
        EventKind.QUERY_CANCELLED: lambda: 'The question was taken back.',
        EventKind.PREEMPT: lambda: '{} was asked to stop.'.format(event.path),
    }.get(event.kind)
    return said() if said else what_happened(event)


def rates_view(message: OracleRates) -> Dict[str, Dict[str, Dict[str, Any]]]:
    """Container path -> label -> what was learned."""
    found: Dict[str, Dict[str, Dict[str, Any]]] = {}
    for row in message.states:
        found.setdefault(row.path, {})[row.state] = {
            'rate': number(row.rate), 'class': row.failure_class, 'successes': row.successes,
            'failures': row.failures, 'recoveries': row.recoveries, 'preconditions': row.has_preconditions}
    return found


def question_view(listed: Listed, epoch_s: float, score: Callable[[str], Score]) -> Dict[str, Any]:
    """One open question with all that is known of it.

    :param epoch_s: what to add to this process's monotonic clock to have s since the epoch.
    :param score: how often going to a state has helped.
    """
    goal = listed.goal
    return {
        'key': listed.key, 'server': listed.server, 'id': goal.query_id, 'trial': goal.trial_id, 'robot': goal.robot,
        'path': goal.container_path, 'state': goal.failed_state, 'what': what_failed(goal),
        'outcome': goal.outcome, 'text': _end(goal.text), 'class': goal.failure_class, 'rate': number(goal.rate),
        'continuous': goal.continuous, 'recoveries': goal.recoveries, 'reason': goal.reason,
        'tried': list(goal.tried), 'status': _STATUS.get(listed.status, 'pending'), 'holder': listed.holder,
        'interface': goal.interface, 'asked': round(epoch_s + listed.asked_s, 1),
        'deadline': None if listed.deadline_s == math.inf else round(epoch_s + listed.deadline_s, 1),
        'fallback': goal.fallback, 'history': [
            {'state': visit.state, 'outcome': visit.outcome, 'result': _VISITS.get(visit.result, '')}
            for visit in goal.history],
        'choices': _choices(goal, score),
        'supersede': _supersede(goal), 'outputs': list(goal.output_keys), 'give_up': list(goal.give_up_outcomes),
        'interfaces': [{'name': offer.name, 'description': offer.description} for offer in goal.interfaces],
        'userdata': [_item(item) for item in goal.userdata]}


def number(value: float) -> Optional[float]:
    """A number that JSON knows."""
    return round(float(value), 4) if math.isfinite(value) else None


def _choices(goal: ExpertQueryGoal, score: Callable[[str], Score]) -> List[Dict[str, Any]]:
    return [{'state': choice.state, 'success': number(choice.predicted_success), 'class': choice.failure_class,
             'visits': choice.visits, 'missing': list(choice.missing_keys),
             'preconditions': list(choice.preconditions), 'blocked': choice.blocked,
             'helped': list(score(choice.state))} for choice in goal.choices]


def _supersede(goal: ExpertQueryGoal) -> List[Dict[str, str]]:
    """First those with which the machine goes on."""
    states = {choice.state for choice in goal.choices}
    return [{'outcome': choice.outcome, 'target': choice.target}
            for choice in sorted(goal.supersede_outcomes, key=lambda choice: choice.target not in states)]


def _item(item: UserdataItem) -> Dict[str, str]:
    """A key of the userdata: its type, and its value as text where it was sent."""
    if item.encoding == UserdataItem.UNSENT:
        return {'key': item.key, 'type': item.type, 'value': '', 'note': 'not sent'}
    try:
        if item.encoding == UserdataItem.JSON:
            return {'key': item.key, 'type': '', 'value': bytes(item.value).decode('utf-8')[:LONGEST_VALUE], 'note': ''}
        value = decode(item)
        text = '\n---\n'.join(map(str, value)) if isinstance(value, list) else str(value)
        kind = item.type + ('[]' if isinstance(value, list) else '')
        return {'key': item.key, 'type': kind, 'value': text[:LONGEST_VALUE], 'note': ''}
    except (UserdataCodecError, UnicodeDecodeError) as err:
        return {'key': item.key, 'type': item.type, 'value': '', 'note': 'cannot be shown: {}'.format(err)}


def _with(outcome: str) -> str:
    return ' with ' + outcome if outcome else ''


def _end(text: str) -> str:
    """The end of a long text: of a traceback that is the part that says something."""
    return text if len(text) <= LONGEST_TEXT else '…' + text[-LONGEST_TEXT:]
