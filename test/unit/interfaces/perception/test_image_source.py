"""Images on request: a snapshot service that hangs, or says no."""

import pytest

from smach_oracle.interfaces.perception import image_source
from smach_oracle.interfaces.perception.image_source import ImageSource, ImageSourceError
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.srv import SnapshotResponse


@pytest.fixture
def source():
    return ImageSource('rgb', 'depth', 'info', 'base', snapshot='world/snapshot', limit_s=20.0)


def test_a_snapshot_that_hangs_is_waited_for_only_so_long(source, monkeypatch):
    limits = []

    def hang(name, kind, request, limit_s):
        limits.append((name, request.camera, limit_s))
        raise ServerGoneError(name + ' does not answer')

    monkeypatch.setattr(image_source, 'call_service', hang)
    with pytest.raises(ImageSourceError, match='/world/snapshot does not answer'):
        source._snap(1.5)
    assert limits == [('/world/snapshot', True, 1.5)]


def test_a_snapshot_that_is_refused_says_why(source, monkeypatch):
    monkeypatch.setattr(
        image_source, 'call_service', lambda *_: SnapshotResponse(False, 'frozen', None)
    )
    with pytest.raises(ImageSourceError, match='/world/snapshot: frozen'):
        source._snap(1.5)
