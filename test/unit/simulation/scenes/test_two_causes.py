"""Two causes in one scene: none takes away what the other one needs."""
import itertools

import numpy as np
import pytest

from smach_oracle.simulation.scenes import kitchen_causes, tabletop_causes
from smach_oracle.simulation.scenes.tasks import TASKS, draw

CAUSES = dict(zip(TASKS, (tabletop_causes, kitchen_causes)))
PAIRS = [(task, *pair) for task in TASKS
         for pair in itertools.permutations(CAUSES[task].KINDS, 2)]
TABLE, KITCHEN = TASKS
SEEDS = range(8)


def given(monkeypatch, task, *kinds):
    """The scenes of some seeds that have just these kinds of causes, in this order."""
    monkeypatch.setattr(CAUSES[task], 'drawn_kinds', lambda seed, *_: iter(
        [(kind, np.random.default_rng([seed, *kind.encode()])) for kind in kinds]))
    return [draw(task, seed, False) for seed in SEEDS]


@pytest.mark.parametrize('task, first, second', PAIRS)
def test_what_a_cause_waits_for_is_in_the_scene(monkeypatch, task, first, second):
    for scene in given(monkeypatch, task, first, second):
        there = {body.name for body in scene.bodies}
        for cause in scene.causes:
            things = {name for name in cause.until if not name.startswith('arm:')}
            assert things <= there, (scene.seed, cause.kind)
            assert len(set(cause.until)) == len(cause.until), (scene.seed, cause.kind)


@pytest.mark.parametrize('kind', ['crowded', 'goal_occupied'])
def test_a_cause_that_needs_more_things_than_there_are_is_none(monkeypatch, kind):
    for scene in given(monkeypatch, TABLE, 'edge_of_reach', kind):
        things = [body for body in scene.bodies if body.name.startswith('object_')]
        enough = len(things) - 1 >= (1 if kind == 'crowded' else 2)
        assert (kind in {cause.kind for cause in scene.causes}) == enough, scene.seed


@pytest.mark.parametrize('order', [1, -1])
def test_no_thing_is_moved_for_two_causes(monkeypatch, order):
    both = 0
    for scene in given(monkeypatch, TABLE, *['crowded', 'goal_occupied'][::order]):
        named = [name for cause in scene.causes for name in cause.until]
        assert len(set(named)) == len(named), scene.seed
        both += len(scene.causes) == 2
    assert both > 0
