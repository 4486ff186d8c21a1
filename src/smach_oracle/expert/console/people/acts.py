"""The acts of people at all consoles, from the audits of these consoles."""

import json
import math
import threading
from collections import deque
from typing import Any, Deque, Dict, List, Sequence, Set

import rospy

from smach_oracle.msg import ConsoleCommand
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.ros.master_watch import timed_master
from smach_oracle.ros.senders.own_messages import subscribe_to_owner

from ..shapes.people import ActView

MOST_ACTS = 300  # the latest
MOST_CONSOLES = 16
AUDIT = '/audit'
_LONGEST = 300
_LATEST_S = 1e11
UNTOLD = ('hello', 'watch', 'look', 'view')  # a page does these by itself
# the arguments that say what a command was about, the first of them that there is
_ABOUT = ('name', 'outcome', 'label', 'pattern', 'key', 'frame', 'path')


class Acts:
    """The latest acts. ROS threads feed it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._acts: Deque[ActView] = deque(maxlen=MOST_ACTS)
        self._count = 0
        self._subscribers: Dict[str, rospy.Subscriber] = {}

    @property
    def version(self) -> int:
        """Return a number that grows with every act."""
        return self._count

    def follow(self) -> None:
        """Listen to the audits of all consoles that the master knows now. One thread calls it."""
        master = timed_master()
        types = dict(master.getTopicTypes())
        found = console_audits(types, master.getSystemState()[0])
        for topic in set(self._subscribers) - found:
            self._subscribers.pop(topic).unregister()
        for topic in sorted(found)[:MOST_CONSOLES]:
            if topic not in self._subscribers:
                self._subscribers[topic] = subscribe_to_owner(
                    topic, ConsoleCommand, self.take, queue_size=1000
                )

    def take(self, message: ConsoleCommand) -> None:
        """Take in one record of an audit."""
        if message.command in UNTOLD:
            return
        with self._lock:
            self._count += 1
            self._acts.appendleft(act_view(message, str(self._count)))

    def rows(self) -> List[ActView]:
        """Return the acts as plain data, newest first."""
        with self._lock:
            return list(self._acts)


def console_audits(types: Dict[str, str], publishers: Sequence[Sequence[Any]]) -> Set[str]:
    """Return the topics on which consoles publish their own audits.

    A console also publishes records beside expert query servers. Whoever listens there first gets
    the earlier ones, which are for the recorder.

    :param publishers: pairs of a topic and the nodes that publish it, as the master has them.
    """
    return {
        topic
        for topic, nodes in publishers
        if types.get(topic) == ConsoleCommand._type
        and topic.endswith(AUDIT)
        and topic[: -len(AUDIT)] in nodes
    }


def act_view(message: ConsoleCommand, name: str) -> ActView:
    """Return an act as plain data. `name`: tells it from the others."""
    at = message.wall_time
    return {
        'id': name,
        'at': at if math.isfinite(at) and 0 <= at <= _LATEST_S else 0.0,
        'who': shortened(message.expert, 100),
        'role': shortened(message.role, 40),
        'client': shortened(message.client, 60),
        'console': shortened(message.console, 100),
        'what': shortened(_words(message), _LONGEST),
        'robot': shortened(message.robot, 100),
        'ok': message.ok,
        'message': shortened(message.message, _LONGEST),
    }


def _words(message: ConsoleCommand) -> str:
    try:
        told = json.loads(message.arguments)
    except (ValueError, RecursionError):
        told = None
    words = [message.command.replace('_', ' ')]
    if isinstance(told, dict):
        words += [str(told[key]) for key in ('kind',) if told.get(key)]
        words += [str(told[key]) for key in _ABOUT if told.get(key)][:1]
    return ' '.join(words)
