"""The newest message of a topic, and waiting for one that comes after a moment."""

import threading
import time
from typing import Any, Callable, Optional

import rospy

POLL_S = 0.5  # wall time after which a wait looks whether the node ends


class NewestMessage:
    """Listens to a topic."""

    def __init__(self, topic: str, spec: type) -> None:
        self.message: Any = None
        self._changed = threading.Condition()
        self._subscriber = rospy.Subscriber(
            topic, spec, self._keep, queue_size=1, buff_size=1 << 21, tcp_nodelay=True
        )

    def after(self, stamp: rospy.Time, limit_s: float) -> Optional[Any]:
        """The first message that is stamped later.

        :param limit_s: wall time.
        :returns: None where none comes in time.
        """
        return self._wait(
            lambda: self.message is not None and self.message.header.stamp > stamp, limit_s
        )

    def any(self, limit_s: float) -> Optional[Any]:
        """The newest message, or None where there is none within so much wall time (s)."""
        return self._wait(lambda: self.message is not None, limit_s)

    def stop(self) -> None:
        """Listen no longer."""
        self._subscriber.unregister()

    def _wait(self, holds: Callable[[], bool], limit_s: float) -> Optional[Any]:
        until_s = time.monotonic() + limit_s
        with self._changed:
            while not holds():
                left_s = until_s - time.monotonic()
                if left_s <= 0 or rospy.is_shutdown():
                    return None
                self._changed.wait(min(left_s, POLL_S))
            return self.message

    def _keep(self, message: Any) -> None:
        with self._changed:
            self.message = message
            self._changed.notify_all()
