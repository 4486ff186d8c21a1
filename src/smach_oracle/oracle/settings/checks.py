"""Checks of settings, from single numbers to a budget. Pure.

Each takes the dotted key and the value, and returns the value or raises SettingsError. A setting is
stated once: its default, its check and its text are one field of a dataclass::

    @dataclass(frozen=True)
    class Oven:
        heat: float = setting(180.0, number(0, 300, 'degrees from 0 to 300'), 'how hot it is')

    Oven(**checked(Oven, 'oven.', {'heat': 200}))

The text is a line of Markdown, if a page is made of the settings: doc/write_settings.py makes
launch/oracle.yaml and doc/settings.md of those of the executive.
"""

import math
import re
from copy import copy
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import (
    Any,
    Callable,
    Collection,
    Dict,
    Iterator,
    Mapping,
    NamedTuple,
    Optional,
    Pattern,
    Sequence,
    Tuple,
    TypeVar,
)

from smach_common.foreign import error_text

from ..decision.policies import POLICIES
from ..decision.ways import Prices
from ..errors import SettingsError
from ..identity import attribute_of
from ..number_checks import is_number, is_whole
from .paths import can_be_path, path_of
from .written import as_text, as_value, read_otherwise

T = TypeVar('T')
Check = Callable[[str, object], T]


def is_state(value: object) -> bool:
    """Whether `value` is a state in smach's sense, told without importing smach."""
    names = ('execute', 'get_registered_outcomes')
    if all(callable(attribute_of(value, name)) for name in names):
        return True
    if callable(value):
        return False  # a function, also one that answers to every name
    try:  # what stands for a state that is elsewhere
        return all(callable(getattr(value, name)) for name in names)
    except Exception:
        return False


def _value_that(fits: Callable[[object], bool], kind: Callable[[Any], T], allowed: str) -> Check[T]:
    def check(key: str, value: object) -> T:
        if not fits(value):
            raise SettingsError(key, value, allowed)
        return kind(value)

    return check


def number(low: float, high: float, allowed: str) -> Check[float]:
    """Check for a number from `low` to `high`. Its SettingsError says `allowed`."""
    return _value_that(lambda value: is_number(value, low, high), float, allowed)


def whole(low: int, allowed: str, high: float = math.inf) -> Check[int]:
    """Check for a whole number from `low` to `high`. Its SettingsError says `allowed`."""
    return _value_that(lambda value: is_whole(value, low, high), int, allowed)


def flag(key: str, value: object) -> bool:
    """Check for true or false.

    :raises SettingsError: for anything else.
    """
    found = as_value(value)
    if not isinstance(found, bool):
        raise SettingsError(key, value, 'true or false')
    return found


def no_name(key: str, value: object, allowed: str) -> SettingsError:
    """Return the error for a value that is no name, and say how YAML may have made it of one."""
    return SettingsError(key, value, allowed, problem='is not allowed' + read_otherwise(value))


def _text_that(allowed: str, fits: Callable[[str], bool]) -> Check[str]:
    def check(key: str, value: object) -> str:
        word = as_text(value)
        if not isinstance(word, str) or not fits(word):
            raise no_name(key, value, allowed)
        return word

    return check


def choice(options: Sequence[str]) -> Check[str]:
    """Check for one of some words. Its SettingsError names them all."""
    return _text_that(', '.join(options), lambda word: word in options)


text = _text_that('a string', lambda word: True)  # empty or not
label = _text_that('a string that is not empty', bool)


_path = _text_that('the path of a file', can_be_path)


def file(key: str, value: object) -> str:
    """Check for a path, empty or not, and return it with `~` filled in."""
    return path_of(_path(key, text(key, value)))


# of ROS: a name from the root, of the node's own, or relative
_GRAPH_NAME = re.compile(r'(~/?|/)?[A-Za-z]\w*(/[A-Za-z0-9_]+)*', re.ASCII)
# one that rospy resolves, too: it takes slashes in excess away
ROSPY_NAME = re.compile(r'(~/?|/+|(?=[A-Za-z]))\w+(/+\w+)*/?', re.ASCII)


def graph_name(allowed: str, form: Pattern[str] = _GRAPH_NAME) -> Check[str]:
    """Check for a name of ROS. Its SettingsError says `allowed`."""
    check = _text_that(allowed, lambda word: form.fullmatch(word) is not None)
    return lambda key, value: check(key, label(key, value))


def words(key: str, value: object) -> Tuple[str, ...]:
    """Check for a list of strings, none of them empty.

    :raises SettingsError: for anything else.
    """
    if not isinstance(value, (list, tuple, set, frozenset)):
        raise SettingsError(key, value, 'a list of strings')
    found = []
    for entry in value:
        word = as_text(entry)
        if not isinstance(word, str) or not word:
            raise no_name(key, entry, 'a list of strings, none of them empty')
        found.append(word)
    return tuple(sorted(found)) if isinstance(value, (set, frozenset)) else tuple(found)


