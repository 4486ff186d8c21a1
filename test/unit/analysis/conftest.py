"""The analysis is tried on bags that the real recorder has written."""
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / 'recorder'))

from fake_trials import play  # noqa: E402

from smach_oracle.ros.recorder import TrialRecorder  # noqa: E402


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
def both_arms(tmp_path_factory):
    """150 trials with and 150 without the oracle, same seeds."""
    base = tmp_path_factory.mktemp('trials')
    for folder, recovers in (('with_oracle', True), ('without_oracle', False)):
        recorder = TrialRecorder(str(base / folder), warn=pytest.fail)
        play(recorder, 150, recovers=recovers)
        assert recorder.close(60.0)
    return base
