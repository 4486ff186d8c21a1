"""The points that can lie on a hull, found before the hull is."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from smach_oracle.geometry.outer_points import LEAST, outer_points

GENERATOR = np.random.default_rng(3)


def hull(points):
    return {tuple(point) for point in points[ConvexHull(points).vertices]}


@pytest.mark.parametrize(
    'cloud',
    [
        GENERATOR.normal(size=(5000, 2)) * [0.3, 0.1] + [40.0, -3.0],
        GENERATOR.uniform(-1, 1, (5000, 2)),
        np.round(GENERATOR.uniform(-1, 1, (5000, 2)), 1),
        np.array([[x, y] for x in range(40) for y in range(30)], float),
    ],
    ids=['round', 'square', 'in rows', 'grid'],
)
def test_the_hull_stays_and_the_rest_goes(cloud):
    kept = outer_points(cloud)
    assert hull(kept) == hull(cloud)
    assert len(kept) < 0.25 * len(cloud)


@pytest.mark.parametrize(
    'cloud',
    [
        np.column_stack([np.linspace(0, 1, 200), np.linspace(2, 5, 200)]),
        np.ones((200, 2)),
    ],
    ids=['a line', 'one place'],
)
def test_points_without_an_inside_all_stay(cloud):
    assert len(outer_points(cloud)) == len(cloud)


def test_few_points_are_left_as_they_are():
    few = GENERATOR.uniform(-1, 1, (LEAST - 1, 2))
    assert outer_points(few) is few