def optional(check: Check[T]) -> Check[Optional[T]]:
    """Check that admits None (nothing set) beside what `check` admits."""

    def checked(key: str, value: object) -> Optional[T]:
        return None if as_value(value) is None else check(key, value)

    return checked


def mapping(key: str, value: object) -> Mapping[str, object]:
    """Check for a mapping whose keys are strings.

    None, an empty section of a YAML file, counts as an empty one.

    :raises SettingsError: naming the value, or the key that is no string.
    """
    if as_value(value) is None:
        return {}
    if not isinstance(value, Mapping):
        raise SettingsError(key, value, 'a mapping')
    for name in value:
        if not isinstance(name, str):
            raise no_name(key, name, 'names that are strings')
    return value


def section(key: str, value: object, allowed: Collection[str]) -> Mapping[str, object]:
    """Check for a mapping that has none but these keys.

    :raises SettingsError: as `mapping`, or naming the first other key.
    """
    found = mapping(key, value)
    for name in found:
        if name not in allowed:
            keys = 'one of the keys ' + ', '.join(allowed)
            raise SettingsError('{}.{}'.format(key, name), found[name], keys)
    return found


def on_no_answer(key: str, value: object) -> Tuple[str, str]:
    """Check for a fallback.

    Allowed: 'stop', 'goto:LABEL', 'give_up:OUTCOME', or a mapping of one of these words.

    :returns: the word, and what it names or ''.
    :raises SettingsError: for anything else.
    """
    verb: object
    target: object
    if isinstance(value, Mapping) and len(value) == 1:
        ((verb, target),) = value.items()
        target = as_text(target)
    elif isinstance(value, str):
        verb, _, target = value.partition(':')
    elif isinstance(value, tuple) and len(value) == 2:
        verb, target = value
    else:
        verb, target = None, None
    named = isinstance(target, str) and bool(target)
    if (verb == 'stop' and not target) or (verb in ('goto', 'give_up') and named):
        return str(verb), str(target or '')
    how_read = read_otherwise(target) if verb in ('goto', 'give_up') else ''
    raise SettingsError(
        key,
        value,
        "'stop', {'goto': LABEL} or {'give_up': OUTCOME}",
        problem='is not allowed' + how_read,
    )


deadline = number(0, math.inf, 'seconds from 0; 0 waits without end')
_limit = optional(number(0, math.inf, 'seconds from 0; 0 is no limit'))


def time_limit(key: str, value: object) -> Optional[float]:
    """Check for a time limit in seconds. 0 and None are no limit.

    :raises SettingsError: for anything else.
    """
    return _limit(key, value) or None


def setting(
    default: T,
    check: Callable[..., object],
    text: str = '',
    names_objects: bool = False,
    key: str = '',
    short: str = '',
    marks: Sequence[str] = (),
) -> T:
    """Return the field of a setting.

    :param names_objects: the check also takes what imports objects.
    :param key: GROUP.KEY, if files have it in a group.
    :param short: what may stand in place of the whole group, in words. The field has the group's
        name then.
    :param marks: a mapping with one of these keys may so stand there, too.
    """
    facts = {
        'default': default,
        'check': check,
        'text': text,
        'names_objects': names_objects,
        'key': key,
        'short': short,
        'marks': tuple(marks),
    }

    def copied() -> T:
        return copy(default)

    if isinstance(default, dict):
        return field(default_factory=copied, metadata=facts)
    return field(default=default, metadata=facts)


def settings_of(group: type) -> Dict[str, Mapping[str, Any]]:
    """Return what `setting` was told of each setting of a dataclass."""
    return {each.name: each.metadata for each in fields(group) if each.metadata}


def checked(
    group: type,
    prefix: str,
    given: Mapping[str, object],
    resolver: 'Optional[Resolver]' = None,
    written: Mapping[str, str] = MappingProxyType({}),
) -> Dict[str, Any]:
    """Return those of the settings of a dataclass that are given, checked.

    `prefix` stands before their names in errors. `resolver` imports the objects that they name.
    `written`: the keys under which some are given, by their names.

    :raises SettingsError: naming key, value and what is allowed.
    """
    return {
        name: facts['check'](
            prefix + written.get(name, name), given[name], *[resolver] * facts['names_objects']
        )
        for name, facts in settings_of(group).items()
        if name in given
    }


PYTHON = 'python:'
Resolver = Callable[[str], object]
_PYTHON_NAME = "'python:module:attribute', which names a {} of a module that can be imported"


def named_object(key: str, given: str, wanted: str, resolver: Resolver) -> object:
    """Return the object that `given` names.

    `wanted`: what it should be, in a word or two. `resolver`: imports it. It raises ImportError or
    ValueError with a text for people. Any other exception comes from the module.

    :raises SettingsError: naming `key`, the name, what is wrong with it and what is allowed.
    """
    try:
        return resolver(given)
    except SettingsError:
        raise
    except (ImportError, ValueError) as err:
        why = str(err)
    except Exception as err:
        why = 'importing it raised {}'.format(error_text(err))
    raise SettingsError(
        key, given, _PYTHON_NAME.format(wanted), problem='cannot be found: {}'.format(why)
    )


