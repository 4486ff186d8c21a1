"""An experiment's folder of version 0.1: run_trials goes on in it, from bags, rates and truth."""

import json
import shutil

import pytest
import readings
from held import EXPERIMENT, expected, lacking, run_all

from smach_oracle.oracle.settings.failing_outcomes import FORMER_FAILING_OUTCOMES

COMMAND = (
    'run_trials',
    '--task',
    'pick_and_place',
    '--trials',
    '1',
    '--seed',
    '2',
    '--memory',
    '10',
    '20',
)


def copied(folder):
    shutil.copytree(str(EXPERIMENT), str(folder / 'experiment'))
    return folder / 'experiment'


def go_on_in(folder, *options):
    """Run the command that made the experiment; it must not start any trial."""
    launcher = folder.parent / 'roslaunch'
    launcher.write_text('#!/bin/sh\nexit 1\n')
    launcher.chmod(0o755)
    return run_all([(*COMMAND, *options, '--output', str(folder))], str(folder.parent))[0]


@pytest.fixture(name='ended', scope='module')
def go_on_once(tmp_path_factory):
    """The folder of the experiment, and the result of the command in it."""
    folder = copied(tmp_path_factory.mktemp('held'))
    return folder, go_on_in(folder)


def rates_in(folder):
    """Return the content of its files by name, without what later versions have added."""
    found = {
        str(path.relative_to(folder)): json.loads(path.read_text())
        for path in folder.rglob('rates.json')
    }
    for each in found.values():
        for rule in each.pop('failure_rules', {}).values():
            assert rule == {'failing_outcomes': list(FORMER_FAILING_OUTCOMES)}
    return found


def test_an_experiment_that_is_over_is_found_complete(ended):
    folder, result = ended
    assert result.code == 0, result.errors
    # run_trials writes them again, from the event that ends each bag
    assert len(rates_in(EXPERIMENT)) == 3
    assert rates_in(folder) == rates_in(EXPERIMENT)


def test_its_statistics_are_those_of_then(ended, tmp_path):
    folder, _ = ended
    path = tmp_path / 'statistics.json'
    text = (folder / 'statistics.json').read_text()
    path.write_text(text.replace(str(folder), str(EXPERIMENT)))
    held = expected('statistics')['json']
    mine = {
        key: [row for row in held[key] if row['experiment'] == 'PICK_AND_PLACE']
        for key in ('causes', 'groups', 'trials')
    }
    assert len(mine['trials']) == 3
    assert not list(lacking(mine, readings.statistics_in(path)))


def test_with_other_settings_it_is_another_experiment(tmp_path):
    result = go_on_in(copied(tmp_path), '--benign')
    assert result.code == 1
    assert 'benign' in result.errors
