"""Which means the scripted operator uses for which state, from its settings. Pure.

    states:
      PICK: {means: take, arm: right, what: objects, otherwise: DETECT_TABLETOP}
      default: {means: retry}
"""
from typing import Any, Dict, List, Mapping, NamedTuple, Sequence

from smach_oracle.oracle.errors import ConfigError

DEFAULT = 'default'
SHOW, TAKE, PUT_DOWN, RETRY = 'show', 'take', 'put_down', 'retry'
# and the interface of each, by the name under which the oracle's settings offer it
MEANS = {SHOW: 'perception', TAKE: 'manipulation', PUT_DOWN: 'manipulation', RETRY: ''}
_TEXTS = ('means', 'arm', 'what', 'place', 'onto', 'hidden', 'lost', 'otherwise', 'leave')
_ROUNDS = 2  # of tries and going back, before a state is left undone


class Means(NamedTuple):
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
    leave: str = ''  # state to go on to, this one left undone, where all that was tried twice; '' : never
    tries: int = 2


class Plans:
    """Means by the label of the failed state."""

    def __init__(self, settings: Any) -> None:
        """`settings`: a mapping as YAML gives it.

        :raises ConfigError: naming the key, its value and what is allowed.
        """
        if not isinstance(settings, Mapping):
            raise ConfigError('states', settings, 'a mapping from states to means')
        self._means: Dict[str, Means] = {state: _means(state, value) for state, value in settings.items()}
        self._means.setdefault(DEFAULT, Means(RETRY))

    def of(self, state: str) -> Means:
        """The means for a state."""
        return self._means.get(state, self._means[DEFAULT])


class Decision(NamedTuple):
    """What to answer; neither interface nor state: give up."""

    interface: str = ''  # start this one
    goto: str = ''  # or go to this state
    why: str = ''


class Situation(NamedTuple):
    """What a decision needs to know of a question."""

    state: str
    states: List[str]  # that can be entered now
    interfaces: List[str]  # on offer
    tried: int  # how often this state was asked about in this trial before
    holds: bool  # the hand of the means holds something
    seen: bool  # what there is to show can be seen


def missing(means: Means, offered: Sequence[str]) -> str:
    """The interface that the means need, where it is not offered, else ''."""
    return '' if MEANS[means.means] in offered else MEANS[means.means]


def decide(means: Means, situation: Situation) -> Decision:
    """The answer to a question."""
    def go(state: str, why: str) -> Decision:
        return Decision(goto=next((each for each in (state, situation.state) if each in situation.states), ''), why=why)

    interface = MEANS[means.means]
    if means.leave and situation.tried >= _ROUNDS * (means.tries + 1):
        return go(means.leave, 'it is left as it is')
    if interface not in situation.interfaces:
        tired = situation.tried % (means.tries + 1) == means.tries
        return go(means.otherwise if tired else '', 'once more' if not tired else 'from further back')
    if means.means == SHOW and not situation.seen:
        return go(means.hidden or means.otherwise, 'nothing of it can be seen')
    if means.means == PUT_DOWN and not situation.holds:
        return go(means.lost or means.otherwise, 'the hand holds nothing')
    if situation.tried % (means.tries + 1) == means.tries:
        return go(means.otherwise, 'it did not work by hand')
    return Decision(interface=interface)


def _means(state: str, value: Any) -> Means:
    if not isinstance(value, Mapping):
        raise ConfigError(state, value, 'a mapping with means')
    unknown = sorted(str(field) for field in value if field not in Means._fields)
    if unknown:
        raise ConfigError('{}.{}'.format(state, unknown[0]), value[unknown[0]], 'the keys ' + ', '.join(Means._fields))
    if not isinstance(value.get('means'), str) or value['means'] not in MEANS:
        raise ConfigError(state + '.means', value.get('means'), ', '.join(sorted(MEANS)))
    for field in _TEXTS:
        if not isinstance(value.get(field, ''), str):
            raise ConfigError('{}.{}'.format(state, field), value[field], 'a name')
    if value.get('arm', 'right') not in ('left', 'right'):
        raise ConfigError(state + '.arm', value['arm'], 'left, right')
    if value['means'] == PUT_DOWN and bool(value.get('place')) == bool(value.get('onto')):
        raise ConfigError(state, dict(value), 'either place or onto')
    tries = value.get('tries', 2)
    if isinstance(tries, bool) or not isinstance(tries, int) or not 1 <= tries <= 20:
        raise ConfigError(state + '.tries', tries, 'a number from 1 to 20')
    if not isinstance(value.get('inside', False), bool):
        raise ConfigError(state + '.inside', value['inside'], 'true or false')
    return Means(**value)
