"""The setting `healthy`: conditions for the robot to be well. Pure.

A topic, a status of the diagnostics, or a function. In YAML a list of them, or one alone:
{topic: /motors_on}, {diagnostics: Power System}, {function: 'python:module:attribute'}.
"""

import math
import re
from enum import Enum
from typing import Callable, List, Mapping, NamedTuple, Optional, Tuple, Union

from ..errors import SettingsError
from ..identity import name_of
from . import checks as values
from .checks import PYTHON, Resolver, named_object
from .written import as_text, as_value

# no arguments. True or '' is well, else what is wrong
HealthFunction = Callable[[], Union[bool, str]]
WORST = ('ok', 'warn')
_FIELD = re.compile(r'[A-Za-z_]\w*(\.\w+)*')
_ALLOWED = 'a mapping with one of the keys topic, diagnostics and function'
_NUMBER = values.number(-math.inf, math.inf, 'a number')
_TOPIC = values.graph_name('the name of a topic, such as /motors_on')
_AGE = values.number(0.001, math.inf, 'seconds from 0.001')


class HealthKind(Enum):
    """Kinds of condition."""

    TOPIC = 'topic'
    DIAGNOSTICS = 'diagnostics'
    FUNCTION = 'function'


class HealthCondition(NamedTuple):
    """One condition: what it looks at, and when the robot is well by it."""

    kind: HealthKind
    name: str  # what people call it
    source: str = ''  # the topic, or the name of the status in the diagnostics
    field: str = 'data'  # of the topic's messages, dotted
    equals: object = None  # bool, number or text. None means the limits count
    at_least: float = -math.inf
    at_most: float = math.inf
    max_age_s: Optional[float] = None  # what is older, or was never received, is unwell
    worst: str = 'warn'  # the highest level of the diagnostics that is still well
    function: Optional[HealthFunction] = None


_KEYS = {
    HealthKind.TOPIC: ('topic', 'field', 'equals', 'at_least', 'at_most', 'name', 'max_age_s'),
    HealthKind.DIAGNOSTICS: ('diagnostics', 'worst', 'name', 'max_age_s'),
    HealthKind.FUNCTION: ('function', 'name'),
}


def checked_health(
    key: str, given: object, resolver: Optional[Resolver] = None
) -> Tuple[HealthCondition, ...]:
    """Check the conditions. `resolver` turns 'python:module:attribute' into that object.

    :raises SettingsError: naming key, value and what is allowed.
    """
    if as_value(given) is None:
        return ()
    if isinstance(given, Mapping):
        return (_condition(key, given, resolver),)
    if not isinstance(given, (list, tuple)):
        raise SettingsError(key, given, 'a list of conditions, or one')
    return tuple(
        _condition('{}[{}]'.format(key, index), entry, resolver)
        for index, entry in enumerate(given)
    )


def _condition(key: str, given: object, resolver: Optional[Resolver]) -> HealthCondition:
    if isinstance(given, HealthCondition):
        return given
    if not isinstance(given, Mapping):
        raise SettingsError(key, given, _ALLOWED)
    entry = values.mapping(key, given)
    kinds = [kind for kind in HealthKind if kind.value in entry]
    if len(kinds) != 1:
        raise SettingsError(key, dict(entry), _ALLOWED)
    kind = kinds[0]
    values.section(key, entry, _KEYS[kind])
    prefix = key + '.'
    make = {HealthKind.TOPIC: _topic, HealthKind.DIAGNOSTICS: _diagnostics}.get(kind)
    made = make(prefix, entry) if make else _function(prefix, entry, resolver)
    if 'name' in entry:
        made = made._replace(name=values.label(prefix + 'name', entry['name']))
    if 'max_age_s' in entry:
        made = made._replace(max_age_s=_AGE(prefix + 'max_age_s', entry['max_age_s']))
    return made


def _topic(prefix: str, entry: Mapping[str, object]) -> HealthCondition:
    topic = _TOPIC(prefix + 'topic', entry['topic'])
    field = as_text(entry.get('field', 'data'))
    if not isinstance(field, str) or not _FIELD.fullmatch(field):
        raise SettingsError(
            prefix + 'field', field, 'a field of the message, such as data or status.level'
        )
    made = HealthCondition(HealthKind.TOPIC, topic.strip('/'), topic, field)
    return _wanted(prefix, entry, made)


def _wanted(prefix: str, entry: Mapping[str, object], made: HealthCondition) -> HealthCondition:
    """Add what the field must be: `equals`, or limits. True where nothing is said."""
    if not any(name in entry for name in ('at_least', 'at_most')):
        return made._replace(equals=_plain(prefix + 'equals', entry.get('equals', True)))
    if 'equals' in entry:
        raise SettingsError(
            prefix + 'equals', entry['equals'], 'equals, or at_least and at_most, not both'
        )
    at_least, at_most = (
        _NUMBER(prefix + name, entry[name]) if name in entry else none
        for name, none in (('at_least', -math.inf), ('at_most', math.inf))
    )
    if at_least > at_most:
        raise SettingsError(
            prefix + 'at_least', at_least, 'at most at_most, which is {:g}'.format(at_most)
        )
    return made._replace(at_least=at_least, at_most=at_most)


def _plain(key: str, value: object) -> object:
    value = as_value(value)
    if isinstance(value, (bool, str)):
        return value
    return _plain_number(key, value)


_plain_number = values.number(-math.inf, math.inf, 'true, false, a number or a text')


def _diagnostics(prefix: str, entry: Mapping[str, object]) -> HealthCondition:
    source = values.label(prefix + 'diagnostics', entry['diagnostics'])
    worst = values.choice(WORST)(prefix + 'worst', entry.get('worst', 'warn'))
    return HealthCondition(HealthKind.DIAGNOSTICS, source.strip('/') or source, source, worst=worst)


def _function(
    prefix: str, entry: Mapping[str, object], resolver: Optional[Resolver]
) -> HealthCondition:
    given = entry['function']
    key, name, found = prefix + 'function', '', given
    if isinstance(given, str):
        if not given.startswith(PYTHON):
            raise SettingsError(key, given, "'python:module:attribute'")
        if resolver is None:
            raise SettingsError(key, given, 'a function, since names cannot be imported here')
        name = given.rpartition(':')[2]
        found = named_object(key, given, 'function', resolver)
    if not callable(found) or isinstance(found, type) or values.is_state(found):
        raise SettingsError(
            key,
            given,
            "'python:module:attribute' of a function without arguments, or such a function",
        )
    return HealthCondition(HealthKind.FUNCTION, name or name_of(found), function=found)


def sources_of(conditions: Tuple[HealthCondition, ...]) -> List[str]:
    """Return what must be listened to, in words. Functions are called instead."""
    return [
        '{} {}'.format(condition.kind.value, condition.source)
        for condition in conditions
        if condition.kind is not HealthKind.FUNCTION
    ]
