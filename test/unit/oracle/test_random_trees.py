"""Random trees: the executive goes as a model goes that is written apart from it."""

import os

import pytest
from tree_model.comparing import compare, difference_of
from tree_model.disturbing import disturb
from tree_model.drawing import ANY, UPSTREAM, draw

pytestmark = pytest.mark.usefixtures('quiet_threads')

IS_UPSTREAM = bool(os.environ.get('SMACH_UPSTREAM'))
SHAPE = UPSTREAM if IS_UPSTREAM else ANY


@pytest.mark.parametrize('first', range(0, 200, 20))
def test_the_executive_and_the_model_go_the_same_way(first):
    plans = [draw(seed, SHAPE) for seed in range(first, first + 20)]
    found = [compare(plan, IS_UPSTREAM) for plan in plans]
    assert [each.report() for each in found if not each.is_fine] == []
    asked = sum(event[0] == 'QUESTION' for each in found for _, event in each.executed.course)
    assert asked and sum(each.model.cross_jumps for each in found), 'there was something to see'


@pytest.mark.parametrize('seed', [700225, 701767, 703495, 723326, 723721])
def test_trees_in_which_they_once_went_different_ways(seed):
    found = compare(draw(seed, SHAPE), IS_UPSTREAM)
    assert found.is_fine, found.report()


def test_a_tree_that_is_preempted_at_any_moment_ends_and_runs_again():
    wrong = [text for seed in range(40) for text in disturb(draw(seed))]
    assert wrong == []


def test_what_differs_is_found_and_reported():
    plan = next(plan for plan in map(draw, range(50)) if len(plan.top.children) > 1)
    found = compare(plan, IS_UPSTREAM)
    path, event = found.executed.course.pop()
    changed = found._replace(
        difference=difference_of(plan, found.model.course, found.executed.course)
    )
    assert not changed.is_fine
    assert changed.difference.path in ('', path) and changed.difference.model == (path,) + event
    assert 'seed {}'.format(plan.seed) in changed.report() and event[0] in changed.report()
