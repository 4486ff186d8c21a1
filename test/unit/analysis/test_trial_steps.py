"""Trials that ought to be the same are compared by what happened, not by when."""

from pathlib import Path

import pytest
from fake_trials import FakeMachine

from smach_oracle.analysis import reading, trial_steps
from smach_oracle.msg import TrialCause
from smach_oracle.ros.recorder import TrialRecorder


def record(folder, seeds, start_time=1_700_000_000.0, recovers=True, plays=None):
    """One trial for each seed, as a recorder with the topic of causes has it; `plays`: seeds it
    truly plays.
    """
    recorder = TrialRecorder(str(folder), warn=pytest.fail)
    machine = FakeMachine(recorder, recovers, start_time=start_time)
    for seed, played in zip(seeds, plays or seeds):
        machine.run(played, 'trial-{}-{}'.format(seed, start_time))
    assert recorder.close(20.0)
    return str(folder)


@pytest.fixture(autouse=True)
def causes(monkeypatch):
    """The fake machine has no world: the seed is in the name of the trial."""
    read = reading.EventReader.read

    def with_causes(reader, path):
        content = read(reader, path)
        seeds = {event.trial_id: int(event.trial_id.split('-')[1]) for event in content.events}
        return content._replace(
            causes={trial_id: TrialCause(seed=seed) for trial_id, seed in seeds.items()}
        )

    monkeypatch.setattr(reading.EventReader, 'read', with_causes)


def test_the_same_trials_at_other_times_are_the_same(tmp_path, capsys):
    folders = [record(tmp_path / name, range(6), start) for name, start in (('a', 1e9), ('b', 2e9))]
    assert trial_steps.main(folders) == trial_steps.SAME
    assert '6 trials in both, 6 of them the same' in capsys.readouterr().out


def test_a_trial_that_went_on_in_another_bag_is_compared_whole(tmp_path, capsys):
    folders, events = [record(tmp_path / 'a', [3]), str(tmp_path / 'b')], []
    FakeMachine(events.append).run(3, 'trial-3-in_two')
    for part in (events[:5], events[5:]):
        recorder = TrialRecorder(folders[1], warn=pytest.fail)
        for event in part:
            recorder(event)
        assert recorder.close(20.0)
    assert len(list(Path(folders[1]).glob('*.bag'))) == 2
    assert trial_steps.main(folders) == trial_steps.SAME
    assert '1 trials in both, 1 of them the same' in capsys.readouterr().out


def test_a_trial_that_went_another_way_is_named_with_its_first_difference(tmp_path, capsys):
    failing = next(
        seed for seed in range(100) if FakeMachine(lambda event: None, False).run(seed) == 'aborted'
    )
    fine = next(
        seed
        for seed in range(100)
        if FakeMachine(lambda event: None, False).run(seed) == 'succeeded'
    )
    folders = [
        record(tmp_path / name, [7, 8], plays=plays)
        for name, plays in (('a', [fine, fine]), ('b', [fine, failing]))
    ]
    assert trial_steps.main(folders) == trial_steps.NOT_THE_SAME
    out = capsys.readouterr().out
    assert (
        out.startswith('seed 8, with oracle: step ') and "'succeeded'" in out and "'aborted'" in out
    )
    assert '2 trials in both, 1 of them the same' in out


def test_other_seeds_and_other_variants_are_not_compared(tmp_path, capsys):
    folders = [
        record(tmp_path / 'a', [1]),
        record(tmp_path / 'b', [2]),
        record(tmp_path / 'c', [1], recovers=False),
    ]
    assert (
        trial_steps.main(folders[:2]) == trial_steps.main(folders[::2]) == reading.NOTHING_COUNTED
    )
    assert 'no trial of the same experiment, variant and seed in both' in capsys.readouterr().err
    assert trial_steps.main([folders[0], str(tmp_path / 'nowhere')]) == reading.NOTHING_COUNTED


def test_a_bag_that_cannot_be_used_is_named_and_the_others_are_compared(tmp_path, capsys):
    folders = [record(tmp_path / name, range(3)) for name in ('a', 'b')]
    unfinished = Path(folders[1], 'trial.bag.active')
    unfinished.write_bytes(b'')
    assert trial_steps.main(folders) == reading.SOME_SKIPPED
    out, err = capsys.readouterr()
    assert '3 trials in both, 3 of them the same' in out
    assert (
        'Skipped {}: still being recorded'.format(unfinished) in err and len(err.splitlines()) == 1
    )
