"""The inspection robot as a task of experiments: arguments, refusals, parts, and the estimate."""

import io
from contextlib import redirect_stdout

import pytest
from roslaunch.config import load_config_default
from roslaunch.substitution_args import resolve_args

from smach_oracle.analysis import comparison
from smach_oracle.analysis.trial_rows import TrialRow, append_rows
from smach_oracle.experiment import job as job_module
from smach_oracle.experiment import protocol_run
from smach_oracle.experiment.command import main, parse
from smach_oracle.experiment.estimate import REPLAYED_S, SECONDS, replayed
from smach_oracle.experiment.job import ExperimentJob
from smach_oracle.experiment.protocols import FOURTH
from smach_oracle.experiment.sharing import is_run_again

FOUR = ['bare', 'default', 'one_line:escalating', 'one_line:learned']


def parts(*options):
    return {part.name: part.plan for part in protocol_run.chosen_parts(parse(list(options)))}


def plan_of(*options):
    with redirect_stdout(io.StringIO()) as told:
        assert main([*options, '--plan']) == 0
    return told.getvalue()


def test_by_default_it_has_sixty_tours():
    assert parse(['--task', 'inspection']).plan.trials == 60


@pytest.mark.parametrize('given', [['--lasting', '0.5'], ['--hours', '2']])
def test_what_its_world_cannot_do_is_refused(given, capsys):
    with pytest.raises(SystemExit):
        parse(['--task', 'inspection', *given])
    assert '{}: the world of inspection cannot do that'.format(given[0]) in capsys.readouterr().err


@pytest.mark.parametrize('variant', FOUR)
def test_its_launch_file_takes_the_arguments_of_a_job(variant, tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr(job_module, 'Launch', lambda *args: started.append(args))
    given = ['--task', 'inspection', '--seed', '101', '--benign', '--answer-delay', '9']
    plan = parse([*given, '--variants', variant]).plan
    ExperimentJob(plan, plan.variants[0], 0, tmp_path, 900.0).start()
    ((_, launch_file, arguments, _),) = started
    config = load_config_default(
        [
            (
                resolve_args('$(find smach_oracle)/launch/' + launch_file),
                ['{}:={}'.format(*each) for each in arguments.items()],
            )
        ],
        11311,
        verbose=False,
    )
    told = {name: each.value for name, each in config.params.items()}
    assert (told['/inspection_world/speed'], told['/inspection_world/seed']) == (4.0, 101)
    assert told['/inspection_world/causes'] == 'none'
    assert told['/scripted_expert/answer_delay'] == '9.0'
    assert told['/scripted_expert/charge_time'] == '/world/charge_time'
    assert '/world/cause' in told['/inspection/record_topics']
    assert told['/inspection_world/truth_file'].endswith('truth.jsonl')


def test_the_fifth_protocol_has_its_tours_and_the_extension_further_ones():
    fifth, more = parts('--protocol', 'fifth'), parts('--protocol', 'fifth_extension')
    tours, further = fifth['inspection_fifth_compared'], more['inspection_fifth_more']
    for plan in (tours, further):
        assert [variant.name for variant in plan.variants] == FOUR
        assert (plan.replicates, plan.shares, plan.hours) == (1, False, None)
        assert not plan.variants[1].settings, "the task's own"
    assert (tours.trials, further.trials) == (60, 140)
    assert further.seed == tours.seed + tours.trials
    named = [name for name in fifth if name.startswith('inspection')]
    assert named == ['inspection_fifth_compared', 'inspection_fifth_extra']
    for protocol in FOURTH:
        assert not [name for name in parts('--protocol', protocol) if 'inspection' in name]


def test_its_rows_decide_no_hypothesis(tmp_path):
    rows = [
        TrialRow('inspection', variant, 0, seed, 'success', True, '', 0, sim_s=40.0, expert_s=0.0)
        for variant in FOUR
        for seed in range(101, 104)
    ]
    append_rows(tmp_path / 'results.csv', rows)
    with redirect_stdout(io.StringIO()) as told:
        assert comparison.main([str(tmp_path / 'results.csv')]) == 0
    assert 'inspection: decides no hypothesis' in told.getvalue()
    assert 'H1' not in told.getvalue()


def test_the_plan_counts_a_shared_trial_once_and_a_tenth_again():
    told = plan_of('--protocol', 'fifth', '--task', 'pick_and_place', '--variants', 'bare', 'prose')
    line = told.splitlines()[-2]
    numbers = [int(word) for word in line.split() if word.isdigit()]
    run, shared = numbers[0], numbers[1]
    again = sum(map(is_run_again, range(1, 451)))
    clean = 1 - SECONDS['pick_and_place'].share
    # bare, and continuous operation and the extra causes, which share nothing
    assert run == pytest.approx(450 + 300 + 80 + 450 - (450 - again) * clean, abs=1.0)
    assert shared == pytest.approx((450 - again) * clean, abs=1.0)
    assert 'where trials are shared' in line and REPLAYED_S < 2.8


def test_rows_of_the_bare_script_say_which_trials_are_shared(tmp_path):
    options = ('--protocol', 'fifth', '--task', 'pick_and_place', '--trials', '40')
    seeds = range(701, 741)
    folder = tmp_path / 'pick_and_place_fifth_compared'
    folder.mkdir()
    rows = [
        TrialRow(
            'pick_and_place',
            'bare',
            0,
            seed,
            'failure' if seed % 2 else 'success',
            failures=seed % 2,
            wall_s=2.0,
        )
        for seed in seeds
    ]
    append_rows(folder / 'results.csv', rows)
    told = plan_of(
        *options,
        *('--seed', '701', '--replicates', '1', '--variants', 'bare', 'prose'),
        *('--output', str(tmp_path)),
    )
    shared = [seed for seed in seeds if not seed % 2 and not is_run_again(seed)]
    assert replayed('pick_and_place', seeds, rows) == len(shared)
    assert 'about {} that they share'.format(len(shared)) in told
    assert '2.0 s a trial of pick_and_place, bare' in told
