"""Publishers of what the executive does and learns: topics `~oracle/events` and `~oracle/rates`.

Both are fed by the machine's own thread and never hold it: an event goes to rospy's send queue,
which drops its oldest entry where a subscriber is too slow (the gap shows in the sequence numbers).
Rates go out from a thread of their own.
"""

import threading
import time
import weakref
from typing import Dict, Optional, Protocol, Sequence, Union

import rospy

from smach_common.foreign import error_text
from smach_oracle.msg import OracleEvent, OracleRates
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.records.events import Event, EventKind, EventSource, OwnObserver
from smach_oracle.oracle.records.visits import StateRateRow, TransitionRow

from .connections import TOPIC_ERRORS, quiet_at_shutdown
from .event_messages import rates_to_msg, to_msg
from .log.said_once import SaidOnce

QUEUE_SIZE = 1000  # events waiting for one slow subscriber, about 0.3 MB
RATES_PERIOD_S = 0.2  # at most 5 Hz
KINDS_THAT_CHANGE_RATES = frozenset(
    [
        EventKind.TRIAL_START,
        EventKind.TRANSITION,
        EventKind.FAILURE,
        EventKind.JUMP,
        EventKind.SUPERSEDE,
        EventKind.GIVE_UP,
    ]
)


class RatesSource(Protocol):
    """A source of learned rates: a wrapped machine, or its oracle."""

    @property
    def trial_id(self) -> str:
        """Return the id of the present or latest trial."""

    @property
    def events(self) -> EventSource:
        """Return the events of its trials."""

    def rates(self) -> Sequence[StateRateRow]:
        """Return a row for each state."""

    def transition_counts(self) -> Sequence[TransitionRow]:
        """Return a row for each edge that was taken."""


WatchedMachine = Union[OracleContainer, RatesSource]


def rates_of(machine: WatchedMachine) -> OracleRates:
    """Return what a machine has learned, as a message."""
    source = _source_of(machine)
    return rates_to_msg(source.trial_id, source.rates(), source.transition_counts())


def _source_of(machine: WatchedMachine) -> RatesSource:
    """The machine's oracle, where it has one.

    A user's class may have taken the names of a container's attributes for its own ends.
    """
    return oracle_of(machine) if isinstance(machine, OracleContainer) else machine


class EventPublisher(OwnObserver):
    """An observer that publishes every event on `~oracle/events`."""

    observer_name = 'the publisher of ~oracle/events'
    without_it = 'consoles and other subscribers miss this event'

    def __init__(self, topic: str = '~oracle/events', queue_size: int = QUEUE_SIZE) -> None:
        self._publisher = rospy.Publisher(topic, OracleEvent, queue_size=queue_size)

    def __call__(self, event: Event) -> None:
        """Publish. Without a subscriber this costs a function call or two."""
        try:
            if not rospy.is_shutdown() and self._publisher.get_num_connections():
                self._publisher.publish(to_msg(event))
        except TOPIC_ERRORS:  # as quiet_at_shutdown, but cheaper for a machine's every event
            if not rospy.core.is_shutdown_requested():
                raise

    def close(self) -> None:
        """Take the topic back."""
        self._publisher.unregister()


class RatesPublisher:
    """Publishes what every watched machine has learned on `~oracle/rates` (latched).

    A machine is published when it was first watched, at most `1 / period_s` times a second while it
    runs, and at the end of each of its trials.
    """

    def __init__(self, topic: str = '~oracle/rates', period_s: float = RATES_PERIOD_S) -> None:
        self._publisher = rospy.Publisher(topic, OracleRates, queue_size=10, latch=True)
        self._error_once = SaidOnce(lambda text: rospy.logerr('%s', text))
        self._period_s = period_s
        self._wake = threading.Condition()
        # Of two threads the one that looked last publishes last: its message stays latched.
        # Re-entrant, as a signal handler may end a trial in the thread that publishes.
        self._publishing = threading.RLock()
        self._pending: Dict[int, 'weakref.ref[WatchedMachine]'] = {}  # by id(machine)
        self._closed = False
        self._thread = threading.Thread(target=self._run, name='oracle_rates', daemon=True)
        self._thread.start()

    def watch(self, machine: WatchedMachine) -> '_RatesObserver':
        """Follow a wrapped machine.

        :returns: the observer, already among the observers of its events.
        """
        observer = _RatesObserver(self, machine)
        _source_of(machine).events.observers.append(observer)
        self.request(machine)
        return observer

    def request(self, machine: WatchedMachine) -> None:
        """Publish this machine's rates soon."""
        # the common case, without the lock: the thread will look at it anyway
        if id(machine) in self._pending:
            return
        with self._wake:
            self._pending[id(machine)] = weakref.ref(machine)
            self._wake.notify()

    def publish(self, machine: WatchedMachine) -> None:
        """Publish this machine's rates now."""
        with self._publishing:
            message = rates_of(machine)
            if not rospy.is_shutdown() and not self._closed:
                with quiet_at_shutdown():
                    self._publisher.publish(message)

    def forget(self, machine: WatchedMachine) -> None:
        """Publish nothing of a machine any more that has ended and comes out of its oracle."""
        with self._publishing, self._wake:
            self._pending.pop(id(machine), None)

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
            with self._publishing:
                with self._wake:
                    due, self._pending = self._pending, {}
                for reference in due.values():
                    self._publish_quietly(reference())

    def _wait(self) -> bool:
        """Until something is to be published. It is False once closed."""
        with self._wake:
            while not self._pending and not self._closed:
                self._wake.wait()
            return not self._closed

    def _publish_quietly(self, machine: Optional[WatchedMachine]) -> None:
        if machine is None:
            return
        try:
            self.publish(machine)
        except RuntimeError:
            # a table grew while it was read: the machine goes on, the next round gets it
            self.request(machine)
        except Exception as err:  # this thread serves every machine of the process
            self._error_once(
                '~oracle/rates are not published: {}. This is said once'.format(error_text(err))
            )


class _RatesObserver(OwnObserver):
    """Marks one machine as changed. It publishes at once at the end of a trial."""

    observer_name = 'the publisher of ~oracle/rates'
    without_it = 'consoles show older rates'

    def __init__(self, publisher: RatesPublisher, machine: WatchedMachine) -> None:
        self._publisher = publisher
        self._machine = weakref.ref(machine)

    def __call__(self, event: Event) -> None:
        machine = self._machine()
        if machine is None:
            return
        if event.kind == EventKind.TRIAL_END:
            self._publisher.publish(machine)
        elif event.kind in KINDS_THAT_CHANGE_RATES:
            self._publisher.request(machine)
