"""A lab in which a robot goes on: what each trial finds, by the hour and by what was left."""

import json

import numpy as np
import pytest

from smach_oracle.simulation.scenes import kitchen_scene, tabletop_scene
from smach_oracle.simulation.scenes.lab import (
    FROM_THE_HOUR,
    TIDYING_H,
    LabRun,
    LabState,
    begins_at,
    lab_scene,
    state_from,
)
from smach_oracle.simulation.scenes.lab_hours import DAY_H, drifting, spells, worn
from smach_oracle.simulation.scenes.scene import Body
from smach_oracle.simulation.scenes.tasks import TASKS
from smach_oracle.simulation.scenes.unlike_the_map import true_kitchen

RUN = LabRun(300, 0.1)


def dazzle(generator):
    return (('x', float(generator.random())),)


def left(scene, **more):
    """The lab as it is after a trial in which nothing but the thing of the task was moved."""
    began = begins_at(RUN, scene.seed, None)
    things = tuple(each for each in scene.bodies if each.mass > 0 and each.name != scene.goal.body)
    return LabState(
        began, began + 0.02, tuple(each for each in things if each.shape != 'urdf'), **more
    )


def carried(scene):
    return {each.name: each for each in scene.bodies if each.mass > 0 and each.shape != 'urdf'}


@pytest.mark.parametrize('task', TASKS)
def test_what_was_left_is_found_again_and_another_thing_is_put_out(task):
    stayed = 0
    for seed in range(301, 309):
        before = lab_scene(task, RUN, seed, None, benign=True)
        state = left(before)
        after = carried(lab_scene(task, RUN, seed + 1, state, benign=True))
        places = {name: each.position[:2] for name, each in after.items()}
        if all(places.get(each.name) == each.position[:2] for each in state.things):
            stayed += 1
            assert len(after) == len(state.things) + 1
    assert stayed >= 5, 'else there was no room, and all was set out afresh'


def test_what_stays_in_the_fridge_is_not_in_the_hands_way_to_the_next_drink():
    kitchen = true_kitchen(RUN.seed)
    x, y, yaw = kitchen.place
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    for seed in range(301, 409):
        there = carried(
            lab_scene(
                TASKS[1],
                RUN,
                seed + 1,
                left(lab_scene(TASKS[1], RUN, seed, None, benign=True)),
                benign=True,
            )
        )
        places = {
            name: turn @ np.subtract(each.position[:2], (x, y)) for name, each in there.items()
        }
        ordered = places.pop(kitchen_scene.ORDERED)
        assert not any(
            place[0] < ordered[0] - 1e-9 and abs(place[1] - ordered[1]) < kitchen_scene.HAND
            for place in places.values()
        ), seed


@pytest.mark.parametrize('task', TASKS)
def test_once_an_hour_all_is_set_anew(task):
    state = left(lab_scene(task, RUN, 309, None, benign=True))
    fresh = (
        tabletop_scene.fresh_things(310)
        if task == TASKS[0]
        else kitchen_scene.fresh_drinks(310, true_kitchen(RUN.seed))
    )
    assert begins_at(RUN, 309, None) < 1.0 <= begins_at(RUN, 310, state)
    found = carried(lab_scene(task, RUN, 310, state, benign=True))
    assert {name: each.position[:2] for name, each in found.items()} == {
        each.name: each.position[:2] for each in fresh
    }


def test_where_there_are_too_few_things_the_table_is_set_anew():
    state = left(lab_scene(TASKS[0], RUN, 301, None, benign=True))
    found = carried(lab_scene(TASKS[0], RUN, 302, state._replace(things=state.things[:1]), True))
    assert set(found) == {each.name for each in tabletop_scene.fresh_things(302)}


def test_a_run_goes_on_from_what_was_written_as_from_what_was_kept():
    scene = lab_scene(TASKS[1], RUN, 301, None, benign=False)
    state = left(
        scene,
        joints=(('torso_lift_joint', 0.2501),),
        base=(0.1, 1 / 3, 1.5),
        localisation=(0.01, 0.02, 0.003),
    )
    again = state_from(json.loads(json.dumps(state.as_data())))
    assert again == state
    assert lab_scene(TASKS[1], RUN, 302, again, False) == lab_scene(
        TASKS[1], RUN, 302, state, False
    )


