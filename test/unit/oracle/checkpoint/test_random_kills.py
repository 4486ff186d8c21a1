"""Programs killed at random instants go on as they should; more in benchmarks/killed.py."""

import pytest
from random_kills.killing import kill_many


@pytest.mark.parametrize('seed', range(4))
def test_what_must_hold_holds_after_kills_at_random_instants(seed):
    courses = kill_many(seed, 10)
    assert sum(course.resumed for course in courses) > 0
    assert [(course.seed, course.wrong) for course in courses if course.wrong] == []
