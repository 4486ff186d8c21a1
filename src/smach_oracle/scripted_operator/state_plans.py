"""What the scripted operator does about which state, from its settings. Pure.

    states:
      PICK: {means: take, arm: right, what: objects, otherwise: DETECT_TABLETOP}
      default: {means: retry}
"""
from typing import Dict, List, Mapping, NamedTuple, Sequence

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.checks import choice, flag, whole

DEFAULT = 'default'
SHOW, TAKE, PUT_DOWN, RETRY = 'show', 'take', 'put_down', 'retry'
# means, and the interface of each by the name under which the oracle's settings offer it
MEANS = {SHOW: 'perception', TAKE: 'manipulation', PUT_DOWN: 'manipulation', RETRY: ''}
_TEXTS = ('means', 'arm', 'what', 'place', 'onto', 'hidden', 'lost', 'otherwise', 'leave')
_ROUNDS = 2  # of tries and going back, before a state is left undone


class StatePlan(NamedTuple):
    """What to do about a failed state."""

    means: str  # one of MEANS
    arm: str = 'right'  # take, put_down: with which
    what: str = ''  # take: userdata key of the detected pose or poses; '' : whatever is nearest
    place: str = ''  # put_down: userdata key of the pose where it shall stand
    onto: str = ''  # put_down: or name of the body on whose top it shall stand
    inside: bool = False  # take: out of a shelf, level and straight back
    hidden: str = ''  # show: state to go to where nothing of it can be seen
    lost: str = ''  # put_down: state to go to where the hand holds nothing
    otherwise: str = ''  # state to go to after `tries` tries; '' : the failed one itself
    # state to go on to, this one left undone, where all that was tried twice; '' : never
    leave: str = ''
    tries: int = 2


class StatePlans:
    """Plans by the label of the failed state."""

    def __init__(self, settings: object) -> None:
        """`settings`: a mapping as YAML gives it.

        :raises SettingsError: naming the key, its value and what is allowed.
        """
        if not isinstance(settings, Mapping):
            raise SettingsError('states', settings, 'a mapping from states to means')
        self._plans: Dict[str, StatePlan] = {
            state: _plan(state, value)
            for state, value in settings.items()
        }
        self._plans.setdefault(DEFAULT, StatePlan(RETRY))

    def of(self, state: str) -> StatePlan:
        """The plan for a state."""
        return self._plans.get(state, self._plans[DEFAULT])


class OperatorAnswer(NamedTuple):
    """An answer; with neither interface nor state it gives up."""

    interface: str = ''  # start this one
    goto: str = ''  # or go to this state
    why: str = ''


class QuestionFacts(NamedTuple):
    """The facts about a question that decide its answer."""

    state: str
    states: List[str]  # that can be entered now
    interfaces: List[str]  # on offer
    tried: int  # how often this state was asked about in this trial before
    holds: bool  # the hand of the plan holds something
    seen: bool  # the thing to show can be seen


def missing(plan: StatePlan, offered: Sequence[str]) -> str:
    """The interface that the plan needs, where it is not offered, else ''."""
    return '' if MEANS[plan.means] in offered else MEANS[plan.means]


def choose_answer(plan: StatePlan, question: QuestionFacts) -> OperatorAnswer:
    """The answer to a question."""
    def go(state: str, why: str) -> OperatorAnswer:
        return OperatorAnswer(
            goto=next((each for each in (state, question.state) if each in question.states), ''),
            why=why)

    interface = MEANS[plan.means]
    if plan.leave and question.tried >= _ROUNDS * (plan.tries + 1):
        return go(plan.leave, 'it is left as it is')
    if interface not in question.interfaces:
        tired = question.tried % (plan.tries + 1) == plan.tries
        return go(plan.otherwise if tired else '',
                  'once more' if not tired else 'from further back')
    if plan.means == SHOW and not question.seen:
        return go(plan.hidden or plan.otherwise, 'nothing of it can be seen')
    if plan.means == PUT_DOWN and not question.holds:
        return go(plan.lost or plan.otherwise, 'the hand holds nothing')
    if question.tried % (plan.tries + 1) == plan.tries:
        return go(plan.otherwise, 'it did not work by hand')
    return OperatorAnswer(interface=interface)


def _plan(state: str, value: object) -> StatePlan:
    if not isinstance(value, Mapping):
        raise SettingsError(state, value, 'a mapping with means')
    unknown = sorted(str(field) for field in value if field not in StatePlan._fields)
    if unknown:
        raise SettingsError('{}.{}'.format(state, unknown[0]), value[unknown[0]],
                          'the keys ' + ', '.join(StatePlan._fields))
    choice(sorted(MEANS))(state + '.means', value.get('means'))
    for field in _TEXTS:
        if not isinstance(value.get(field, ''), str):
            raise SettingsError('{}.{}'.format(state, field), value[field], 'a name')
    choice(('left', 'right'))(state + '.arm', value.get('arm', 'right'))
    if value['means'] == PUT_DOWN and bool(value.get('place')) == bool(value.get('onto')):
        raise SettingsError(state, dict(value), 'either place or onto')
    whole(1, 'a number from 1 to 20', 20)(state + '.tries', value.get('tries', 2))
    flag(state + '.inside', value.get('inside', False))
    return StatePlan(**value)