def test_the_robot_stands_as_it_was_left_or_was_set_right():
    state = left(
        lab_scene(TASKS[1], RUN, 301, None, True),
        base=(0.1, 0.2, 1.5),
        joints=(('torso_lift_joint', 0.29),),
        localisation=(0.01, -0.02, 0.003),
    )
    robot = lab_scene(TASKS[1], RUN, 302, state, True).robot
    assert (robot.base, robot.localisation_error) == (state.base, state.localisation)
    assert dict(robot.joints)['torso_lift_joint'] == 0.29
    stowed = dict(kitchen_scene.posture())
    assert dict(robot.joints)['r_elbow_flex_joint'] == stowed['r_elbow_flex_joint']
    robot = lab_scene(
        TASKS[1],
        RUN,
        302,
        state._replace(joints=(), base=(0.0,) * 3, localisation=(0.0,) * 3),
        True,
    ).robot
    assert robot.base == (0.0, 0.0, 0.0) and dict(robot.joints) == stowed
    assert robot.localisation_error != (0.0, 0.0, 0.0), 'a person is as wrong as any localisation'


def test_a_trial_that_took_long_puts_the_next_off():
    state = LabState(0.0, 0.5, ())
    assert begins_at(RUN, 304, state) == pytest.approx(0.5 + TIDYING_H)
    assert begins_at(RUN, 309, state) == pytest.approx(0.9)
    assert begins_at(RUN, 302, None) == pytest.approx(0.2)


@pytest.mark.parametrize('task', TASKS)
def test_light_is_that_of_the_hour_and_not_drawn_for_a_trial(task):
    seen = 0
    for seed in range(300, 500, 4):
        hour = begins_at(RUN, seed, None)
        scene = lab_scene(task, RUN, seed, None, benign=False)
        given = [each.kind for each in scene.causes if each.kind in FROM_THE_HOUR]
        assert given == [each.kind for each in spells(RUN.seed, hour, hour + 1 / 6, dazzle)]
        assert all(each.lasting for each in scene.causes if each.kind in FROM_THE_HOUR)
        for each in scene.disturbances:
            if each.cause in given:
                values = dict(each.values)
                assert each.after == 'start' and 0 <= values['delay'] < 600 < 3 * 3600
                assert values['duration'] > 0
        seen += len(given)
    assert seen > 3, 'else nothing was tried'


def test_a_spell_goes_on_from_trial_to_trial_and_ends_with_the_day():
    of_a_day = spells(RUN.seed, 0.0, 5 * DAY_H, dazzle)
    assert {each.kind for each in of_a_day} == {'glare', 'dim_light'}
    for each in of_a_day:
        assert each.begins // DAY_H == (each.ends - 1e-9) // DAY_H
        middle = (each.begins + each.ends) / 2
        assert each in spells(RUN.seed, middle, middle + 1e-6, dazzle)
        assert each not in spells(RUN.seed, each.ends, each.ends + 1e-6, dazzle)
    assert of_a_day != spells(RUN.seed + 1, 0.0, 5 * DAY_H, dazzle)


def test_calibration_drifts_slowly_with_the_same_spread_at_every_hour():
    steps = [
        drifting(seed, 'camera_error', hour + 0.1, 6) - drifting(seed, 'camera_error', hour, 6)
        for seed in range(20)
        for hour in np.arange(0.0, 20.0, 0.7)
    ]
    assert 0 < np.abs(steps).max() < 0.25
    for hour in (0.0, 2.0, 4.0, 17.3):
        drawn = np.array([drifting(seed, 'camera_error', hour, 6) for seed in range(400)])
        assert drawn.std() == pytest.approx(0.95, abs=0.06)  # clipped at two sigmas
    robots = [lab_scene(TASKS[0], RUN, seed, None, True).robot for seed in (300, 340)]
    assert robots[0].camera_error != robots[1].camera_error
    assert robots[0].encoder_errors != robots[1].encoder_errors


def test_finger_tips_wear_in_the_course_of_a_run():
    assert worn(RUN.seed, 0.0) == 0.0
    assert 0.05 < worn(RUN.seed, 20.0) < 0.31
    assert worn(RUN.seed, 1000.0) == 0.5
    assert lab_scene(TASKS[0], RUN, 340, None, True).robot.tip_wear == worn(RUN.seed, 4.0)


@pytest.mark.parametrize('task', TASKS)
def test_the_furniture_is_that_of_the_run(task):
    def fixed(scene):
        return [
            each
            for each in scene.bodies
            if each.mass == 0 and each.name in ('table', 'leg_0', 'fridge')
        ]

    scenes = [lab_scene(task, RUN, seed, None, True) for seed in (300, 304)]
    assert fixed(scenes[0]) == fixed(scenes[1]) and all(map(fixed, scenes))
    assert fixed(lab_scene(task, LabRun(299, 0.1), 300, None, True)) != fixed(scenes[0])


def test_data_that_is_no_state_is_refused():
    body = Body('cup', 'cup', (0.1, 0.1, 0.1), (0.5, 0.0, 0.8), mass=0.1)
    data = LabState(0.0, 0.1, (body,)).as_data()
    assert state_from(json.loads(json.dumps(data))).things == (body,)
    for key in data:
        with pytest.raises((KeyError, TypeError, ValueError)):
            state_from({name: value for name, value in data.items() if name != key})
