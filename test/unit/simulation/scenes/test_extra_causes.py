"""The extra kinds of causes: one a trial where they are asked for, and nothing else is changed."""

import collections
import hashlib

import numpy as np
import pytest
from drawn_scenes import drawn

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.simulation.node.settings import read_settings
from smach_oracle.simulation.scenes import kitchen_causes, tabletop_causes
from smach_oracle.simulation.scenes.cause_draws import LASTING, PASSING
from smach_oracle.simulation.scenes.tasks import TASKS, draw

CAUSES = dict(zip(TASKS, (tabletop_causes, kitchen_causes)))
# of the usual scenes of the seeds 0 to 149, from before there were extra kinds
USUAL = {'pick_and_place': '527fa8e09a89418d', 'drink_retrieval': 'da7b37f34c9927cc'}


def rounded(value):
    """Whatever machine draws it, the last digits aside."""
    if isinstance(value, float):
        return '{:.6f}'.format(value + 0.0)
    if isinstance(value, (tuple, list)):
        return [rounded(each) for each in value]
    return value


def digest_of(scenes):
    told = [
        rounded(
            (
                [(each.name, each.position, each.size, each.mass) for each in scene.bodies],
                [(each.kind, each.text, each.until, each.lasting) for each in scene.causes],
                [(each.kind, each.after, each.values, each.near) for each in scene.disturbances],
                (scene.robot.encoder_errors, scene.robot.localisation_error, scene.goal),
                (scene.robot.drive_error, scene.robot.camera_error),
            )
        )
        for scene in scenes
    ]
    return hashlib.sha256(repr(told).encode()).hexdigest()[:16]


@pytest.mark.parametrize('task', TASKS)
def test_the_usual_scenes_are_as_they_were(task):
    scenes = [drawn(task, seed) for seed in range(150)]
    assert digest_of(scenes) == USUAL[task]
    assert all(scene.robot.drive_bias == (0.0, 0.0, 0.0) for scene in scenes)
    kinds = {cause.kind for scene in scenes for cause in scene.causes}
    assert not kinds & set(CAUSES[task].EXTRA_MAKERS)


@pytest.mark.parametrize('task', TASKS)
def test_each_trial_has_one_extra_kind_half_of_which_last(task):
    scenes = [drawn(task, seed, extra=True) for seed in range(400)]
    assert all(len(scene.causes) == 1 for scene in scenes)
    counts = collections.Counter(scene.causes[0].kind for scene in scenes)
    (lasts,), (passes,) = (CAUSES[task].EXTRA_KINDS_OF[each] for each in (LASTING, PASSING))
    assert set(counts) == {lasts, passes} == set(CAUSES[task].EXTRA_MAKERS)
    assert counts[lasts] / 400 == pytest.approx(0.5, abs=0.06)
    assert {scene.causes[0].kind for scene in scenes if scene.causes[0].lasting} == {lasts}


@pytest.mark.parametrize('task', TASKS)
def test_all_but_the_cause_is_as_in_a_trial_without_one(task):
    for seed in range(30):
        scene, benign = drawn(task, seed, extra=True), drawn(task, seed, True)
        assert scene == draw(task, seed, False, extra=True)
        assert (scene.bodies, scene.goal) == (benign.bodies, benign.goal)
        assert scene.robot._replace(drive_bias=(0.0, 0.0, 0.0)) == benign.robot
        assert {each.cause for each in scene.disturbances} <= {scene.causes[0].kind}


def test_the_values_lie_within_their_limits():
    found = collections.defaultdict(list)
    for task in TASKS:
        for seed in range(300):
            scene = drawn(task, seed, extra=True)
            kind = scene.causes[0].kind
            values = dict(scene.disturbances[0].values) if scene.disturbances else {}
            found[kind].append((values, scene.robot.drive_bias))
    assert all(30.0 <= values['force'] <= 75.0 for values, _ in found['sticky_ring'])
    assert all(120.0 <= values['torque'] <= 240.0 for values, _ in found['door_sucked_shut'])
    halts = [values['duration'] for values, _ in found['gripper_halts']]
    assert np.median(halts) == pytest.approx(12.0, rel=0.25) and min(halts) > 0
    for _, (x, y, yaw) in found['worn_caster']:
        assert abs(x) <= 0.04 and 0.06 <= abs(y) <= 0.11 and 0.02 <= abs(yaw) <= 0.06
        assert np.sign(y) == np.sign(yaw)


@pytest.mark.parametrize('other', [{'~benign': True}, {'~lab': '/tmp/lab.json'}])
def test_the_world_has_them_alone(other):
    def given(**values):
        return read_settings(lambda name, default: values.get(name, default))

    assert not given().extra_causes and given(**{'~extra_causes': True}).extra_causes
    with pytest.raises(SettingsError, match='extra_causes'):
        given(**{'~extra_causes': True}, **other)
