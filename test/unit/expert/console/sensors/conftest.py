"""What tests of that which robots publish share."""

import pytest

from smach_oracle.expert import robot_topics


class NoTopic:
    """Hears nothing, and leaves no thread that waits for a master."""

    def __init__(self, *_):
        pass


@pytest.fixture
def no_master(monkeypatch):
    """Robots' topics that are heard by nobody."""
    monkeypatch.setattr(robot_topics, 'RobotTopic', NoTopic)
