"""The worlds differ from the robot's map: by some centimetres, each trial by others."""

import numpy as np

from smach_oracle.pr2.kitchen import Kitchen
from smach_oracle.simulation.scenes import calibration, unlike_the_map
from smach_oracle.simulation.scenes.chance import generator_for
from smach_oracle.simulation.scenes.person import PALM
from smach_oracle.simulation.scenes.tasks import draw
from smach_oracle.simulation.scenes.unlike_the_map import (
    drink_size,
    localisation_error,
    true_kitchen,
    true_palm,
    true_table,
)

SEEDS = range(200)


def spread(values):
    """Standard deviations and largest differences from the mean, by column."""
    values = np.array(values)
    return values.std(axis=0), np.abs(values - values.mean(axis=0)).max(axis=0)


def test_the_fridge_the_palm_and_the_localisation_are_off_by_centimetres():
    for values in (
        [true_kitchen(seed).place[:2] for seed in SEEDS],
        [true_palm(seed) for seed in SEEDS],
        [localisation_error(seed)[:2] for seed in SEEDS],
    ):
        usual, most = spread(values)
        assert (usual > 0.006).all() and (usual < 0.03).all() and (most < 0.06).all()
    mean = np.mean([true_palm(seed) for seed in SEEDS], axis=0)
    assert np.abs(mean - PALM).max() < 0.005


def test_the_robot_s_map_is_left_as_it_is():
    assert all(true_kitchen(seed) != Kitchen() for seed in SEEDS)
    assert Kitchen().place == (1.60, 0.0, 0.0)


def test_tables_and_drinks_have_sizes_of_their_own():
    tables = [true_table(seed, 0.72, 0.82, (0.7, 1.4, 0.04)) for seed in SEEDS]
    assert len({table.height for table in tables}) > 150
    assert all(abs(table.height - 0.72) <= 0.021 for table in tables)
    assert len({drink_size(seed, index) for seed in SEEDS for index in range(3)}) == 600


def test_what_the_hand_misses_by_calibration_is_about_a_centimetre():
    """Of the joints alone, at an arm's length; and of the camera, at the distance of a table."""
    errors = [dict(calibration.encoder_errors(seed)) for seed in SEEDS]
    assert {name[:2] for name in errors[0]} == {'l_', 'r_', 'he'} and len(errors[0]) == 16
    pan = np.array([each['r_shoulder_pan_joint'] for each in errors])
    assert 0.001 < pan.std() < 0.002 and np.abs(pan).max() <= 0.003
    camera = np.array([calibration.camera_error(seed) for seed in SEEDS])
    assert (camera[:, :3].std(axis=0) < 0.004).all() and (camera[:, 3:].std(axis=0) < 0.003).all()
    assert (camera.std(axis=0) > 0.001).all()


def test_scenes_have_these_errors_and_the_same_seed_the_same():
    for task in ('pick_and_place', 'drink_retrieval'):
        robots = [draw(task, seed, True).robot for seed in (1, 2)]
        assert robots[0].encoder_errors != robots[1].encoder_errors
        assert robots[0].camera_error != robots[1].camera_error
        assert draw(task, 1, True).robot == robots[0]
    assert draw('drink_retrieval', 1, True).robot.localisation_error == localisation_error(1)


def test_each_use_of_chance_has_draws_of_its_own():
    assert generator_for(3, 'a').random() == generator_for(3, 'a').random()
    assert generator_for(3, 'a').random() != generator_for(3, 'b').random()
    assert generator_for(3, 'a').random() != generator_for(4, 'a').random()
    assert unlike_the_map.drink_size(3, 0) != unlike_the_map.drink_size(3, 1)