ASK, RECOVER, RESTART, STATE = 'ask', 'recover', 'restart', 'state'
_MAP = 'a mapping of labels, or of paths of states, to those of now, such as KITCHEN/LOOK: SEARCH'
_ON_RESUME = 'ask, recover, restart or state:LABEL'


def checked_on_resume(key: str, value: object) -> Tuple[str, str]:
    """Check for what may be done, and return it, and the path of a state where it names one.

    :raises SettingsError: for anything else.
    """
    if isinstance(value, str):
        word, colon, path = value.partition(':')
        if word == STATE and path.strip():
            return STATE, path.strip()
        if word in (ASK, RECOVER, RESTART) and not colon:
            return word, ''
    raise SettingsError(key, value, _ON_RESUME)


def checked_resume_map(key: str, value: object) -> Dict[str, str]:
    """Check for paths of states by those that they had in an earlier script, and return them.

    The parameter server makes mappings in mappings of paths. They are put together again.

    :raises SettingsError: for anything else.
    """
    return dict(_paths(key, value, ''))


def _paths(key: str, value: object, before: str) -> Iterator[Tuple[str, str]]:
    if not isinstance(value, Mapping):
        raise SettingsError(key, value, _MAP)
    for old, new in value.items():
        if not isinstance(old, str) or not _is_path(old):
            raise no_name(key, old, _MAP)
        new = as_text(new)
        if isinstance(new, Mapping):
            yield from _paths(key, new, before + old + '/')
        elif isinstance(new, str) and _is_path(new):
            yield before + old, new
        else:
            raise no_name('{}.{}{}'.format(key, before, old), new, _MAP)


def _is_path(text: str) -> bool:
    return all(part.strip() for part in text.split('/'))


_MOST_S = 3600.0
_MOST = 1000000


class PolicyChoice(NamedTuple):
    """A policy's name, and those of its parameters that are not the defaults."""

    name: str
    parameters: Mapping[str, float]


_TIMES = whole(0, 'a whole number from 0 to {}'.format(_MOST), _MOST)
_CHECKS: Dict[str, Check[float]] = {
    'times': _TIMES,
    'tries': _TIMES,
    'steps_back': _TIMES,
    'seed': whole(0, 'a whole number from 0'),
    'explore': number(0, 1, 'a chance from 0 to 1'),
    'wait_s': number(0, _MOST_S, 'seconds from 0 to {:g}'.format(_MOST_S)),
}
_NAMED = choice(sorted(POLICIES))


def checked_policy(key: str, given: object) -> PolicyChoice:
    """Check for the name of a policy, or a mapping with its `name` and parameters.

    :raises SettingsError: naming key, value and what is allowed.
    """
    if not isinstance(given, Mapping):
        return PolicyChoice(_NAMED(key, given), {})
    if 'name' not in given:
        raise SettingsError(key, given, 'the name of a policy, or a mapping with its name')
    name = _NAMED(key + '.name', given['name'])
    allowed = POLICIES[name].parameters
    parameters: Dict[str, float] = {}
    for parameter, value in section(key, given, ['name', *allowed]).items():
        if parameter != 'name':
            checked = _CHECKS[parameter]('{}.{}'.format(key, parameter), value)
            if checked != allowed[parameter]:
                parameters[parameter] = checked
    return PolicyChoice(name, parameters)


_COUNT = optional(whole(0, 'a whole number from 0'))


def _minutes(key: str, value: object) -> float:
    allowed = 'a number of minutes above 0'
    minutes = number(0, math.inf, allowed)(key, value)
    if not minutes:
        raise SettingsError(key, value, allowed)
    return minutes


@dataclass(frozen=True)
class Budget:
    """The most that all containers of a machine may spend in one trial. None means no limit."""

    recoveries: Optional[int] = setting(
        None, _COUNT, "decisions of the oracle's own that led to a state"
    )
    minutes: Optional[float] = setting(
        None, optional(_minutes), 'of monotonic time, from the beginning of the trial'
    )
    questions: Optional[int] = setting(None, _COUNT, 'failures that the expert is asked about')


def checked_budget(key: str, given: object) -> Budget:
    """Check for a budget. A limit that is not given, or is None, does not apply.

    :raises SettingsError: naming key, value and what is allowed.
    """
    limits = vars(given) if isinstance(given, Budget) else given
    return Budget(**checked(Budget, key + '.', section(key, limits, settings_of(Budget))))


_PRICE = number(0, 1e6, 'a price from 0 to 1000000, in minutes of the robot')


def checked_prices(key: str, given: object) -> Prices:
    """Check for what things cost. A price that is not given has its default.

    :raises SettingsError: naming key, value and what is allowed.
    """
    if isinstance(given, Prices):
        given = given._asdict()
    prices = section(key, given, Prices._fields)
    return Prices(
        **{name: _PRICE('{}.{}'.format(key, name), value) for name, value in prices.items()}
    )
