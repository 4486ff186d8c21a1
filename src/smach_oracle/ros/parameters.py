"""A node's private parameters, checked: an error names the parameter and what is allowed."""

import math
from typing import Any, Dict, List, Mapping

import rospy

from smach_oracle.oracle.settings import checks

from .log.said_once import warn_once

_NOT_SET = object()
_read: Dict[str, object] = {}  # by name, what was read last by `read_or_default`


def number_of(key: str, default: float, low: float, high: float) -> float:
    """Return a parameter that is a number from `low` to `high`.

    :raises SettingsError: for anything else.
    """
    return checked_number(key, rospy.get_param(key, default), low, high)


def name_of(key: str, default: str) -> str:
    """Return a parameter that is a name, or another text that is not empty.

    :raises SettingsError: for anything else.
    """
    return checks.label(rospy.resolve_name(key), rospy.get_param(key, default))


def names_of(key: str, default: List[str]) -> List[str]:
    """Return a parameter that is a list of names.

    :raises SettingsError: for anything else.
    """
    return list(checks.words(rospy.resolve_name(key), rospy.get_param(key, default)))


def flag_of(key: str, default: bool) -> bool:
    """Return a parameter that is true or false.

    :raises SettingsError: for anything else.
    """
    return checks.flag(rospy.resolve_name(key), rospy.get_param(key, default))


def mapping_of(key: str) -> Mapping[str, Any]:
    """Return a parameter that is a mapping, empty where it is not set.

    :raises SettingsError: for anything else.
    """
    return checked_mapping(key, rospy.get_param(key, {}))


def checked_number(key: str, value: object, low: float, high: float) -> float:
    """Return the value of a parameter, if it is a number from `low` to `high`.

    :raises SettingsError: where it is not.
    """
    allowed = 'a number from {:g} to {:g}'.format(low, high)
    return float(checks.number(low, high, allowed)(rospy.resolve_name(key), value))


def checked_mapping(key: str, value: object) -> Mapping[str, Any]:
    """Return the value of a parameter, if it is a mapping.

    :raises SettingsError: where it is not.
    """
    return checks.mapping(rospy.resolve_name(key), value)


def read_or_default(param: str, default: object) -> object:
    """Return a parameter, unchecked. The default where it is not set or the master does not answer.

    A master that does not answer is logged: a robot starts without it. What was read before stays
    then, and where the master was started again and does not know the parameter any more.
    """
    name = rospy.resolve_name(param)
    try:
        value: object = rospy.get_param(param, _NOT_SET)
    except (OSError, rospy.ROSException) as err:
        why = 'could not be read: {}'.format(err)
    else:
        if value is not _NOT_SET:
            _read[name] = value
            return value
        why = 'is not set any more'
        if name not in _read:
            return default
    stays = '; it stays as it was' if name in _read else ''
    warn_once('Parameter {} {}{}'.format(name, why, stays))
    return _read.get(name, default)


def private_flag(name: str, default: bool) -> bool:
    """Return a private parameter as `read_or_default` gives it, if it is true or false.

    :raises SettingsError: where it is not.
    """
    return checks.flag(_key_of(name), read_or_default('~' + name, default))


def private_text(name: str) -> str:
    """Return a private parameter as `read_or_default` gives it, if it is a text.

    It is '' where it is not set.

    :raises SettingsError: where it is not.
    """
    return checks.text(_key_of(name), read_or_default('~' + name, ''))


def private_number(name: str) -> float:
    """Return a private parameter as `read_or_default` gives it, if it is a number from 0.

    It is 0 where it is not set.

    :raises SettingsError: where it is not.
    """
    return float(
        checks.number(0, math.inf, 'a number from 0')(
            _key_of(name), read_or_default('~' + name, 0.0)
        )
    )


def private_names(name: str) -> List[str]:
    """Return a private parameter as `read_or_default` gives it, if it is a list of names.

    It is empty where it is not set.

    :raises SettingsError: where it is not.
    """
    return list(checks.words(_key_of(name), read_or_default('~' + name, [])))


def _key_of(name: str) -> str:
    return 'parameter ' + str(rospy.resolve_name('~' + name))
