"""The batteries of robots, and what diagnostics say of them.

A topic or a status is a robot's if it lies below the robot's name, or in a namespace that holds no
other robot, or begins with its name. Of a single robot everything is its own.
"""

import math
import threading
import time
from typing import Any, Callable, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import BatteryState

from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.ros.master_watch import timed_master

from ...robot_topics import READ_BYTES
from ..feeds.views import number
from ..shapes.basics import HealthLevel
from ..shapes.robots import BatteryView, HealthProblemView, RobotHealthView
from ..web.sections import PageSections

SECTION = 'health'
MOST_TOPICS = 100
MOST_STATUSES = 2000  # of all robots
MOST_SHOWN = 5  # of a robot
OLD_S = 30.0  # without news
FORGOTTEN_S = 60.0
LOW_SHARE = 0.2
LONGEST = 200
LEVELS: Dict[int, HealthLevel] = {1: 'warn', 2: 'error', 3: 'stale'}
# questions, and what the page shows of states anyway
_SHOWN_ELSEWHERE = (': oracle questions', ': oracle states')


class _Battery(NamedTuple):
    message: BatteryState
    came_s: float  # monotonic


class _PartStatus(NamedTuple):
    """What diagnostics say of a part."""

    topic: str
    level: int
    message: str
    came_s: float


class RobotHealth:
    """Follows batteries and diagnostics. One thread calls `discover`, one writes sections."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._batteries: Dict[str, _Battery] = {}  # by topic
        self._statuses: Dict[Tuple[str, str], _PartStatus] = {}  # by topic and name
        self._subscribers: Dict[str, rospy.Subscriber] = {}

    def discover(self) -> None:
        """Ask the master once. A master may hang."""
        self.follow(timed_master().getPublishedTopics(''))

    def follow(self, published: Iterable[Sequence[str]]) -> None:
        """Subscribe to what is new, and forget what is gone.

        :param published: topics and their types.
        """
        wanted: Dict[str, Any] = {}
        for topic, kind in published:
            if kind == BatteryState._type:
                wanted[topic] = (BatteryState, self.on_battery)
            elif kind == DiagnosticArray._type and topic.endswith('/diagnostics'):
                wanted[topic] = (DiagnosticArray, self.on_diagnostics)
        for topic in [topic for topic in self._subscribers if topic not in wanted]:
            self._subscribers.pop(topic).unregister()
        for topic in sorted(wanted)[:MOST_TOPICS]:
            if topic not in self._subscribers:
                kind, take = wanted[topic]
                self._subscribers[topic] = rospy.Subscriber(
                    topic, kind, _taker(take, topic), queue_size=50, buff_size=READ_BYTES
                )

    def on_battery(self, topic: str, message: BatteryState) -> None:
        """Take in a battery's state."""
        with self._lock:
            self._batteries[topic] = _Battery(message, time.monotonic())

    def on_diagnostics(self, topic: str, message: DiagnosticArray) -> None:
        """Take in what parts say of themselves."""
        now_s = time.monotonic()
        with self._lock:
            for status in message.status:
                key = (topic, shortened(status.name, LONGEST))
                if key in self._statuses or len(self._statuses) < MOST_STATUSES:
                    self._statuses[key] = _PartStatus(
                        topic, _level(status), shortened(status.message, LONGEST), now_s
                    )

    def write_sections(self, sections: PageSections, robots: Iterable[str]) -> None:
        """Bring the section up to date, for these robots."""
        now_s = time.monotonic()
        with self._lock:
            self._batteries = _fresh(self._batteries, now_s)
            self._statuses = _fresh(self._statuses, now_s)
            batteries, statuses = dict(self._batteries), dict(self._statuses)
        known = sorted(robots)
        found: Dict[str, RobotHealthView] = {}
        for robot in known:
            own = [each for topic, each in sorted(batteries.items()) if _owns(robot, topic, known)]
            shown = _problems(robot, known, statuses)
            if own or shown:
                battery = _battery_view(own[0], now_s) if own else None
                found[robot] = {'battery': battery, 'problems': shown}
        sections.put(SECTION, found)


def _taker(take: Callable[[str, Any], None], topic: str) -> Callable[[Any], None]:
    return lambda message: take(topic, message)


def _fresh(known: Any, now_s: float) -> Any:
    return {key: each for key, each in known.items() if now_s - each.came_s < FORGOTTEN_S}


def _owns(robot: str, topic: str, robots: Sequence[str]) -> bool:
    if len(robots) == 1 or topic.startswith(robot + '/'):
        return True
    space = robot[: robot.rfind('/') + 1]
    return (
        len(space) > 1
        and topic.startswith(space)
        and not any(other.startswith(space) for other in robots if other != robot)
    )


def _level(status: DiagnosticStatus) -> int:
    """Python 3 reads the level, a byte, as bytes."""
    level: Any = status.level
    return int(level[0] if isinstance(level, bytes) and level else level or 0)


def _problems(
    robot: str, robots: Sequence[str], statuses: Dict[Tuple[str, str], _PartStatus]
) -> List[HealthProblemView]:
    begins = robot.lstrip('/')
    found = [
        (name, status)
        for (topic, name), status in statuses.items()
        if status.level in LEVELS
        and not name.endswith(_SHOWN_ELSEWHERE)
        and (
            name.lstrip('/').startswith((begins + ':', begins + '/')) or _owns(robot, topic, robots)
        )
    ]
    found.sort(key=lambda each: (each[1].level != 2, -each[1].level, each[0]))
    return [
        {'part': name, 'level': LEVELS[status.level], 'message': status.message}
        for name, status in found[:MOST_SHOWN]
    ]


def _battery_view(battery: _Battery, now_s: float) -> BatteryView:
    message = battery.message
    share: Optional[float] = number(message.percentage, 2)
    volts: Optional[float] = number(message.voltage, 1)
    if share is not None and not 0.0 <= share <= 1.0:
        share = None  # drivers that do not measure it leave it out
    if share == 0.0 and math.isfinite(message.voltage) and message.voltage > 0.0:
        share = None  # the message's default, and not a battery that is empty
    return {
        'share': share,
        'volts': volts,
        'charging': message.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_CHARGING,
        'low': share is not None and share < LOW_SHARE,
        'old': now_s - battery.came_s >= OLD_S,
    }
