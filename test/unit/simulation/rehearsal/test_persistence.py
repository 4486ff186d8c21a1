"""How far plain tries get: retries, restarts, and whether the cause was still there by the log."""

import pytest
from worlds import CAN, CARTON, TABLE, scene

from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal import persistence
from smach_oracle.simulation.rehearsal.persistence import (
    RehearsedTrial,
    label,
    run_scene,
    scenes_of,
)
from smach_oracle.simulation.rehearsal.pick_and_place import SkillError
from smach_oracle.simulation.scenes.scene import Disturbance, SceneCause


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def task_that(fails, calls, seconds=1.0):
    """A task of two states, the second of which fails when `fails` says so of its number."""

    class Task:
        def __init__(self, world):
            self.states = [('FIRST', lambda: self._do('FIRST')), ('SECOND', self._second)]
            self._world, self._tries = world, 0

        def begin(self):
            calls.append('begin')

        def _do(self, name):
            calls.append(name)
            self._world.step(round(60 * seconds))

        def _second(self):
            self._do('SECOND')
            self._tries += 1
            if fails(self._tries):
                raise SkillError('no')

    return Task


def shadow(seconds):
    """A scene with a shadow from its start on, for so long."""
    return scene(
        TABLE,
        CAN,
        CARTON,
        disturbances=(Disturbance('dim', 'start', (('duration', seconds),), 'shadow'),),
        causes=(SceneCause('shadow', 'somebody'),),
    )


def test_a_retry_comes_before_a_restart(world):
    calls = []
    found = run_scene(shadow(60.0), world, task_that(lambda tries: tries <= 2, calls))
    assert calls == ['FIRST', 'SECOND', 'SECOND', 'SECOND']
    assert (found.failed, found.cured_by, found.ended) == ('SECOND', 'retry', 'retry')
    assert found.there_at_retry and not found.there_at_restart


def test_the_script_is_started_over_after_the_retries(world):
    calls = []
    found = run_scene(shadow(600.0), world, task_that(lambda tries: tries <= 5, calls))
    assert calls == ['FIRST'] + ['SECOND'] * 4 + ['begin', 'FIRST', 'SECOND'] * 2
    assert found.ended == 'restart' and found.there_at_retry and found.there_at_restart


def test_a_cause_that_has_passed_is_not_there_at_a_retry(world):
    found = run_scene(shadow(0.5), world, task_that(lambda tries: tries <= 5, []))
    assert found.failed and not found.there_at_retry and not found.there_at_restart


def test_what_nothing_cures_ends_as_failed(world):
    assert run_scene(shadow(60.0), world, task_that(lambda tries: True, [])).ended == 'failed'


def test_another_ending_than_the_goal_is_a_false_success(world):
    elsewhere = shadow(60.0)
    elsewhere = elsewhere._replace(goal=elsewhere.goal._replace(position=(0.9, 0.4, 0.78)))
    found = run_scene(elsewhere, world, task_that(lambda tries: False, []))
    assert (found.failed, found.ended) == ('', 'false success')


def test_scenes_have_the_one_cause_and_come_in_the_order_of_their_seeds():
    def draw(seed):
        kinds = ['shadow'] if seed % 3 == 0 else ['shadow', 'glare'] if seed % 3 == 1 else []
        return scene(seed=seed, causes=tuple(SceneCause(kind, '') for kind in kinds))

    assert [each.seed for each in scenes_of(draw, 'shadow', 3, range(100))] == [0, 3, 6]


@pytest.mark.parametrize(
    'ended, expected',
    [
        ({'no failure': 9, 'failed': 1}, 'robust'),
        ({'retry': 9, 'restart': 1}, 'robust'),
        ({'retry': 5, 'restart': 5}, 'mixed'),
        ({'restart': 9, 'retry': 1}, 'futile'),
        ({'false success': 5, 'no failure': 5}, 'futile'),
    ],
)
def test_a_kind_is_labelled_by_what_plain_retries_do(ended, expected):
    made = {
        'no failure': ('', '', True),
        'retry': ('S', 'retry', True),
        'restart': ('S', 'restart', True),
        'failed': ('S', '', False),
        'false success': ('', '', False),
    }
    courses = []
    for how, count in ended.items():
        failed, cured, success = made[how]
        courses += [RehearsedTrial(1, 'kind', failed, cured, False, False, success)] * count
    assert label(courses) == expected
    assert persistence.RETRIES == 3 and persistence.RESTARTS == 2
