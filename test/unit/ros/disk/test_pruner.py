"""What keeps a pruner from its work at the end of each trial is said once."""

import os

import pytest

from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.disk.limits import Limits
from smach_oracle.ros.disk.pruner import Pruner
from smach_oracle.ros.recorder import TrialRecorder


def test_a_bag_that_cannot_be_removed_is_named_once(tmp_path, monkeypatch):
    source = EventSource(pytest.fail)
    recorder = TrialRecorder(str(tmp_path), warn=pytest.fail)
    recorder.attach(source)
    for trial in 'ab':  # the newest bag stays anyway
        source.begin_trial(trial)
        source.emit(EventKind.TRIAL_START, 'TOP')
        source.emit(EventKind.TRIAL_END, 'TOP', outcome='succeeded')
    recorder.close(10.0)
    for bag in tmp_path.glob('*.bag'):
        os.utime(str(bag), (1, 1))
    warnings = []
    pruner = Pruner(str(tmp_path), Limits(days=1), lambda text: None, warnings.append)

    def refused(path):
        raise PermissionError(13, 'Permission denied', path)

    monkeypatch.setattr(os, 'unlink', refused)
    for _ in range(3):
        pruner.prune()
    assert len(set(warnings)) == len(warnings) > 0, warnings
    assert all('Permission denied' in text for text in warnings)
