"""How often topics that nobody advertises are looked for."""

import pytest

from smach_oracle.ros.health import health_topics
from smach_oracle.ros.health.health_topics import HealthTopics


class Pauses:
    """A fake of the event that topics were added; notes the pauses in s, and when one is added."""

    def __init__(self, added_at):
        self.waited_s = []
        self._added_at = added_at

    def wait(self, timeout_s):
        self.waited_s.append(timeout_s)
        return len(self.waited_s) == self._added_at

    def clear(self):
        """Nothing is to be forgotten."""


@pytest.mark.parametrize(
    'added_at, pauses',
    [
        (0, [0.5, 1.0, 2.0, 4.0, 8.0, 10.0, 10.0, 10.0]),
        (4, [0.5, 1.0, 2.0, 4.0, 0.5, 1.0, 2.0, 4.0]),
    ],
)
def test_the_master_is_asked_less_and_less_often(monkeypatch, added_at, pauses):
    asked = []
    monkeypatch.setattr(health_topics, 'types_at_master', lambda: asked.append(True) or {})
    monkeypatch.setattr(health_topics, 'types_in_process', dict)
    monkeypatch.setattr(health_topics.rospy.core, 'is_shutdown_requested', lambda: len(asked) >= 8)
    topics = HealthTopics()
    topics._unknown['/motors_on'] = print
    topics._looking = True
    topics._has_more = Pauses(added_at)
    topics._look()
    assert topics._has_more.waited_s == pauses and len(asked) == 8
