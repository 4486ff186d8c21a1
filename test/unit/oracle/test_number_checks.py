"""What counts as a number, for settings, rates and maps."""

import math
import sys

import pytest

from smach_oracle.oracle.number_checks import is_number, is_whole


@pytest.mark.parametrize(
    'value, number, whole',
    [
        (0, True, True),
        (3, True, True),
        (4, False, False),
        (-1, False, False),
        (0.5, True, False),
        (3.0, True, False),
        (True, False, False),
        ('1', False, False),
        (None, False, False),
        (math.nan, False, False),
        (math.inf, False, False),
    ],
)
def test_a_number_from_0_to_3(value, number, whole):
    assert is_number(value, 0, 3) is number
    assert is_whole(value, 0, 3) is whole


@pytest.mark.parametrize(
    'value, number',
    [
        (-1e308, True),
        (10**308, True),
        (sys.float_info.max, True),
        (-sys.float_info.max, True),
        (10**400, False),
        (math.inf, False),
        (-math.inf, False),
    ],
)
def test_a_number_without_limits_is_finite_and_fits_a_float(value, number):
    assert is_number(value) is number
    assert is_whole(value) is isinstance(value, int)
