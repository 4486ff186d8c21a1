"""`bag_statistics FOLDER` as a user runs it."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_way_reader import ALL, Scripted
from test_ways_and_decisions import recorded

import smach
from smach_oracle.analysis import bag_statistics, sweep, trial_steps, what_if

ROOT = Path(__file__).parents[3]


def test_the_table_of_both_variants(both_variants, capsys):
    assert bag_statistics.main([str(both_variants)]) == 0
    out, err = capsys.readouterr()
    assert err == ''
    rows = [line.split() for line in out.splitlines() if line.startswith('PICK_AND_PLACE  ')]
    assert [row[1:4] for row in rows] == [['with', 'oracle', '150'], ['without', 'oracle', '150']]
    # the same faults: a trial that was recovered fails without the oracle
    assert rows[0][4] == rows[1][8]


def test_the_same_bags_give_the_same_output(both_variants, capsys, tmp_path):
    outputs = []
    for _run in range(2):
        bag_statistics.main(
            [str(both_variants), '--json', str(tmp_path / 'json'), '--csv', str(tmp_path / 'csv')]
        )
        outputs.append(
            (
                capsys.readouterr().out,
                (tmp_path / 'json').read_text(),
                (tmp_path / 'csv').read_text(),
            )
        )
    assert outputs[0] == outputs[1]


def test_folders_may_be_given_one_by_one_and_bags_too(both_variants, capsys):
    bag_statistics.main([str(both_variants)])
    whole = capsys.readouterr().out
    bag_statistics.main([str(both_variants / 'without_oracle'), str(both_variants / 'with_oracle')])
    assert capsys.readouterr().out == whole
    bag = sorted((both_variants / 'with_oracle').iterdir())[0]
    assert bag_statistics.main([str(bag)]) == 0
    assert 'with oracle: 1 trials' in capsys.readouterr().out


def test_files_are_written_where_asked(both_variants, tmp_path, capsys):
    figure = tmp_path / 'time_series.png'  # with or without an ending
    assert (
        bag_statistics.main(
            [str(both_variants), '--figure', str(figure), '--json', str(tmp_path / 'a.json')]
        )
        == 0
    )
    assert figure.stat().st_size > 10_000 and (tmp_path / 'time_series.svg').stat().st_size > 10_000
    data = json.loads((tmp_path / 'a.json').read_text())
    assert len(data['trials']) == 300 and data['skipped'] == []
    assert str(figure) in capsys.readouterr().out


def test_two_experiments_have_a_figure_each(record, tmp_path, capsys):
    from fake_trials import FakeMachine

    from smach_oracle.ros.recorder import TrialRecorder

    record('pick', 3)
    recorder = TrialRecorder(str(tmp_path / 'drink'))
    FakeMachine(recorder, path='DRINK').run(1, trial_id='drink 1')
    recorder.close(20.0)
    assert bag_statistics.main([str(tmp_path), '--figure', str(tmp_path / 'f')]) == 0
    assert sorted(path.name for path in tmp_path.glob('f_*')) == [
        'f_DRINK.png',
        'f_DRINK.svg',
        'f_PICK_AND_PLACE.png',
        'f_PICK_AND_PLACE.svg',
    ]


def test_names_of_states_neither_steer_the_terminal_nor_end_a_line(tmp_path, capsys):
    names = ['\x1b[31mred', 'a\nb', '\u202eleft']
    machine = smach.StateMachine(ALL)
    with machine:
        for name, following in zip(names, [*names[1:], 'succeeded']):
            smach.StateMachine.add(name, Scripted('aborted'), {'succeeded': following})
    _, counts = recorded(tmp_path, machine, settings={'policy': {'name': 'restart', 'times': 5}})
    assert set(counts.states) == {'TOP/' + name for name in names}
    capsys.readouterr()  # what the machine has logged
    assert bag_statistics.main([str(tmp_path), '--by-state', '--by', 'settings']) == 0
    out = capsys.readouterr().out
    assert not set(out) & set('\x1b\u202e')
    for name in ('\ufffd[31mred', 'a b', '\ufffdleft'):
        assert '\n  {} failed once:\n'.format(name) in out
        assert '\n  {:<38}'.format(name) in out
    assert '    going back to \ufffd[31mred ' in out


def test_skipped_bags_are_named_and_the_exit_code_tells(record, capsys):
    folder = record('bags', 2)
    Path(folder, 'broken.bag').write_text('?')
    assert bag_statistics.main([folder]) == 1
    out, err = capsys.readouterr()
    assert 'with oracle: 2 trials' in out
    assert 'broken.bag' in err and 'magic' in err


def test_a_bag_that_is_cut_off_names_what_may_save_it(record, capsys):
    folder = record('bags', 2)
    bag = sorted(Path(folder).glob('*.bag'))[0]
    whole = bag.read_bytes()
    for end in (len(whole) - 100, len(whole) // 2, 20):
        Path(folder, 'cut.bag').write_bytes(whole[:end])
        assert bag_statistics.main([folder]) == 1
        err = capsys.readouterr().err
        assert 'cut.bag: cut off, or damaged' in err and '`rosbag reindex`' in err
    Path(folder, 'cut.bag').write_bytes(b'no bag')
    assert bag_statistics.main([folder]) == 1
    err = capsys.readouterr().err
    assert 'damaged, or no bag' in err and 'reindex' not in err


@pytest.mark.parametrize(
    'prepare, words',
    [
        (lambda folder: None, 'no such folder'),
        (lambda folder: folder.mkdir(), 'no bags'),
        (
            lambda folder: (folder.mkdir(), (folder / 'x.bag').write_text('?')),
            'nothing was recorded',
        ),
    ],
)
def test_nothing_to_count_is_an_error(tmp_path, capsys, prepare, words):
    prepare(tmp_path / 'bags')
    assert bag_statistics.main([str(tmp_path / 'bags')]) == 2
    out, err = capsys.readouterr()
    assert out == '' and words in err and str(tmp_path / 'bags') in err and 'Traceback' not in err


def test_an_output_that_cannot_be_written_is_an_error(record, tmp_path, capsys):
    folder = record('bags', 1)
    for option in ('--json', '--csv', '--figure'):
        assert bag_statistics.main([folder, option, str(tmp_path / 'missing' / 'out')]) == 2
        assert 'missing/out' in capsys.readouterr().err


def test_every_path_may_begin_with_the_home_folder(record, tmp_path, monkeypatch, capsys):
    record('bags', 2)
    monkeypatch.setenv('HOME', str(tmp_path))
    assert (
        bag_statistics.main(['~/bags', '--csv', '~/a.csv', '--json', '~/a.json', '--figure', '~/f'])
        == 0
    )
    assert {path.name for path in tmp_path.iterdir()} == {
        'bags',
        'a.csv',
        'a.json',
        'f.svg',
        'f.png',
    }
    for command, folders in (
        (sweep, ['~/bags']),
        (what_if, ['~/bags']),
        (trial_steps, ['~/bags', '~/bags']),
    ):
        command.main(folders)
        assert 'no such folder' not in capsys.readouterr().err


def test_other_words_for_failure(record, capsys):
    folder = record('bags', 4)
    bag_statistics.main([folder, '--failing-outcomes', 'succeeded'])
    line = next(
        line
        for line in capsys.readouterr().out.splitlines()
        if line.startswith('  ended in failure')
    )
    assert line.split()[3] == '4'


def test_neither_ros_nor_smach_need_be_installed(both_variants, tmp_path):
    """Everything of ROS is hidden from the interpreter, not only the network."""
    refused = (
        'rospy',
        'rosbag',
        'genpy',
        'roslib',
        'rosgraph',
        'actionlib',
        'smach',
        'smach_ros',
        'std_msgs',
        'smach_oracle.msg',
        'smach_oracle.ros',
    )
    script = '\n'.join(
        [
            'import sys',
            'class Refuse:',
            '    def find_spec(self, name, path=None, target=None):',
            '        if name in {!r}: raise ImportError(name + " is not installed here")'.format(
                refused
            ),
            'sys.meta_path.insert(0, Refuse())',
            'sys.path.insert(0, {!r})'.format(str(ROOT / 'src')),
            'from smach_oracle.analysis.bag_statistics import main',
            'sys.exit(main(sys.argv[1:]))',
        ]
    )
    run = subprocess.run(
        [sys.executable, '-c', script, str(both_variants), '--figure', str(tmp_path / 'f')],
        env={'PATH': os.environ['PATH'], 'HOME': str(tmp_path)},
        timeout=100,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
    )
    assert run.returncode == 0, run.stderr
    assert 'with oracle: 150 trials' in run.stdout


def test_the_command_counts_300_bags_in_seconds(both_variants):
    began = time.monotonic()
    run = subprocess.run(
        [sys.executable, str(ROOT / 'scripts' / 'bag_statistics'), str(both_variants)],
        timeout=100,
        stdout=subprocess.PIPE,
        universal_newlines=True,
    )
    assert run.returncode == 0 and 'PICK_AND_PLACE' in run.stdout
    assert time.monotonic() - began < 20.0  # half a second on an idle machine


@pytest.mark.parametrize('command', [bag_statistics, sweep])
def test_a_folder_that_is_taken_as_a_failing_outcome_is_told(both_variants, capsys, command):
    folders = [str(both_variants / each) for each in ('with_oracle', 'without_oracle')]
    command.main([folders[0], '--failing-outcomes', 'aborted', folders[1]])
    name = 'bag_statistics' if command is bag_statistics else 'compare oracles'
    assert capsys.readouterr().err == (
        "{}: --failing-outcomes: '{}' is taken as an outcome; give folders before it\n".format(
            name, folders[1]
        )
    )
    command.main([*folders, '--failing-outcomes', 'aborted'])
    assert capsys.readouterr().err == ''
