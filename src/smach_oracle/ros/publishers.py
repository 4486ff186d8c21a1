"""Publishers of what the executive does and learns: topics `~oracle/events` and `~oracle/rates`.

Both are fed by the machine's own thread and never hold it: an event goes to rospy's send queue, which drops its oldest
entry where a subscriber is too slow (the gap shows in the sequence numbers); rates go out from a thread of their own.
"""
import threading
import time
import weakref
from typing import Any, Dict, Optional

import rospy

from smach_oracle.msg import OracleEvent, OracleRates
from smach_oracle.oracle.events import Event, EventKind

from .event_messages import rates_to_msg, to_msg

QUEUE_SIZE = 1000  # events waiting for one slow subscriber; about 0.3 MB
RATES_PERIOD_S = 0.2  # at most 5 Hz
STEPS_THAT_TEACH = frozenset([EventKind.TRIAL_START, EventKind.TRANSITION, EventKind.FAILURE, EventKind.JUMP,
                              EventKind.SUPERSEDE, EventKind.GIVE_UP])


class EventPublisher:
    """An observer that publishes every event on `~oracle/events`."""

    def __init__(self, topic: str = '~oracle/events', queue_size: int = QUEUE_SIZE) -> None:
        self._publisher = rospy.Publisher(topic, OracleEvent, queue_size=queue_size)

    def __call__(self, event: Event) -> None:
        """Publish; without a subscriber this costs a function call or two."""
        try:
            if not rospy.is_shutdown() and self._publisher.get_num_connections():
                self._publisher.publish(to_msg(event))
        except (AttributeError, TypeError, rospy.ROSException):  # rospy takes a topic apart while it shuts down
            if not rospy.core.is_shutdown_requested():
                raise

    def close(self) -> None:
        """Take the topic back."""
        self._publisher.unregister()


class RatesPublisher:
    """Publishes what every watched machine has learned on `~oracle/rates` (latched).

    A machine is published when it was first watched, at most `1 / period_s` times a second while it runs, and at the
    end of each of its trials.
    """

    def __init__(self, topic: str = '~oracle/rates', period_s: float = RATES_PERIOD_S) -> None:
        self._publisher = rospy.Publisher(topic, OracleRates, queue_size=10, latch=True)
        self._period_s = period_s
        self._wake = threading.Condition()
        # Of two threads the one that looked last publishes last: its message stays latched. Re-entrant, as a signal
        # handler may end a trial in the thread that publishes.
        self._publishing = threading.RLock()
        self._pending: Dict[int, Any] = {}  # id(container) -> weak reference
        self._closed = False
        self._thread = threading.Thread(target=self._run, name='oracle_rates', daemon=True)
        self._thread.start()

    def watch(self, container: Any) -> '_RatesObserver':
        """Follow a wrapped machine.

        :returns: the observer, already among `container.events.observers`.
        """
        observer = _RatesObserver(self, container)
        container.events.observers.append(observer)
        self.request(container)
        return observer

    def request(self, container: Any) -> None:
        """Publish this machine's rates soon."""
        if id(container) in self._pending:  # the common case, without the lock: the thread will look at it anyway
            return
        with self._wake:
            self._pending[id(container)] = weakref.ref(container)
            self._wake.notify()

    def publish(self, container: Any) -> None:
        """Publish this machine's rates now."""
        with self._publishing:
            message = rates_to_msg(container.trial_id, container.rates(), container.transition_counts())
            if not rospy.is_shutdown() and not self._closed:
                self._publisher.publish(message)

    def close(self) -> None:
        """Stop the thread and take the topic back."""
        with self._wake:
            self._closed = True
            self._wake.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join(1.0)
        self._publisher.unregister()

    def _run(self) -> None:
        while self._wait():
            time.sleep(self._period_s)
            with self._wake:
                due, self._pending = self._pending, {}
            for reference in due.values():
                self._publish_quietly(reference())

    def _wait(self) -> bool:
        """Until something is to be published; False once closed."""
        with self._wake:
            while not self._pending and not self._closed:
                self._wake.wait()
            return not self._closed

    def _publish_quietly(self, container: Optional[Any]) -> None:
        if container is None:
            return
        try:
            self.publish(container)
        except RuntimeError:  # a table grew while it was read: the machine goes on, the next round gets it
            self.request(container)
        except Exception as err:  # this thread serves every machine of the process
            rospy.logerr('~oracle/rates: %r', err)


class _RatesObserver:
    """Marks one machine as changed; publishes at once at the end of a trial."""

    def __init__(self, publisher: RatesPublisher, container: Any) -> None:
        self._publisher = publisher
        self._container = weakref.ref(container)

    def __call__(self, event: Event) -> None:
        container = self._container()
        if container is None:
            return
        if event.kind == EventKind.TRIAL_END:
            self._publisher.publish(container)
        elif event.kind in STEPS_THAT_TEACH:
            self._publisher.request(container)
