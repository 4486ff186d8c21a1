"""An open question as plain data for the page. Pure."""

import math
from typing import Callable, Dict, Iterable, List, Sequence, Union

from smach_oracle.msg import ExpertQueryGoal, OpenQuery, StateChoice, UserdataItem, VisitedState
from smach_oracle.oracle.records.events import FailureKind
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.oracle.records.visits import Visit
from smach_oracle.oracle.settings.failure_rule import EndMeaning, FailureRule
from smach_oracle.ros.userdata_codec import UserdataCodecError, decode

from ...followed_server import ListedQuestion
from ...wording import failure_words, standing_words, still_runs
from ..feeds.views import number
from ..shapes.questions import (
    OutcomeChoiceView,
    QuestionStatus,
    QuestionView,
    StateChoiceView,
    UserdataItemView,
    VisitResult,
    VisitView,
)
from ..trials.recovery_statistics import RecoveryCounts
from ..trials.ways import Level

LONGEST_TEXT = 8000
LONGEST_VALUE = 4000
_VISITS: Dict[int, VisitResult] = {1: 'success', 2: 'failure', 3: 'superseded', 4: 'preempted'}
_FAILED_BY_OUTCOME = (FailureKind.FAILING_OUTCOME, FailureKind.FELL_THROUGH)
_STATUS: Dict[int, QuestionStatus] = {
    OpenQuery.PENDING: 'pending',
    OpenQuery.CLAIMED: 'claimed',
    OpenQuery.INTERFACE_RUNNING: 'interface',
}


def question_view(
    listed: ListedQuestion,
    epoch_s: float,
    recovery_counts: Callable[[str], RecoveryCounts],
    rule: FailureRule,
    above: Sequence[Level] = (),
) -> QuestionView:
    """Return one open question with all that is known of it.

    :param epoch_s: what to add to this process's monotonic clock to have s since the epoch.
    :param recovery_counts: how often going to a state has helped.
    :param rule: tells which outcomes are failures.
    :param above: the containers around that of the failed state, the outermost first.
    """
    goal = listed.goal
    return {
        'key': listed.key,
        'server': listed.server,
        'id': goal.query_id,
        'trial': goal.trial_id,
        'robot': goal.robot,
        'path': goal.container_path,
        'state': goal.failed_state,
        'stands': standing_words(goal),
        'running': still_runs(goal),
        'what': failure_words(goal),
        'outcome': goal.outcome,
        'text': shortened(goal.text, LONGEST_TEXT),
        'class': goal.failure_class,
        'rate': number(goal.rate),
        'continuous': goal.continuous,
        'recoveries': goal.recoveries,
        'reason': goal.reason,
        'tried': list(goal.tried),
        'status': _STATUS.get(listed.status, 'pending'),
        'holder': listed.holder,
        'session': '',
        'idle': 0,
        'interface': goal.interface,
        'asked': round(epoch_s + listed.asked_s, 1),
        'deadline': None
        if listed.deadline_s == math.inf
        else round(epoch_s + listed.deadline_s, 1),
        'fallback': goal.fallback,
        'history': _visits(goal.history),
        'above': [
            {
                'path': level.path,
                'state': level.state,
                'visits': _visits(level.visits),
                'missing': level.missing,
            }
            for level in above
        ],
        'choices': _choices(goal, recovery_counts),
        'supersede': _supersede(goal, rule),
        'outputs': list(goal.output_keys),
        'give_up': list(goal.give_up_outcomes),
        'give_up_above': [
            {'container': each.container, 'outcome': each.outcome} for each in goal.give_up_above
        ],
        'interfaces': [
            {'name': offer.name, 'description': offer.description} for offer in goal.interfaces
        ],
        'userdata': [_item(item) for item in goal.userdata],
    }


def _visits(visits: Iterable[Union[VisitedState, Visit]]) -> List[VisitView]:
    return [
        {'state': visit.state, 'outcome': visit.outcome, 'result': _VISITS.get(visit.result, '')}
        for visit in visits
    ]


def _choices(
    goal: ExpertQueryGoal, recovery_counts: Callable[[str], RecoveryCounts]
) -> List[StateChoiceView]:
    return [
        {
            'state': choice.state,
            'container': choice.container,
            'success': number(choice.predicted_success),
            'class': choice.failure_class,
            'visits': choice.visits,
            'missing': list(choice.missing_keys),
            'preconditions': list(choice.preconditions),
            'blocked': choice.blocked,
            'repeats': list(choice.repeats),
            'runs_again': list(choice.runs_again),
            'helped': _helped(choice, recovery_counts),
            'helped_s': number(choice.helped_s) if choice.tried else None,
            'recommended': choice.recommended,
        }
        for choice in goal.choices
    ]


def _helped(
    choice: StateChoice, recovery_counts: Callable[[str], RecoveryCounts]
) -> RecoveryCounts:
    """Return how often going there has helped: as the robot knows it, else as this console saw."""
    if choice.tried:
        return RecoveryCounts(choice.helped, choice.tried)
    return RecoveryCounts(0, 0) if choice.container else recovery_counts(choice.state)


def _supersede(goal: ExpertQueryGoal, rule: FailureRule) -> List[OutcomeChoiceView]:
    """First those with which the machine goes on. Each with what it means of the state's work."""
    states = {choice.state for choice in goal.choices if not choice.container}
    return [
        {
            'outcome': choice.outcome,
            'target': choice.target,
            'meaning': _meaning(choice.outcome, goal, rule),
        }
        for choice in sorted(
            goal.supersede_outcomes, key=lambda choice: choice.target not in states
        )
    ]


def _meaning(outcome: str, goal: ExpertQueryGoal, rule: FailureRule) -> str:
    if outcome and outcome == goal.outcome and goal.failure_kind in _FAILED_BY_OUTCOME:
        return EndMeaning.FAILURE.value  # whatever its name
    return rule.meaning(outcome).value


def _item(item: UserdataItem) -> UserdataItemView:
    """A key of the userdata: its type, and its value as text where it was sent."""
    if item.encoding == UserdataItem.UNSENT:
        return {'key': item.key, 'type': item.type, 'value': '', 'note': 'not sent'}
    try:
        if item.encoding == UserdataItem.JSON:
            return {
                'key': item.key,
                'type': '',
                'value': bytes(item.value).decode('utf-8')[:LONGEST_VALUE],
                'note': '',
            }
        value = decode(item)
        text = '\n---\n'.join(map(str, value)) if isinstance(value, list) else str(value)
        kind = item.type + ('[]' if isinstance(value, list) else '')
        return {'key': item.key, 'type': kind, 'value': text[:LONGEST_VALUE], 'note': ''}
    except (UserdataCodecError, UnicodeDecodeError) as err:
        return {
            'key': item.key,
            'type': item.type,
            'value': '',
            'note': 'cannot be shown: {}'.format(err),
        }
