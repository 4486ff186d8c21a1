"""The scripted operator's plan for each state, from its settings.

Pure.

    states:
      PICK: {means: take, arm: right, what: objects, otherwise: DETECT_TABLETOP}
      default: {means: retry}
"""

import math
from typing import Dict, Mapping, NamedTuple, Sequence, Tuple

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks
from smach_oracle.oracle.settings.checks import choice, flag, whole

DEFAULT = 'default'
SHOW, TAKE, PUT_DOWN, RETRY = 'show', 'take', 'put_down', 'retry'
# means, and the interface of each by the name under which the oracle's settings offer it
MEANS = {SHOW: 'perception', TAKE: 'manipulation', PUT_DOWN: 'manipulation', RETRY: ''}
_TEXTS = ('means', 'arm', 'what', 'place', 'onto', 'hidden', 'lost', 'otherwise', 'leave', 'again')
_MOST_POINTS = 10
Point = Tuple[float, float, float]


class StatePlan(NamedTuple):
    """The plan for a failed state."""

    means: str  # one of MEANS
    arm: str = 'right'  # take, put_down: with which
    what: str = ''  # take: userdata key of the detected pose or poses. '' : whatever is nearest
    place: str = ''  # put_down: userdata key of the pose where it should stand
    onto: str = ''  # put_down: or name of the body on whose top it should stand
    # show, take: in a shelf. The hand goes in level and straight back, and nothing is moved there
    inside: bool = False
    hidden: str = ''  # show: state to go to where nothing of it can be seen
    lost: str = ''  # put_down: state to go to where the hand holds nothing
    otherwise: str = ''  # state to go to after `tries` tries; '' : the failed one itself
    # retry: state to go on to, this one left undone, where little else is left; '' : never
    leave: str = ''
    # state to go to where this one should be tried again, once somebody has looked about with the
    # robot's head; '' : the failed one itself
    again: str = ''
    tries: int = 2
    # m, m, rad along its own axes, by which the base is driven, where nothing else helps. 0 means
    # never
    base: Point = (0.0, 0.0, 0.0)
    look: Tuple[Point, ...] = ()  # m, base_footprint: where a person looks for the thing
    keep: Tuple[Point, ...] = ()  # likewise: where nothing is put that is moved aside


class StatePlans:
    """Plans by the label of the failed state."""

    def __init__(self, settings: object) -> None:
        """`settings`: a mapping as YAML gives it.

        :raises SettingsError: naming the key, its value and what is allowed.
        """
        if not isinstance(settings, Mapping):
            raise SettingsError('states', settings, 'a mapping from states to means')
        self._plans: Dict[str, StatePlan] = {
            state: _plan(state, value) for state, value in settings.items()
        }
        self._plans.setdefault(DEFAULT, StatePlan(RETRY))

    def of(self, state: str) -> StatePlan:
        """The plan for a state."""
        return self._plans.get(state, self._plans[DEFAULT])


def missing(plan: StatePlan, offered: Sequence[str]) -> str:
    """The interface that the plan needs, where it is not offered, else ''."""
    return '' if MEANS[plan.means] in offered else MEANS[plan.means]


def _plan(state: str, value: object) -> StatePlan:
    if not isinstance(value, Mapping):
        raise SettingsError(state, value, 'a mapping with means')
    unknown = sorted(str(field) for field in value if field not in StatePlan._fields)
    if unknown:
        raise SettingsError(
            '{}.{}'.format(state, unknown[0]),
            value[unknown[0]],
            'the keys ' + ', '.join(StatePlan._fields),
        )
    choice(sorted(MEANS))(state + '.means', value.get('means'))
    for field in _TEXTS:
        if not isinstance(value.get(field, ''), str):
            raise checks.no_name('{}.{}'.format(state, field), value[field], 'a name')
    choice(('left', 'right'))(state + '.arm', value.get('arm', 'right'))
    if value['means'] == PUT_DOWN and bool(value.get('place')) == bool(value.get('onto')):
        raise SettingsError(state, dict(value), 'either place or onto')
    whole(1, 'a number from 1 to 20', 20)(state + '.tries', value.get('tries', 2))
    flag(state + '.inside', value.get('inside', False))
    return StatePlan(
        **dict(
            value,
            base=_point(state + '.base', value.get('base', [0, 0, 0])),
            look=_points(state + '.look', value.get('look', [])),
            keep=_points(state + '.keep', value.get('keep', [])),
        )
    )


def _points(key: str, value: object) -> Tuple[Point, ...]:
    if not isinstance(value, (list, tuple)) or len(value) > _MOST_POINTS:
        raise SettingsError(key, value, 'a list of up to {} points'.format(_MOST_POINTS))
    return tuple(_point(key, each) for each in value)


def _point(key: str, value: object) -> Point:
    numbers = value if isinstance(value, (list, tuple)) else ()
    if len(numbers) != 3 or any(
        isinstance(each, bool)
        or not isinstance(each, (int, float))
        or not math.isfinite(each)
        or abs(each) > 5
        for each in numbers
    ):
        raise SettingsError(key, value, 'three numbers from -5 to 5')
    x, y, z = (float(each) for each in numbers)
    return x, y, z
