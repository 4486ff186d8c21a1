"""The choice of a policy, with its parameters. Pure."""

from typing import Any, Dict, Mapping, NamedTuple

from ..decision.policy import POLICIES
from ..errors import SettingsError
from . import checks as values

_MOST_S = 3600.0
_MOST = 1000000


class PolicyChoice(NamedTuple):
    """A policy's name, and those of its parameters that are not the defaults."""

    name: str
    parameters: Mapping[str, float]


_COUNT = values.whole(0, 'a whole number from 0 to {}'.format(_MOST), _MOST)
_CHECKS: Dict[str, values.Check] = {
    'times': _COUNT,
    'tries': _COUNT,
    'steps_back': _COUNT,
    'seed': values.whole(0, 'a whole number from 0'),
    'wait_s': values.number(0, _MOST_S, 'seconds from 0 to {:g}'.format(_MOST_S)),
}
_NAMED = values.choice(sorted(POLICIES))


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
    parameters: Dict[str, Any] = {}
    for parameter, value in values.section(key, given, ['name', *allowed]).items():
        if parameter != 'name':
            checked = _CHECKS[parameter]('{}.{}'.format(key, parameter), value)
            if checked != allowed[parameter]:
                parameters[parameter] = checked
    return PolicyChoice(name, parameters)
