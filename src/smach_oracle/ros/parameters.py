"""A node's private parameters, checked: what cannot be used is refused by name, with what is allowed."""
from typing import Any, List, Mapping

import rospy

from ..oracle.errors import ConfigError


def number_of(key: str, default: float, low: float, high: float) -> float:
    """A number from `low` to `high`. Raises ConfigError."""
    return checked_number(key, rospy.get_param(key, default), low, high)


def name_of(key: str, default: str) -> str:
    """A name or a text that is not empty. Raises ConfigError."""
    value = rospy.get_param(key, default)
    if not isinstance(value, str) or not value:
        raise ConfigError(rospy.resolve_name(key), value, 'a name')
    return value


def names_of(key: str, default: List[str]) -> List[str]:
    """A list of names. Raises ConfigError."""
    value = rospy.get_param(key, default)
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise ConfigError(rospy.resolve_name(key), value, 'a list of names')
    return value


def flag_of(key: str, default: bool) -> bool:
    """True or false. Raises ConfigError."""
    value = rospy.get_param(key, default)
    if not isinstance(value, bool):
        raise ConfigError(rospy.resolve_name(key), value, 'true or false')
    return value


def mapping_of(key: str) -> Mapping[str, Any]:
    """A mapping, empty where it is not set. Raises ConfigError."""
    return checked_mapping(key, rospy.get_param(key, {}))


def checked_number(key: str, value: Any, low: float, high: float) -> float:
    """The value, if it is a number from `low` to `high`. Raises ConfigError."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise ConfigError(rospy.resolve_name(key), value, 'a number from {:g} to {:g}'.format(low, high))
    return float(value)


def checked_mapping(key: str, value: Any) -> Mapping[str, Any]:
    """The value, if it is a mapping. Raises ConfigError."""
    if not isinstance(value, Mapping):
        raise ConfigError(rospy.resolve_name(key), value, 'a mapping')
    return value
