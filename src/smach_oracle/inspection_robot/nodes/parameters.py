"""Private parameters of the nodes, and their command line."""

import argparse
import math
from typing import List

import rospy


class ParameterError(ValueError):
    """A parameter that cannot be used. The text says what is allowed."""


def parameters_of(description: str) -> None:
    """Answer --help, and refuse any argument that is not a ROS remapping."""
    argparse.ArgumentParser(description=description).parse_args(rospy.myargv()[1:])


def number_in(name: str, default: float, low: float, high: float) -> float:
    """A private parameter that is a number from `low` to `high`.

    :raises ParameterError: where it is not.
    """
    value = rospy.get_param('~' + name, default)
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or not (math.isfinite(value) and low <= value <= high)
    ):
        raise ParameterError(
            '{}: {!r} is not allowed; allowed: a number from {:g} to {:g}'.format(
                rospy.resolve_name('~' + name), value, low, high
            )
        )
    return float(value)


def flag_in(name: str, default: bool) -> bool:
    """A private parameter that is true or false.

    :raises ParameterError: where it is neither.
    """
    value = rospy.get_param('~' + name, default)
    if not isinstance(value, bool):
        raise ParameterError(
            '{}: {!r} is not allowed; allowed: true, false'.format(
                rospy.resolve_name('~' + name), value
            )
        )
    return value


def words_in(name: str, default: str) -> List[str]:
    """A private parameter that is words with spaces between them.

    :raises ParameterError: where it is no text.
    """
    value = rospy.get_param('~' + name, default)
    if not isinstance(value, str):
        raise ParameterError(
            '{}: {!r} is not allowed; allowed: words'.format(rospy.resolve_name('~' + name), value)
        )
    return value.split()
