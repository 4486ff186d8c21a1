"""What `compare what_if` does not replay, and the reasons that it gives."""

import pytest
import rosbag
from failing_machines import KEPT, record, run

from smach_oracle.analysis import what_if


def refused(capsys, folder, *options):
    capsys.readouterr()
    assert what_if.main([str(folder), *options]) == 2
    out, err = capsys.readouterr()
    assert not out
    return err


def test_trials_under_several_settings_are_named_by_what_differs(tmp_path, capsys):
    record(tmp_path, run(10))
    record(tmp_path, run(10, seed=2, **{**KEPT, 'memory': 3, 'prior': 0.5, 'max_recoveries': 1}))
    err = refused(capsys, tmp_path)
    assert err.startswith('Skipped {}: '.format(tmp_path))
    assert 'trials are under several settings: memory 10 and 3, prior 0.1 and 0.5\n' in err
    assert 'settings of its own' not in err


def test_so_it_is_of_another_policy(tmp_path, capsys):
    record(tmp_path, run(10))
    record(tmp_path, run(10, seed=2, **{**KEPT, 'policy': {'name': 'retry', 'times': 1}}))
    told = 'trials are under several settings: policy prose and retry, policy.times none and 1\n'
    assert told in refused(capsys, tmp_path)


def test_trials_of_several_nodes_are_named(tmp_path, capsys):
    """As `rosbag record` writes them: two robots at the same time, and one bag."""
    first, second = run(10, seed=1), run(10, seed=2)
    for beside, trial in zip(first, second):
        later = beside[0].wall_time - trial[0].wall_time + 1e-6
        trial[:] = [event._replace(wall_time=event.wall_time + later) for event in trial]
    (tmp_path / 'both').mkdir()
    with rosbag.Bag(str(tmp_path / 'both' / 'robots.bag'), 'w') as both:
        for robot, trials in (('left', first), ('right', second)):
            record(tmp_path / robot, trials)
            for path in sorted((tmp_path / robot).glob('*.bag')):
                with rosbag.Bag(str(path)) as bag:
                    for topic, message, time in bag.read_messages('/oracle/events'):
                        both.write('/{}{}'.format(robot, topic), message, time)
    err = refused(capsys, tmp_path / 'both')
    assert 'Its trials are of several nodes: /left, /right. ' in err


@pytest.mark.parametrize(
    'options, told',
    [
        ('--moderate-from nan', 'moderate_from: nan is not allowed'),
        ('--high-from -1', 'high_from: -1.0 is not allowed'),
        ('--high-from 0.1', 'at most high_from, which is 0.1'),
        ('--moderate-from 0.2 0.8 --high-from 0.3', 'at most high_from, which is 0.3'),
        ('--prior 1.1', 'prior: 1.1 is not allowed'),
        ('--memory 0', 'memory: 0 is not allowed'),
    ],
)
def test_values_that_no_oracle_may_have_are_refused(tmp_path, capsys, options, told):
    record(tmp_path, run(3))
    assert told in refused(capsys, tmp_path, *options.split())
