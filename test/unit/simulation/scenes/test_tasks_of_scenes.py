"""Each task that the world's parameter allows has scenes of its own."""

import pytest

from smach_oracle.simulation.node.settings import read_settings
from smach_oracle.simulation.scenes.tasks import TASKS, draw


@pytest.mark.parametrize('task', ['pick_and_place', 'drink_retrieval'])
def test_a_task_has_scenes_with_and_without_reasons_to_fail(task):
    assert (draw(task, 3, True).task, draw(task, 3, True).seed) == (task, 3)
    assert not draw(task, 3, True).causes
    assert any(draw(task, seed, False).causes for seed in range(12))


def test_the_parameter_allows_the_tasks_that_have_scenes():
    assert [
        read_settings(lambda name, default, task=task: task if name == '~task' else default).task
        for task in TASKS
    ] == list(TASKS)
