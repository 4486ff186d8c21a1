"""Subscribes to topics as soon as their types are known."""

import threading
from typing import Any, Callable, Dict, Mapping, Sequence

import rosgraph
import rospy

LOOK_AGAIN_S = 1.0  # for the types of topics that nobody has advertised yet


class KnownTopics:
    """The topics of a list that somebody advertises, if their type is one of some."""

    def __init__(
        self,
        topics: Sequence[str],
        types: Mapping[str, type],
        take: Callable[[Any, str], None],
        name: str,
    ) -> None:
        """
        :param topics: resolved names. One may stand there twice.
        :param types: the classes of messages by the names of their types.
        :param take: called with each message and its topic.
        :param name: of the thread that asks the master.
        """
        self._topics = list(dict.fromkeys(topics))
        self._types = types
        self._take = take
        self._stopped = threading.Event()
        self._subscribers: Dict[str, rospy.Subscriber] = {}
        if topics:
            threading.Thread(target=self._listen, name=name, daemon=True).start()

    def stop(self) -> None:
        """Listen no longer."""
        self._stopped.set()
        for subscriber in list(self._subscribers.values()):
            subscriber.unregister()

    def _listen(self) -> None:
        while (
            len(self._subscribers) < len(self._topics)
            and not rospy.is_shutdown()
            and not self._stopped.is_set()
        ):
            try:
                types = dict(rosgraph.Master(rospy.get_name()).getTopicTypes())
            except (OSError, rosgraph.MasterException):
                types = {}
            for topic in self._topics:
                if topic not in self._subscribers and types.get(topic) in self._types:
                    self._subscribers[topic] = rospy.Subscriber(
                        topic,
                        self._types[types[topic]],
                        self._take,
                        callback_args=topic,
                        queue_size=1,
                        buff_size=1 << 24,
                    )
            self._stopped.wait(LOOK_AGAIN_S)
