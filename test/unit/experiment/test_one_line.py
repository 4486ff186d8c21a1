"""Variants by one line: of a task's settings they have the robot's interfaces and nothing else."""

import pytest
import yaml

from smach_oracle.experiment import job as job_module
from smach_oracle.experiment.command import parse
from smach_oracle.experiment.job import ExperimentJob
from smach_oracle.experiment.one_line import TASKS_FOLDER, write_config
from smach_oracle.experiment.plan import Variant, named_variants
from smach_oracle.oracle.settings.settings import Settings


def settings_of(task):
    return yaml.safe_load((TASKS_FOLDER / (task + '.yaml')).read_text(encoding='utf-8'))


@pytest.mark.parametrize('task', ['pick_and_place', 'drink_retrieval', 'inspection'])
def test_of_the_settings_of_a_task_the_interfaces_are_left(task, tmp_path):
    left = yaml.safe_load(write_config(tmp_path, task).read_text(encoding='utf-8'))
    offered = settings_of(task)['expert'].get('interfaces')
    assert left == ({'expert': {'interfaces': offered}} if offered else {})
    assert bool(left) == (task != 'inspection')
    usual, by_one_line = Settings(), Settings.from_dict(left)
    differing = [key for key in vars(usual) if getattr(usual, key) != getattr(by_one_line, key)]
    assert differing == (['interfaces'] if offered else [])


def test_a_name_tells_the_policy_and_that_it_is_by_one_line():
    assert named_variants(['one_line:escalating', 'escalating', 'bare'], {}) == (
        Variant('one_line:escalating', True, {'policy': 'escalating'}, one_line=True),
        Variant('escalating', True, {'policy': 'escalating'}),
        Variant('bare', False, {}),
    )


def test_a_plan_says_it_where_it_is_so_and_older_plans_are_as_they_were():
    plan = parse(['--variants', 'one_line:prose', 'prose']).plan
    assert plan.as_data()['arms'] == [
        {
            'name': 'one_line:prose',
            'recovers': True,
            'settings': {'policy': 'prose'},
            'one_line': True,
        },
        {'name': 'prose', 'recovers': True, 'settings': {'policy': 'prose'}},
    ]


@pytest.mark.parametrize('name', ['one_line:bare', 'one_line:default', 'one_line:', 'one_line'])
def test_only_a_policy_can_be_by_one_line(name, capsys):
    with pytest.raises(SystemExit):
        parse(['--variants', name])
    assert name in capsys.readouterr().err


@pytest.mark.parametrize('name', ['one_line:any_way', 'any_way'])
def test_its_launch_has_the_file_of_the_interfaces_in_place_of_the_tasks_own(
    name, tmp_path, monkeypatch
):
    started = []
    monkeypatch.setattr(job_module, 'Launch', lambda *args: started.append(args))
    plan = parse(['--variants', name, '--seed', '7']).plan
    ExperimentJob(plan, plan.variants[0], 0, tmp_path, 900.0).start()
    ((folder, _, arguments, _),) = started
    assert ('config' in arguments) == plan.variants[0].one_line
    if plan.variants[0].one_line:
        assert arguments['config'].parent == folder == tmp_path / name / 'replicate_0'
        assert arguments['config'].is_file()
    assert '"policy": {"name": "any_way", "seed": 7}' in arguments['oracle']
