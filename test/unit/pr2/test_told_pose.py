"""The localisation is told once: a pose that came late would be taken for one of later on."""

import numpy as np
import pytest

from smach_oracle.pr2 import ros_robot


class SlowLocalisation:
    """Listens after some questions, and believes what it was told after some more."""

    name = 'initialpose'

    def __init__(self):
        self.asked, self.told_at = 0, []

    def has_listener(self):
        return self.asked >= 2

    def tell(self, pose):
        self.told_at.append(self.asked)

    def believed(self):
        self.asked += 1
        return np.eye(4) if self.told_at and self.asked > self.told_at[0] + 3 else np.zeros((4, 4))


@pytest.fixture(name='robot')
def _robot(monkeypatch):
    for part in ('RosSenses', 'WorldTime', 'GoalLink'):
        monkeypatch.setattr(ros_robot, part, lambda *_: None)
    monkeypatch.setattr(ros_robot, 'PoseTeller', SlowLocalisation)
    monkeypatch.setattr(ros_robot, 'TOLD_S', 0.0)
    robot = ros_robot.RosRobot()
    robot.odom_from_base = robot._localisation.believed
    return robot


def test_a_pose_is_told_once_as_soon_as_somebody_listens(robot):
    robot.localise(np.eye(4))
    assert robot._localisation.told_at == [2]
