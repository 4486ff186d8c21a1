"""Which causes trials have: how many, how many of them last, and each from draws of its own."""

import collections

import numpy as np
import pytest
from drawn_scenes import drawn

from smach_oracle.simulation.scenes import kitchen_causes, tabletop_causes
from smach_oracle.simulation.scenes.cause_draws import (
    ANOTHER,
    LASTING,
    PASSING,
    drawn_kinds,
)
from smach_oracle.simulation.scenes.light_causes import cloud_minutes, passing_seconds
from smach_oracle.simulation.scenes.tasks import TASKS

CAUSES = dict(zip(TASKS, (tabletop_causes, kitchen_causes)))


@pytest.mark.parametrize('task', TASKS)
def test_at_least_half_of_the_trials_with_a_cause_have_one_that_lasts(task):
    scenes = [drawn(task, seed) for seed in range(900)]
    with_cause = [scene for scene in scenes if scene.causes]
    amount = CAUSES[task].AMOUNT
    assert len(with_cause) / 900 == pytest.approx(amount, abs=0.04)
    two = [scene for scene in with_cause if len(scene.causes) == 2]
    assert len(two) / len(with_cause) == pytest.approx(ANOTHER, abs=0.03)
    assert all(len({each.kind for each in scene.causes}) == 2 for scene in two)
    assert np.mean([any(each.lasting for each in scene.causes) for scene in with_cause]) > 0.5
    counts = collections.Counter(each.kind for scene in with_cause for each in scene.causes)
    assert set(counts) == set(CAUSES[task].KINDS)


@pytest.mark.parametrize('task', TASKS)
def test_the_share_that_lasts_changes_which_causes_there_are_but_not_where(task):
    none, usual, all_ = (
        [drawn(task, seed, **more) for seed in range(300)]
        for more in ({'lasting': 0.0}, {}, {'lasting': 1.0})
    )
    for scenes in zip(none, usual, all_):
        if task != 'pick_and_place':  # where a few cannot be had in a scene
            assert len({bool(scene.causes) for scene in scenes}) == 1
    assert not any(each.lasting for scene in none for each in scene.causes)
    assert all(each.lasting for scene in all_ for each in scene.causes)


@pytest.mark.parametrize('task', TASKS)
def test_each_kind_lasts_or_passes_and_has_a_weight(task):
    kinds = CAUSES[task].KINDS_OF
    assert not set(kinds[LASTING]) & set(kinds[PASSING])
    assert set(kinds[LASTING]) | set(kinds[PASSING]) == set(CAUSES[task].MAKERS)
    for weights in kinds.values():
        assert sum(weights.values()) == pytest.approx(1.0) and min(weights.values()) > 0


def test_a_kind_more_leaves_the_values_of_the_others_as_they_were():
    few = {LASTING: {'glare': 1.0}, PASSING: {'reflex': 1.0}}
    more = {LASTING: {'glare': 1.0, 'other': 0.2}, PASSING: {'reflex': 1.0}}

    def values(kinds):
        return {
            (seed, kind): generator.random()
            for seed in range(300)
            for kind, generator in drawn_kinds(seed, 5, 0.8, kinds, 0.5)
        }

    first, second = values(few), values(more)
    both = set(first) & set(second)
    assert len(both) > 150 and all(first[each] == second[each] for each in both)
    assert any(kind == 'other' for _, kind in second)


def test_shadows_take_seconds_and_clouds_minutes():
    generator = np.random.default_rng(0)
    seconds = [passing_seconds(generator) for _ in range(500)]
    minutes = [cloud_minutes(generator) for _ in range(500)]
    assert 3.0 < np.median(seconds) < 5.0 and np.percentile(seconds, 95) < 30.0
    assert 6.0 < np.median(minutes) < 10.0 and np.percentile(minutes, 5) > 2.0
