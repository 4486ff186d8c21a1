"""What the world says about each trial, and how it finds its way to the trial's bag."""

import json
from types import SimpleNamespace

import pytest
from genpy import Time

from smach_oracle.analysis.bag_events import BagError
from smach_oracle.analysis.trials import load_trials
from smach_oracle.analysis.truth import read_truth
from smach_oracle.msg import TrialCause
from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.recorder import TrialRecorder

LINE = {
    'seed': 7,
    'task': 'pick_and_place',
    'success': True,
    'why': '',
    'causes': [{'kind': 'noise', 'text': 'x4'}],
    'sim_s': 30,
    'wall_s': 4.5,
    'share': {'physics': 0.5},
}


def write(path, *lines, end='\n'):
    path.write_text(
        '\n'.join(line if isinstance(line, str) else json.dumps(line) for line in lines) + end
    )
    return str(path)


def test_the_latest_line_of_a_seed_counts_and_a_torn_last_line_does_not(tmp_path):
    path = write(
        tmp_path / 'truth.jsonl', dict(LINE, success=False), LINE, '{"seed": 8, "ta', end=''
    )
    found = read_truth(path)
    assert list(found) == [7] and found[7].success and found[7].causes == (('noise', 'x4'),)


def test_lines_tell_of_damage_and_of_a_wrong_object_and_older_ones_do_not(tmp_path):
    damage = {'count': 2, 'knocked_over': ['cup'], 'dropped': [], 'pushed_off': ['can']}
    path = write(
        tmp_path / 'truth.jsonl',
        LINE,
        dict(LINE, seed=8, success=False, wrong_object='can', damage=damage),
    )
    old, new = (read_truth(path)[seed] for seed in (7, 8))
    assert (old.wrong_object, old.damage, old.false_success) == ('', None, False)
    assert new.damage == (('knocked_over', 'cup'), ('pushed_off', 'can'))
    assert new.wrong_object == 'can' and new.false_success


def test_a_last_line_that_lacks_nothing_but_its_end_counts(tmp_path):
    assert list(read_truth(write(tmp_path / 'truth.jsonl', LINE, end=''))) == [7]


@pytest.mark.parametrize(
    'line, words',
    [
        ('{', 'line 1: not JSON'),
        ('[]', 'not a JSON object'),
        (dict(LINE, success=1), 'success: 1 is not allowed'),
        (dict(LINE, seed=True), 'seed: True'),
        (dict(LINE, causes=['noise']), 'causes: each needs'),
        (dict(LINE, share={'physics': 'much'}), 'share'),
        (dict(LINE, wrong_object=None), 'wrong_object: None'),
        (dict(LINE, damage={'dropped': 2}), 'lists of names'),
        ({'seed': 7}, 'task: None'),
    ],
)
def test_a_wrong_line_is_named(tmp_path, line, words):
    with pytest.raises(BagError, match=words):
        read_truth(write(tmp_path / 'truth.jsonl', line, LINE))


def record(folder, *causes):
    """One trial, with these seeds on the topic of causes in the course of it."""
    recorder = TrialRecorder(str(folder), warn=pytest.fail)
    source = EventSource(pytest.fail)
    recorder.attach(source, {'/world/cause': lambda: causes_left.pop(0) if causes_left else None})
    causes_left = [
        TrialCause(seed=seed, task='pick_and_place', kinds=['noise'], details=['x4'])
        for seed in causes
    ]
    for cause in causes_left:
        cause.header.stamp = Time(1)
    source.begin_trial('trial-1')
    source.emit(EventKind.TRIAL_START, 'TOP', data={'recovers': True})
    source.emit(EventKind.TRIAL_END, 'TOP', outcome='succeeded')
    assert recorder.close(20.0)
    return SimpleNamespace(folder=str(folder), trials=lambda: load_trials([str(folder)]).trials)


def test_a_trial_finds_its_cause_and_its_truth_by_its_seed(tmp_path):
    recorded = record(tmp_path, 6, 7)  # first that of the trial before, which is latched
    write(tmp_path / 'truth.jsonl', dict(LINE, seed=6, success=False), LINE)
    (trial,) = recorded.trials()
    assert (trial.cause.seed, trial.cause.kinds, trial.truth.success) == (7, ('noise',), True)
    assert trial.replicate == str(tmp_path)


def test_a_trial_without_cause_or_without_truth_is_no_error(tmp_path):
    (trial,) = record(tmp_path / 'a').trials()
    assert trial.cause is None and trial.truth is None
    (trial,) = record(tmp_path / 'b', 7).trials()
    assert trial.cause.seed == 7 and trial.truth is None
