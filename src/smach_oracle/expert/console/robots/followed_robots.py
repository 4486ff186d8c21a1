"""All robots that the master knows, found by the types of their topics and then followed."""

import threading
from collections import OrderedDict
from types import MappingProxyType
from typing import Any, Callable, Dict, FrozenSet, List, Mapping, Optional, Sequence, Set, Tuple

import rosgraph
import rospy

from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from smach_oracle.msg import ControlStatus, NodeTrials, OracleEvent, OracleRates
from smach_oracle.oracle.records.events import Event
from smach_oracle.ros.master_watch import timed_master
from smach_oracle.ros.senders.own_messages import subscribe_to_owner

from ...robot_topics import READ_BYTES
from ..feeds.told_trials import told_trials
from ..feeds.views import event_of
from ..graphs.layout_worker import LayoutWorker
from ..sensors.robot_clocks import RobotClocks
from ..trials.trial_log import TrialLog
from ..web.sections import PageSections
from .followed_robot import FollowedRobot
from .same_machine import copies

MOST_ROBOTS = 100
_GONE_AFTER = 2  # rounds without any of its topics
_QUEUE = 2000
CONTROL = '/oracle/control'
_TOPICS: Dict[str, Tuple[Any, str]] = {
    '/oracle/events': (OracleEvent, 'on_event'),
    '/oracle/rates': (OracleRates, 'on_rates'),
    '/oracle/trials': (NodeTrials, 'on_trials'),
    CONTROL: (ControlStatus, 'on_control'),
    '/smach/container_structure': (SmachContainerStructure, 'on_structure'),
    '/smach/container_status': (SmachContainerStatus, 'on_status'),
}


class FollowedRobots:
    """Follows all topics of six types and names. The name in front of them is the robot's."""

    def __init__(
        self,
        sections: PageSections,
        log: TrialLog,
        layouts: LayoutWorker,
        clocks: Optional[RobotClocks] = None,
        look_up: Callable[[Sequence[str]], None] = lambda robots: None,
        on_event: Callable[[Event], None] = lambda event: None,
    ) -> None:
        """
        :param look_up: learns where robots are stopped, before they are followed.
        :param on_event: called with each event that is new, in a ROS thread.
        """
        self._on_event = on_event
        self._look_up = look_up
        self._clocks = clocks or RobotClocks()
        self._sections = sections
        self._log = log
        self._layouts = layouts
        self._robots: 'OrderedDict[str, FollowedRobot]' = OrderedDict()
        self._subscribers: Dict[str, List[rospy.Subscriber]] = {}
        self._unseen: Dict[str, int] = {}
        self._nodes: Dict[str, FrozenSet[str]] = {}  # by robot
        self._lock = threading.Lock()

    def discover(self) -> None:
        """Ask the master once. Call it in a thread of its own, since a master may hang."""
        master = timed_master()
        published = master.getPublishedTopics('')
        # a machine that can be held can be stopped from then on, whatever becomes of the master
        self._look_up(
            [
                topic[: -len(CONTROL)]
                for topic, kind in published
                if topic.endswith(CONTROL) and kind == ControlStatus._type
            ]
        )
        self.follow(published, dict(master.getSystemState()[0]))

    def follow(
        self,
        published: Sequence[Sequence[str]],
        nodes: Mapping[str, Sequence[str]] = MappingProxyType({}),
    ) -> None:
        """Subscribe to what is new. One thread calls it.

        :param published: topics and their types.
        :param nodes: the nodes that publish a topic.
        """
        seen = set()
        for topic, kind in published:
            for suffix, (message, _) in _TOPICS.items():
                if topic.endswith(suffix) and kind == message._type and len(topic) > len(suffix):
                    seen.add(topic[: -len(suffix)])
        for name in sorted(seen - set(self._robots)):
            self._begin(name)
        for name, robot in dict(self._robots).items():
            if name in seen:
                publishers = frozenset(
                    node for suffix in _TOPICS for node in nodes.get(name + suffix, ())
                )
                # of a robot that is there, a node that plays its bag shows nothing
                self._nodes[name] = publishers & {name} or publishers
            self._unseen[name] = 0 if name in seen else self._unseen.get(name, 0) + 1
            robot.set_alive(self._unseen[name] < _GONE_AFTER)
            if self._unseen[name] == _GONE_AFTER:
                self._log.end_missing(name)
                self._clocks.forget(name)
        self._forget_gone()

    def nodes(self) -> Dict[str, FrozenSet[str]]:
        """Return the robots that the master knows now, each with the nodes that publish it."""
        with self._lock:
            return {
                name: self._nodes.get(name) or frozenset([name])
                for name, robot in self._robots.items()
                if robot.alive
            }

    def holdable(self) -> Dict[str, FrozenSet[str]]:
        """Return the robots whose machines can be held, each with the paths of its containers."""
        with self._lock:
            robots = self._robots.copy()
        return {
            name: robot.containers() for name, robot in robots.items() if robot.machines is not None
        }

    def write_sections(self) -> None:
        """Bring the sections up to date."""
        with self._lock:
            robots = list(self._robots.values())
            for robot in robots:
                robot.write_sections(self._sections, self._layouts)
            twice = self._copies(robots)
            self._sections.put(
                'robots', sorted(robot.name for robot in robots if robot.name not in twice)
            )

    def _copies(self, robots: Sequence[FollowedRobot]) -> Set[str]:
        if all(robot.learns for robot in robots):
            return set()
        return copies(robot.source(self._nodes.get(robot.name, frozenset())) for robot in robots)

    def _begin(self, name: str) -> None:
        """Subscribe without the lock: a master that hangs must not hold the sections up."""
        robot = FollowedRobot(name)
        self._subscribers[name] = [
            subscribe_to_owner(
                name + suffix,
                message,
                self._receiver(robot, method),
                queue_size=_QUEUE,
                buff_size=READ_BYTES,
            )
            for suffix, (message, method) in _TOPICS.items()
        ]
        with self._lock:
            self._robots[name] = robot

    def _receiver(self, robot: FollowedRobot, method: str) -> Callable[[Any], None]:
        if method == 'on_trials':  # latched, as the next two
            return lambda message: self._log.take_told(robot.name, told_trials(message))
        take_in = getattr(robot, method)
        if method == 'on_control':
            return lambda message: self._take_control(robot, message)
        if method == 'on_rates':  # latched: its stamp may be of long ago
            return take_in

        def take(message: Any) -> None:
            self._clocks.take(robot.name, message.header.stamp.to_sec())
            take_in(message)

        if method != 'on_event':
            return take

        def take_event(message: OracleEvent) -> None:
            take(message)
            event = event_of(message)
            if self._log.add(robot.name, event):
                self._on_event(event)

        return take_event

    def _take_control(self, robot: FollowedRobot, message: ControlStatus) -> None:
        """Its services are there by now. Only then can it be held."""
        if robot.machines is None:
            try:
                self._look_up([robot.name])
            except (OSError, rosgraph.MasterException) as err:
                rospy.logdebug('%s: %s', robot.name, err)
        robot.on_control(message)

    def _forget_gone(self) -> None:
        """Keep the latest of very many robots that are gone, such as anonymous nodes."""
        gone = [name for name, robot in self._robots.items() if not robot.alive]
        for name in gone[: max(0, len(self._robots) - MOST_ROBOTS)]:
            for subscriber in self._subscribers.pop(name):
                subscriber.unregister()
            del self._unseen[name]
            self._nodes.pop(name, None)
            with self._lock:
                self._robots.pop(name).forget(self._sections)
