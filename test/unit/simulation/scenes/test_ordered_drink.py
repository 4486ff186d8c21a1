"""The drink that is ordered: red, anywhere in a hand's reach, and not always the nearest."""

import numpy as np
from drawn_scenes import drawn

from smach_oracle.simulation.scenes.kitchen_causes import KINDS_OF, TARGET
from smach_oracle.simulation.scenes.kitchen_scene import COLOURS, DEPTHS, HAND, ORDERED, TASK
from smach_oracle.simulation.scenes.unlike_the_map import true_kitchen

SEEDS = range(200)


def drinks_of(scene):
    """The drinks on the shelf, x and y in the true fridge's frame, m."""
    x, y, yaw = true_kitchen(scene.seed).place
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    return {
        body.name: turn @ (np.array(body.position[:2]) - (x, y))
        for body in scene.bodies
        if body.name.startswith('drink_')
    }


def test_the_ordered_drink_is_the_red_one_and_often_not_the_nearest():
    nearest = 0
    for seed in SEEDS:
        scene = drawn(TASK, seed, True)
        ordered = next(body for body in scene.bodies if body.name == scene.goal.body)
        assert (ordered.name, ordered.colour) == (ORDERED, COLOURS[0])
        places = drinks_of(scene)
        nearest += min(places, key=lambda name: places[name][0]) == ORDERED
    assert 0.3 < nearest / len(SEEDS) < 0.7


def test_no_other_drink_is_in_the_hands_way_to_it():
    for seed in SEEDS:
        places = drinks_of(drawn(TASK, seed, True))
        there = places.pop(ORDERED)
        assert not any(x < there[0] and abs(y - there[1]) < HAND for x, y in places.values())
        assert DEPTHS[0] - 1e-9 <= there[0] <= DEPTHS[1] + 1e-9


def test_causes_are_about_the_ordered_drink():
    kinds = set()
    for seed in SEEDS:
        scene = drawn(TASK, seed)
        for each in scene.disturbances:
            assert each.kind in ('dim', 'glare', 'swing:fridge', 'nudge:' + ORDERED)
        kinds |= {cause.kind for cause in scene.causes if cause.until[:1] == (ORDERED,)}
        slippery = [body.name for body in scene.bodies if body.friction < 0.1]
        assert slippery in ([], [ORDERED])
    assert kinds == {'crowded'} and 'crowded' in KINDS_OF['lasting'] and TARGET == 0
