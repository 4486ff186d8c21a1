"""The analysis is tried on bags that the real recorder has written."""

import pytest
from fake_trials import play

from smach_oracle.ros.recorder import TrialRecorder


@pytest.fixture
def record(tmp_path):
    """Record trials into a sub-folder; returns its path."""

    def record_trials(folder, trials, **settings):
        recorder = TrialRecorder(str(tmp_path / folder), warn=pytest.fail)
        play(recorder, trials, **settings)
        assert recorder.close(30.0)
        return str(tmp_path / folder)

    return record_trials


@pytest.fixture(scope='session')
def both_variants(tmp_path_factory):
    """150 trials with and 150 without the oracle, same seeds."""
    base = tmp_path_factory.mktemp('trials')
    for folder, recovers in (('with_oracle', True), ('without_oracle', False)):
        recorder = TrialRecorder(str(base / folder), warn=pytest.fail)
        play(recorder, 150, recovers=recovers)
        assert recorder.close(60.0)
    return base
