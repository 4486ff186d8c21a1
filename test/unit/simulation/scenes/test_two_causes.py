"""Two causes in one scene: none takes away what the other one needs."""

import itertools
import sys

import numpy as np
import pytest

from smach_oracle.simulation.scenes import kitchen_causes, tabletop_causes
from smach_oracle.simulation.scenes.scene import LOCALISATION
from smach_oracle.simulation.scenes.tasks import TASKS, draw

CAUSES = dict(zip(TASKS, (tabletop_causes, kitchen_causes)))
PAIRS = [(task, *pair) for task in TASKS for pair in itertools.permutations(CAUSES[task].KINDS, 2)]
TABLE, KITCHEN = TASKS
SEEDS = range(8)
NEAREST_AT_GOAL = 0.695  # m from the robot to the goal


def given(monkeypatch, task, *kinds):
    """The scenes of some seeds that have just these kinds of causes, in this order."""
    monkeypatch.setattr(
        CAUSES[task],
        'drawn_kinds',
        lambda seed, *_: iter(
            [(kind, np.random.default_rng([seed, *kind.encode()])) for kind in kinds]
        ),
    )
    return [draw(task, seed, False) for seed in SEEDS]


@pytest.mark.parametrize('task, first, second', PAIRS)
def test_what_a_cause_waits_for_is_in_the_scene(monkeypatch, task, first, second):
    for scene in given(monkeypatch, task, first, second):
        there = {body.name for body in scene.bodies} | {LOCALISATION}
        for cause in scene.causes:
            things = {name for name in cause.until if not name.startswith('arm:')}
            assert things <= there, (scene.seed, cause.kind)
            assert len(set(cause.until)) == len(cause.until), (scene.seed, cause.kind)


@pytest.mark.parametrize('kind', ['crowded', 'goal_occupied'])
def test_a_cause_that_needs_more_things_than_there_are_is_none(monkeypatch, kind):
    for scene in given(monkeypatch, TABLE, 'edge_of_reach', kind):
        things = [body for body in scene.bodies if body.name.startswith('object_')]
        enough = len(things) - 1 >= (1 if kind == 'crowded' else 2)
        nearest = next(body for body in things if body.name == 'object_0')
        if kind == 'goal_occupied' and np.hypot(*nearest.position[:2]) > NEAREST_AT_GOAL:
            continue  # what stands at the goal would be nearer than the nearest thing
        assert (kind in {cause.kind for cause in scene.causes}) == enough, scene.seed


@pytest.mark.parametrize('order', [1, -1])
def test_no_thing_is_moved_for_two_causes(monkeypatch, order):
    both = 0
    for scene in given(monkeypatch, TABLE, *['crowded', 'goal_occupied'][::order]):
        named = [name for cause in scene.causes for name in cause.until]
        assert len(set(named)) == len(named), scene.seed
        both += len(scene.causes) == 2
    assert both > 0


@pytest.mark.parametrize('kind', ['crowded', 'goal_occupied', 'object_moved'])
def test_a_cause_at_the_table_comes_with_room_for_it(monkeypatch, kind):
    """Nothing stands in another thing, and the nearest thing stays the nearest."""
    monkeypatch.setattr(sys.modules[__name__], 'SEEDS', range(60))
    for scene in given(monkeypatch, TABLE, kind):
        things = [body for body in scene.bodies if body.name.startswith('object_')]
        assert [cause.kind for cause in scene.causes] == [kind], scene.seed
        assert scene.goal.body == 'object_0'
        if kind != 'object_moved':
            assert least_gap(things, tabletop_causes.radius_of) > 0, scene.seed


def test_no_drink_stands_in_another(monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], 'SEEDS', range(200))
    for scene in given(monkeypatch, KITCHEN, 'crowded'):
        drinks = [body for body in scene.bodies if body.name.startswith('drink_')]
        assert least_gap(drinks, lambda each: each.size[0]) > -1e-9, scene.seed


def least_gap(bodies, radius):
    """m between the outlines of the two that stand nearest to each other."""
    return min(
        np.hypot(*np.subtract(one.position[:2], other.position[:2])) - radius(one) - radius(other)
        for one, other in itertools.combinations(bodies, 2)
    )
