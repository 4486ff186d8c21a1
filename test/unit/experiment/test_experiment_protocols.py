"""Experiments of several parts: what they consist of, and how they are run and gone on with."""
import json

import pytest

from smach_oracle.experiment import command
from smach_oracle.experiment.protocols import COMPARED, main_parts
from smach_oracle.oracle.decision.policy import POLICIES


def by_name():
    return {part.name: part.plan for part in main_parts(700, 15.0)}


def test_the_main_protocol_has_the_replicates_and_trials_that_it_should_have():
    parts = by_name()
    compared = {name: (plan.replicates, plan.trials) for name, plan in parts.items()
                if name.endswith('_compared')}
    assert compared == {'pick_and_place_compared': (3, 150), 'drink_retrieval_compared': (4, 100)}
    assert all([each.name for each in parts[name].variants] == list(COMPARED) for name in compared)
    assert parts['pick_and_place_memory'].trials == 100
    assert parts['drink_retrieval_memory'].trials == 60


def test_every_policy_is_run_in_the_main_protocol_on_the_same_seeds():
    parts = by_name()
    for task in ('pick_and_place', 'drink_retrieval'):
        ran = {variant.name for part in ('compared', 'others')
               for variant in parts['{}_{}'.format(task, part)].variants}
        assert ran == (set(POLICIES) - {'prose'}) | {'bare', 'default'}  # the default is prose
    assert {plan.seed for plan in parts.values()} == {700}


def test_a_protocol_runs_its_parts_in_folders_of_their_own(tmp_path, monkeypatch, capsys):
    ran = []

    def run(plan, output, at_a_time, hung_after_s):
        ran.append((output.name, plan.task, at_a_time))
        assert json.loads((output / 'experiment.json').read_text())['settings']['seed'] == 7
        return []
    monkeypatch.setattr(command, 'run', run)
    monkeypatch.setattr(command.shutil, 'which', lambda name: '/bin/' + name)
    argv = ['--protocol', 'main', '--seed', '7', '--jobs', '3', '--output', str(tmp_path)]
    assert command.main(argv) == 0
    assert [name for name, _, _ in ran] == [part.name for part in main_parts(7, 15.0)]
    assert {jobs for _, _, jobs in ran} == {3}
    assert command.main(argv) == 0
    assert capsys.readouterr().out.count('Going on in') == len(ran) / 2


def test_an_unknown_protocol_ends_with_usage():
    with pytest.raises(SystemExit) as ended:
        command.parse(['--protocol', 'guess'])
    assert ended.value.code == 2
