"""The time of a robot's clock, by the stamps of its messages, and the age of an image by it.

The robot, its cameras and the console may run on machines whose clocks differ, or by simulated
time.
"""

import threading
import time
from typing import Dict, List, NamedTuple, Optional

from .robot_cameras import RobotCameras

MOST_ROBOTS = 200
AGREE_S = 1.0  # clocks that differ by no more are taken for one


class ClockReading(NamedTuple):
    """A stamp that came just after it was made."""

    stamp_s: float  # by the robot's ROS clock
    came_s: float  # by our monotonic clock


class RobotClocks:
    """The clocks of robots. Several threads feed them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._readings: Dict[str, ClockReading] = {}

    def take(self, robot: str, stamp_s: float, came_s: Optional[float] = None) -> None:
        """Take in a stamp, unless it is 0. `came_s`: when it came, if that is not now."""
        reading = ClockReading(stamp_s, time.monotonic() if came_s is None else came_s)
        with self._lock:
            known = self._readings.get(robot)
            room = known is not None or len(self._readings) < MOST_ROBOTS
            if stamp_s > 0.0 and room and (known is None or known.came_s < reading.came_s):
                self._readings[robot] = reading

    def forget(self, robot: str) -> None:
        """Forget the time of a robot that is gone, until it is heard again."""
        with self._lock:
            self._readings.pop(robot, None)

    def now_s(self, robot: str) -> Optional[float]:
        """Return a robot's time, s, or None where it has told none."""
        reading = self._readings.get(robot)
        return None if reading is None else reading.stamp_s + time.monotonic() - reading.came_s

    def robots(self) -> List[str]:
        """Return those whose time is known."""
        with self._lock:
            return list(self._readings)

    def shared_now_s(self) -> Optional[float]:
        """Return the time of all robots, where they agree."""
        times = [now for now in map(self.now_s, self.robots()) if now is not None]
        return max(times) if times and max(times) - min(times) <= AGREE_S else None


class ImageAges:
    """The ages of a sensor's messages, by the clock of the robot whose sensor it is."""

    def __init__(self, clocks: RobotClocks, cameras: RobotCameras) -> None:
        self._clocks = clocks
        self._cameras = cameras

    def age_s(self, topic: str, stamp_s: float) -> Optional[float]:
        """Below 0 where the stamp is ahead of the clock, or None where the age is not known."""
        owner = next(
            (robot for robot in self._clocks.robots() if topic in self._cameras.topics_of(robot)),
            None,
        )
        now_s = self._clocks.shared_now_s() if owner is None else self._clocks.now_s(owner)
        return None if now_s is None or not stamp_s else round(now_s - stamp_s, 2)
