"""Listens to topics and to the diagnostics: what was heard last, and when.

rospy has one subscriber per topic and process, of the type that came first, so a topic is
subscribed to with its true type. A type that is not installed here is read by its definition, which
its publisher sends.
"""

import threading
import time
from collections import deque
from typing import Any, Callable, Deque, Dict, List, NamedTuple, Optional, Set, Tuple

import genpy.dynamic
import rosgraph
import rospy

from ..recording.recorder_topics import types_at_master, types_in_process
from .field_rules import Status

DIAGNOSTICS = ('/diagnostics', '/diagnostics_agg')
# for the types of topics that nobody has advertised yet: twice as long after each look
LOOK_AGAIN_S = 0.5
LOOK_AGAIN_MOST_S = 10.0
KEPT = 256  # messages of a topic: those between two looks, at up to 2 kHz


class Arrival(NamedTuple):
    """A message, or a Status. Times are monotonic."""

    what: Any
    at_s: float
    gap_s: float  # since the one before


class Latest:
    """The newest messages of one topic, or statuses of one name."""

    def __init__(self) -> None:
        self._heard: Deque[Arrival] = deque(maxlen=KEPT)

    def put(self, what: Any) -> None:
        """Take what was heard now."""
        self._heard.append(Arrival(what, time.monotonic(), self.age_s() or 0.0))

    def newest(self) -> Optional[Arrival]:
        """Return the newest, or None where nothing was heard."""
        try:
            return self._heard[-1]
        except IndexError:
            return None

    def since(self, since_s: float) -> List[Arrival]:
        """Return what was heard after that time, and the newest in any case."""
        heard = list(self._heard)
        return [each for each in heard[:-1] if each.at_s > since_s] + heard[-1:]

    def age_s(self) -> Optional[float]:
        """Return how old the newest is, or None where nothing was heard."""
        newest = self.newest()
        return time.monotonic() - newest.at_s if newest is not None else None


class HealthTopics:
    """The topics of health of one process, each subscribed to once. Not for the main thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._messages: Dict[str, Latest] = {}
        self._statuses: Dict[str, Latest] = {}
        self._unknown: Dict[str, Callable[[Any], None]] = {}  # topics without a type so far
        self._subscribers: List[rospy.Subscriber] = []
        self._looking = False
        self._has_more = threading.Event()  # topics to look for
        # sources that somebody warns of already, or has warned of: a script may build a machine
        # for each trial
        self.watched: Set[str] = set()
        self.warned: Set[str] = set()

    def message(self, topic: str) -> Latest:
        """Return the latest message of a topic, listened to from now on. See `decoded`."""
        name = rospy.resolve_name(topic)
        with self._lock:
            is_new = name not in self._messages
            latest = self._messages.setdefault(name, Latest())
            if is_new:
                self._unknown[name] = latest.put
                self._has_more.set()
        self._subscribe()
        return latest

    def status(self, name: str) -> Latest:
        """Return the latest Status of a name in the diagnostics, listened to from now on."""
        with self._lock:
            is_first = not self._statuses
            latest = self._statuses.setdefault(name.strip('/'), Latest())
            if is_first:
                self._unknown.update(
                    (rospy.resolve_name(topic), self._take_diagnostics) for topic in DIAGNOSTICS
                )
                self._has_more.set()
        self._subscribe()
        return latest

    def _take_diagnostics(self, message: Any) -> None:
        try:
            found = [
                (status.name.strip('/'), Status(level_of(status.level), str(status.message)))
                for status in decoded(message).status
            ]
        except (UnreadableMessage, AttributeError, TypeError, ValueError) as err:
            # of another type than theirs, or damaged
            rospy.logwarn_throttle(60.0, 'healthy: diagnostics that cannot be read: {}'.format(err))
            return
        for name, status in found:
            latest = self._statuses.get(name)
            if latest is not None:
                latest.put(status)

    def _subscribe(self) -> None:
        """Subscribe to what has a type. Look again where one has none."""
        try:
            known = {**types_at_master(), **types_in_process()}
        except (OSError, rosgraph.MasterException, ValueError):
            known = types_in_process()  # the master is away. It is asked again
        with self._lock:
            for topic in [topic for topic in self._unknown if topic in known]:
                take = self._unknown.pop(topic)
                self._subscribers.append(rospy.Subscriber(topic, known[topic], take))
            if self._unknown and not self._looking:
                self._looking = True
                threading.Thread(target=self._look, name='health topics', daemon=True).start()

    def _look(self) -> None:
        pause_s = LOOK_AGAIN_S
        while not rospy.core.is_shutdown_requested():
            if self._has_more.wait(pause_s):
                self._has_more.clear()
                pause_s = LOOK_AGAIN_S
            else:
                pause_s = min(2.0 * pause_s, LOOK_AGAIN_MOST_S)
            self._subscribe()
            with self._lock:
                if not self._unknown:
                    self._looking = False
                    return


_classes: Dict[Tuple[str, str], Any] = {}  # of types that are not installed, by name and md5


class UnreadableMessage(Exception):
    """A message of a type that is not installed here cannot be read."""


def decoded(message: Any) -> Any:
    """Return a received message with its fields.

    :raises UnreadableMessage: where its type is not installed here, and its definition does not
        help.
    """
    if not isinstance(message, rospy.AnyMsg):
        return message
    try:
        return _class_of(message._connection_header)().deserialize(message._buff)
    except Exception as err:  # genpy raises what the definition and the bytes drive it to
        raise UnreadableMessage('{}: {}'.format(type(err).__name__, err)) from err


def _class_of(header: Dict[str, str]) -> Any:
    """The class of a type by the definition that its publisher sends."""
    key = (header['type'], header['md5sum'])
    if key not in _classes:
        made = genpy.dynamic.generate_dynamic(header['type'], header['message_definition'])
        _classes[key] = made[header['type']]
    return _classes[key]


def level_of(level: Any) -> int:
    """Return the level of a status, which some releases of genpy give as a byte."""
    return level[0] if isinstance(level, bytes) and level else int(level)
