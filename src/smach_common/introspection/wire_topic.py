"""Messages that are serialised once, and sent many at a time.

rospy serialises a message each time it publishes it, and hands each to the thread of each
subscriber by itself. For a thousand messages in two seconds that was most of what they cost.
"""

import io
import struct
import threading
import time
import weakref
from typing import (
    Any,
    Callable,
    Dict,
    Iterable,
    List,
    MutableMapping,
    NamedTuple,
    Sequence,
    Tuple,
    Type,
)

import genpy
import rospy

SUBSCRIBER_QUEUE = 5000
LARGEST_KEPT = 10000
LAGGING_BYTES = 1024 * 1024
"""A subscriber for whom that much waits gets no heartbeats until it has read."""
FLUSH_S = 0.5
"""So long a closed topic may still write what was sent."""
_LOOK_S = 0.005
_HEAD = struct.Struct('<4I')  # bytes that follow the first four, seq, secs and nsecs of the Header
_STAMP_BYTES = 12


class WireMessage(NamedTuple):
    """A message with a Header, as it goes out."""

    stamp: genpy.Time
    body: bytes  # what follows seq and stamp


def serialised(message: genpy.Message) -> WireMessage:
    """Return a message, whose first field is a Header, as it goes out.

    :raises Exception: what genpy raises for a field that cannot be serialised.
    """
    buffer = io.BytesIO()
    message.serialize(buffer)
    return WireMessage(message.header.stamp, buffer.getvalue()[_STAMP_BYTES:])


class LatestMessages(object):
    """The latest message of each container. Serialised again only where a field has changed."""

    def __init__(self, message_class: Type[genpy.Message]) -> None:
        self._message_class = message_class
        self._latest: Dict[str, Tuple[Sequence[Any], bytes]] = {}

    def make(self, stamp: genpy.Time, path: str, *fields: Any) -> WireMessage:
        """Return a message of these fields.

        :param fields: those behind `path`, in the order of the message, not to be changed later.
        :raises Exception: what genpy raises for a field that cannot be serialised.
        """
        latest = self._latest.get(path)
        if latest is not None and latest[0] == fields:
            return WireMessage(stamp, latest[1])
        try:
            made = self._make(stamp, (path,) + fields)
        except UnicodeEncodeError:  # half a character, as file names may have
            made = self._make(stamp, [_sendable(value) for value in (path,) + fields])
        if len(made.body) <= LARGEST_KEPT:
            self._latest[path] = (fields, made.body)
        return made

    def _make(self, stamp: genpy.Time, values: Sequence[Any]) -> WireMessage:
        message = self._message_class()
        message.header.stamp = stamp
        for name, value in zip(message.__slots__[1:], values):
            setattr(message, name, value)
        return serialised(message)

    def keep_only(self, paths: Iterable[str]) -> None:
        """Forget the messages of containers at other paths."""
        for path in set(self._latest).difference(paths):
            del self._latest[path]


def _sendable(value: Any) -> Any:
    """A text, or a list of some, with what is no UTF-8 written out."""
    if isinstance(value, str):
        return value.encode('utf-8', 'backslashreplace').decode('utf-8')
    return [_sendable(each) for each in value]


class _Newcomers(rospy.SubscribeListener):
    def __init__(self, on_newcomer: Callable[[], None]) -> None:
        super().__init__()
        self._on_newcomer = on_newcomer

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        self._on_newcomer()


class WireTopic(object):
    """A topic that takes such messages. Any thread may send."""

    def __init__(
        self, name: str, message_class: Type[genpy.Message], on_newcomer: Callable[[], None]
    ) -> None:
        """
        :param name: of the topic, remapped as any.
        :param on_newcomer: called, in a thread of rospy's, for each new subscriber.
        """
        self._listener = _Newcomers(on_newcomer)
        self._publisher = rospy.Publisher(
            name, message_class, subscriber_listener=self._listener, queue_size=SUBSCRIBER_QUEUE
        )
        self.impl = self._publisher.impl
        """rospy's, with its connections; None once the topic is closed."""
        self._lock = threading.Lock()
        self._sent: MutableMapping[Any, int] = weakref.WeakKeyDictionary()  # by connection

    def is_heard(self) -> bool:
        """Whether anybody has subscribed."""
        impl = self.impl
        return impl is not None and bool(impl.connections)

    def send(self, messages: Sequence[WireMessage], to_lagging: bool = True) -> None:
        """Send messages to all subscribers. It does nothing where the topic is closed.

        :param to_lagging: also to those who have not read what was sent before.
        """
        impl = self.impl
        if impl is None or impl.closed or not messages:
            return
        with self._lock:
            data = b''.join(_frames(messages, impl.seq + 1))
            impl.seq += len(messages)
            for connection in impl.connections:
                if to_lagging or waiting_bytes([connection]) <= LAGGING_BYTES:
                    self._sent[connection] = self._sent.get(connection, 0) + 1
                    _write(connection, data)

    def close(self) -> None:
        """Take the topic back, when subscribers have what was sent, or FLUSH_S later."""
        impl, self.impl = self.impl, None
        if impl is None:
            return
        until = time.monotonic() + FLUSH_S
        while not self._is_flushed() and time.monotonic() < until:
            time.sleep(_LOOK_S)
        if impl.subscriber_listeners and self._listener in impl.subscriber_listeners:
            impl.subscriber_listeners.remove(self._listener)  # others may publish there, too
        self._publisher.unregister()

    def _is_flushed(self) -> bool:
        """Whether rospy's threads have written all. They take it out of their queues before."""
        with self._lock:
            return all(
                connection.done or connection.stat_num_msg >= count
                for connection, count in self._sent.items()
            )


def _frames(messages: Sequence[WireMessage], seq: int) -> List[bytes]:
    return [
        _HEAD.pack(_STAMP_BYTES + len(body), number & 0xFFFFFFFF, stamp.secs, stamp.nsecs) + body
        for number, (stamp, body) in enumerate(messages, seq)
    ]


def _write(connection: Any, data: bytes) -> None:
    try:
        connection.write_data(data)
    except Exception as err:
        # rospy's own publish does the same: who cannot be reached is no longer connected
        rospy.logdebug('%s no longer reads introspection: %r', connection.endpoint_id, err)
        connection.close()


def waiting_bytes(connections: Iterable[Any]) -> int:
    """Return what rospy keeps for subscribers that have not read it yet.

    A hung one must not eat the robot's memory.
    """
    return sum(
        len(data) for connection in connections for data in list(getattr(connection, '_queue', ()))
    )
