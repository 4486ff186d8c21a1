"""All robots that the master knows, found by the types of their topics and followed from then on."""
import threading
import time
from collections import OrderedDict
from typing import Any, Callable, Dict, List, Sequence, Tuple

import rosgraph
import rospy
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure

from smach_oracle.msg import OracleEvent, OracleRates

from .layout import Layouter
from .robot import Robot
from .sections import Sections
from .trial_log import TrialLog
from .views import event_of

DISCOVERY_PERIOD_S = 1.5
MOST_ROBOTS = 100
_GONE_AFTER = 2  # looks at the master
_QUEUE = 2000
_TOPICS: Dict[str, Tuple[Any, str]] = {
    '/oracle/events': (OracleEvent, 'on_event'), '/oracle/rates': (OracleRates, 'on_rates'),
    '/smach/container_structure': (SmachContainerStructure, 'on_structure'),
    '/smach/container_status': (SmachContainerStatus, 'on_status')}


class Robots:
    """Follows every topic of the four types and names; a robot is what stands before them, its node's name."""

    def __init__(self, sections: Sections, log: TrialLog, layouter: Layouter) -> None:
        self._sections = sections
        self._log = log
        self._layouter = layouter
        self._robots: 'OrderedDict[str, Robot]' = OrderedDict()
        self._subscribers: Dict[str, List[rospy.Subscriber]] = {}
        self._unseen: Dict[str, int] = {}
        self._lock = threading.Lock()

    def look(self) -> None:
        """Ask the master once; call it in a thread of its own, since a master may hang."""
        try:
            published = rosgraph.Master(rospy.get_name()).getPublishedTopics('')
        except (OSError, rosgraph.MasterException) as err:
            rospy.logdebug('The master does not answer: %s', err)
            return
        self.follow(published)

    def follow(self, published: Sequence[Sequence[str]]) -> None:
        """Subscribe to what is new; `published`: topics and their types. One thread calls it."""
        seen = set()
        for topic, kind in published:
            for suffix, (message, _) in _TOPICS.items():
                if topic.endswith(suffix) and kind == message._type and len(topic) > len(suffix):
                    seen.add(topic[:-len(suffix)])
        for name in sorted(seen - set(self._robots)):
            self._begin(name)
        for name, robot in list(self._robots.items()):
            self._unseen[name] = 0 if name in seen else self._unseen.get(name, 0) + 1
            robot.set_alive(self._unseen[name] < _GONE_AFTER)
            if self._unseen[name] == _GONE_AFTER:
                self._log.end_missing(name)
        self._forget_gone()

    def draw(self) -> None:
        """Bring the sections up to date."""
        with self._lock:
            robots = list(self._robots.values())
            for robot in robots:
                robot.draw(self._sections, self._layouter)
            self._sections.put('robots', sorted(robot.name for robot in robots))

    def run(self) -> None:
        """Look and look again until the node goes down."""
        while not rospy.is_shutdown():
            self.look()
            time.sleep(DISCOVERY_PERIOD_S)

    def _begin(self, name: str) -> None:
        """Without the lock: a master that hangs while it is told must not hold the drawing up."""
        robot = Robot(name)
        self._subscribers[name] = [
            rospy.Subscriber(name + suffix, message, self._receiver(robot, method), queue_size=_QUEUE)
            for suffix, (message, method) in _TOPICS.items()]
        with self._lock:
            self._robots[name] = robot

    def _receiver(self, robot: Robot, method: str) -> Callable[[Any], None]:
        take = getattr(robot, method)
        if method != 'on_event':
            return take  # type: ignore[no-any-return]

        def take_event(message: OracleEvent) -> None:
            take(message)
            self._log.add(robot.name, event_of(message))
        return take_event

    def _forget_gone(self) -> None:
        """Of very many robots that have come and gone, such as anonymous nodes, the latest are kept."""
        gone = [name for name, robot in self._robots.items() if not robot.alive]
        for name in gone[:max(0, len(self._robots) - MOST_ROBOTS)]:
            for subscriber in self._subscribers.pop(name):
                subscriber.unregister()
            del self._unseen[name]
            with self._lock:
                self._robots.pop(name).forget(self._sections)
