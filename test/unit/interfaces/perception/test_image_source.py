"""Frames on request: a snapshot service that hangs, or says no."""
import pytest

from smach_oracle.expert import frame_source
from smach_oracle.expert.followed_server import ServerGoneError
from smach_oracle.expert.frame_source import FrameError, FrameSource
from smach_oracle.srv import SnapshotResponse


@pytest.fixture
def source():
    return FrameSource('rgb', 'depth', 'info', 'base', snapshot='world/snapshot', limit_s=20.0)


def test_a_snapshot_that_hangs_is_waited_for_only_so_long(source, monkeypatch):
    limits = []

    def hang(name, kind, request, limit_s):
        limits.append((name, request.camera, limit_s))
        raise ServerGoneError(name + ' does not answer')
    monkeypatch.setattr(frame_source, 'call_service', hang)
    with pytest.raises(FrameError, match='/world/snapshot does not answer'):
        source._snap(1.5)
    assert limits == [('/world/snapshot', True, 1.5)]


def test_a_snapshot_that_is_refused_says_why(source, monkeypatch):
    monkeypatch.setattr(frame_source, 'call_service', lambda *_: SnapshotResponse(False, 'frozen', None))
    with pytest.raises(FrameError, match='/world/snapshot: frozen'):
        source._snap(1.5)
