"""Poses that are not finite are told without an error."""

import numpy as np
import pytest

from smach_oracle.geometry.transforms import from_rpy, quaternion, rotation_vector


def test_a_rotation_has_its_quaternion():
    half = np.sin(np.pi / 4)
    assert quaternion(from_rpy((1.0, 2.0, 3.0), yaw=np.pi / 2)) == pytest.approx([0, 0, half, half])


@pytest.mark.parametrize('odd', [np.nan, np.inf])
def test_where_the_rotation_is_not_finite_it_is_nan_and_nothing_is_raised(odd):
    """A pose that is told must not end who tells it, whichever SciPy there is."""
    matrix = np.eye(4)
    matrix[0, 1] = odd
    assert np.isnan(quaternion(matrix)).all() and np.isnan(rotation_vector(matrix)).all()
    matrix = np.eye(4)
    matrix[0, 3] = odd  # the place alone
    assert quaternion(matrix) == pytest.approx([0, 0, 0, 1])
