"""Records each trial into a bag of its own.

No event is lost, and the robot is never held up for good.
"""

import atexit
import logging
import os
import threading
import time
from typing import TYPE_CHECKING, Callable, Mapping, Optional, Sequence, Tuple, Union

import genpy
import rospy

from smach_common.foreign import error_text, repr_of
from smach_oracle.forking import in_child
from smach_oracle.oracle.identity import WeakIdentityMap, remove_identical
from smach_oracle.oracle.records.events import Event, EventKind, EventSource, OwnObserver
from smach_oracle.oracle.settings.paths import path_of

from .connections import quiet_at_shutdown
from .disk.limits import NO_LIMITS, Limits
from .disk.pruner import Pruner
from .log.said_once import SaidOnce
from .recording.recorder_queue import (
    EndItem,
    EventItem,
    MessageItem,
    QueueItem,
    RecorderQueue,
    SnapshotItem,
    new_event_item,
)
from .recording.recorder_status import DiskWatch, LossCounter, RecorderState, RecordingStatus
from .recording.recorder_topics import MessageClass, TopicListener, moment_at, now
from .recording.trial_bags import OPEN_A_BAG, RecorderTopics, Reporter, TrialBags, status_message

if TYPE_CHECKING:  # it imports smach, which events of another source can do without
    from smach_oracle.oracle import OracleContainer

MAX_EVENTS = 1000
WEIGHT_OF_A_FILE = 20  # opening and closing one takes as long as writing so many events
MAX_MESSAGE_BYTES = 64 * 1024 * 1024
HUNG_AFTER_S = 5.0
CLOSE_S = 1.0
LONGEST_ITEM = 500  # letters of one that is not recorded, in the log
LATE_S = 0.4  # a bag stays open after its trial for messages on their way, also on a busy machine

Snapshots = Mapping[str, Callable[[], Optional[genpy.Message]]]  # by topic
Log = Callable[[str], None]
StatusCallback = Callable[[RecordingStatus], None]


class TrialRecorder(OwnObserver):
    """Writes the events of every attached machine, and the messages of other topics, to `folder`.

    While the disk works, the machine waits for the recorder where it must (bounded queue). Where
    the disk fails, or hangs for more than `hung_after_s`, events are dropped, counted and reported,
    and the robot goes on. With a node (rospy initialised before), topics are subscribed to and
    `~record/status` is published. Without one, the events alone are recorded.
    """

    observer_name = 'the recorder'
    without_it = 'this event is not in the bag'

    def __init__(
        self,
        folder: str,
        topics: Sequence[str] = (),
        *,
        types: Optional[Mapping[str, MessageClass]] = None,
        warn: Optional[Log] = None,
        say: Optional[Log] = None,
        on_status: Optional[StatusCallback] = None,
        max_events: int = MAX_EVENTS,
        max_message_bytes: int = MAX_MESSAGE_BYTES,
        hung_after_s: float = HUNG_AFTER_S,
        keep: Limits = NO_LIMITS,
    ) -> None:
        """Create the folder, mend the bags of recorders that died in it, and start.

        :param topics: names of other topics to record, each from when it is first published.
        :param types: message classes of those of them that are known beforehand.
        :param warn: logs faults. Default: rospy's log, or without a node the log
            `smach_oracle.recorder`.
        :param say: logs good news. Default as for `warn`.
        :param on_status: called with each change of status, in the recorder's threads.
        :param keep: bags of earlier trials over these limits are removed when a trial's bag is
            closed, each after a line in the log. By default all stay.
        :raises OSError: where the folder cannot be made or written: better known before the robot
            moves.
        """
        self.folder = os.path.abspath(path_of(folder))
        prepare_folder(self.folder)
        default_info, default_warn = default_log()
        self._on_status = on_status
        self._publisher = StatusPublisher() if has_node() else None
        self._reporter = Reporter(say or default_info, warn or default_warn, self._report)
        self._warn_once = SaidOnce(self._reporter.warn)
        self._pruner = Pruner(self.folder, keep, self._reporter.info, self._reporter.warn)
        self.losses = LossCounter()
        self._watch = DiskWatch(hung_after_s)
        self._queue = RecorderQueue(max_events, max_message_bytes)
        self._topics = own_topics()
        listens = bool(topics) and has_node()
        self._last_end = -LATE_S  # of a trial, by time.monotonic()
        self._bags = TrialBags(
            self.folder,
            self._topics,
            self._reporter,
            self.losses,
            self._watch,
            LATE_S if listens else 0.0,
        )
        self._bags.recover()
        self._attached: WeakIdentityMap[EventSource, _MachineObserver] = WeakIdentityMap()
        self._hung = False
        self._closed = False
        self._is_parents = False
        self._thread = threading.Thread(target=self._write_all, name='trial recorder', daemon=True)
        self._thread.start()
        self._listener = TopicListener(topics, self._take_message, types) if listens else None
        atexit.register(self.close)
        in_child(self._let_go)

    def _let_go(self) -> None:
        self._is_parents = True  # a child has no writer thread, and the bag is its parent's

    def attach(
        self, machine: Union['OracleContainer', EventSource], snapshots: Optional[Snapshots] = None
    ) -> None:
        """Record the trials of a machine: an OracleContainer, or any EventSource. Twice is once.

        :param snapshots: by topic, what gives a message (or None) to be recorded at the start and
            at the end of each trial. It is called in the machine's thread.
        """
        source = machine if isinstance(machine, EventSource) else machine.events
        if source in self._attached:
            return
        observer = _MachineObserver(
            self._observe,
            self._put_snapshot,
            self._put_end,
            self._warn_once,
            {resolve(topic): take for topic, take in (snapshots or {}).items()},
        )
        self._attached[source] = observer
        source.observers.append(observer)

    def detach(self, source: EventSource) -> None:
        """Record no more trials of a machine. It is between two trials."""
        observer = self._attached.get(source)
        if observer is not None:
            self._attached.forget(source)
            remove_identical(source.observers, observer)
            observer.end()

    def __call__(self, event: Event) -> None:
        """Record one event. The observer that a machine without snapshots may be given directly."""
        self._observe(event)

    def _observe(self, event: Event) -> None:
        if self._is_parents:
            return
        item = new_event_item(event, moment_at(event.wall_time))
        weight = WEIGHT_OF_A_FILE if event.kind in OPEN_A_BAG else 1
        if not self._queue.put_event(item, self._may_wait, weight):
            self.losses.add_events(event.trial_id, 1)
            self._note_drop()
        if event.kind == EventKind.TRIAL_END:
            self._last_end = item.when.monotonic

    def put(self, trial_id: str, topic: str, message: genpy.Message) -> None:
        """Put a message into the bag of one trial that runs. It waits as events do.

        :param topic: resolved.
        """
        self._put_snapshot(trial_id, topic, message)

    def _put_snapshot(self, trial_id: str, topic: str, message: genpy.Message) -> None:
        self._queue.put_event(SnapshotItem(trial_id, topic, message, now()), self._may_wait)

    def _put_end(self, trial_id: str) -> None:
        self._queue.put_event(EndItem(trial_id, now()), self._may_wait)

    def _take_message(self, item: MessageItem) -> None:
        if not self._queue.put_message(item):
            self.losses.add_message()

    def _may_wait(self) -> bool:
        return self._thread.is_alive() and not self._watch.hangs()

    def _note_drop(self) -> None:
        if self._hung or self._closed:
            return
        self._hung = True
        text = '{}: the disk has hung for more than {:g} s'.format(
            self.folder, self._watch.hung_after_s
        )
        self._reporter.warn(
            'Trials are not recorded any more, events are dropped and counted; {}'.format(text)
        )
        self._report(
            RecordingStatus(
                RecorderState.DROPPING, events_lost_in_total=self.losses.events, text=text
            )
        )

    def _write_all(self) -> None:
        try:
            closing = False
            while not closing:
                items, closing = self._queue.take(self._bags.wait_s())
                for item in items:
                    try:
                        self._bags.write(item)
                    except Exception as err:  # one that cannot be converted costs no later one
                        self._lose(item, err)
                self._bags.tick()
                self._note_answer(items)
            self._bags.close()
        finally:
            self._queue.finish()

    def _note_answer(self, items: Sequence[QueueItem]) -> None:
        if self._hung and items:
            self._hung = False
            self._reporter.info(
                'The disk answers again; {} events were lost so far'.format(self.losses.events)
            )

    def _lose(self, item: QueueItem, err: Exception) -> None:
        if isinstance(item, EventItem):
            self.losses.add_events(item.event.trial_id, 1)
        why = error_text(err)
        self._warn_once(
            'Not recorded: {}: {}. The recorder goes on, and counts what it '
            'loses. This is said once'.format(repr_of(item)[:LONGEST_ITEM], why),
            type(item),
            why,
        )

    def _report(self, status: RecordingStatus) -> None:
        if status.state is RecorderState.IDLE and not self._closed:
            self._pruner.bag_closed()
        for publish in (self._on_status, self._publisher):
            if publish is not None:
                try:
                    publish(status)
                except Exception as err:  # a listener must not stop the writer
                    self._warn_once(
                        'Recorder status not passed on: {}. This is said once'.format(
                            error_text(err)
                        )
                    )

    def close(self, timeout_s: float = CLOSE_S) -> bool:
        """Write what waits, close all bags, also of trials that have not ended, and stop.

        Idempotent, any thread. Messages of other topics that are on their way at the end of a trial
        are waited for, up to half of `timeout_s`, unless the node is shut down: it hears no more.

        :returns: whether all was done within `timeout_s`. It is False where the disk hangs: the
            bags are mended at the next start.
        """
        if self._is_parents:
            return True
        deadline = time.monotonic() + timeout_s
        if not self._closed and self._listener and not rospy.core.is_shutdown_requested():
            self._queue.wait_while(self._late_may_come, timeout_s / 2)
        first, self._closed = not self._closed, True
        done = self._queue.close(max(0.0, deadline - time.monotonic()))
        # unsubscribing talks to the master, which may be gone
        if first and self._listener is not None:
            threading.Thread(
                target=self._listener.close, name='recorder unsubscribes', daemon=True
            ).start()
        if first:
            self._report_closing(done)
        return done

    def _late_may_come(self) -> bool:
        return time.monotonic() < self._last_end + LATE_S or self._bags.any_over()

    def _report_closing(self, done: bool) -> None:
        atexit.unregister(self.close)
        if not done:
            self._reporter.warn(
                '{}: the disk did not let the recorder close its bags in time'.format(self.folder)
            )
        self._report(
            RecordingStatus(
                RecorderState.CLOSED,
                events_lost_in_total=self.losses.events,
                messages_dropped=self.losses.messages,
            )
        )


class _MachineObserver(OwnObserver):
    """The observer of one machine.

    It knows which trial the machine is in, and takes the snapshots around it.
    """

    observer_name, without_it = TrialRecorder.observer_name, TrialRecorder.without_it

    def __init__(
        self,
        observe: Callable[[Event], None],
        put_snapshot: Callable[[str, str, genpy.Message], None],
        put_end: Callable[[str], None],
        warn_once: SaidOnce,
        snapshots: Snapshots,
    ) -> None:
        self._observe = observe
        self._put_snapshot = put_snapshot
        self._put_end = put_end
        self._warn_once = warn_once
        self._snapshots = snapshots
        self._trial_id: Optional[str] = None

    def end(self) -> None:
        """Close the bag of a trial that ended without saying so."""
        if self._trial_id is not None:
            self._put_end(self._trial_id)
            self._trial_id = None

    def __call__(self, event: Event) -> None:
        if event.trial_id != self._trial_id:
            self.end()
        self._trial_id = None if event.kind == EventKind.TRIAL_END else event.trial_id
        if event.kind == EventKind.TRIAL_END:
            self._take_snapshots(event)
        self._observe(event)
        if event.kind in OPEN_A_BAG:
            self._take_snapshots(event)

    def _take_snapshots(self, event: Event) -> None:
        for topic, take in self._snapshots.items():
            try:
                message = take()
            except Exception as err:  # the rates must not cost the events
                why = error_text(err)
                self._warn_once(
                    'No {} in the bag of {}: {}. This is said once'.format(
                        topic, event.trial_id, why
                    ),
                    topic,
                    why,
                )
                continue
            if message is not None:
                self._put_snapshot(event.trial_id, topic, message)


class StatusPublisher:
    """Publishes the status on the latched topic `~record/status`."""

    def __init__(self) -> None:
        from smach_oracle.msg import RecorderStatus

        self._publisher = rospy.Publisher(
            '~record/status', RecorderStatus, latch=True, queue_size=10
        )

    def __call__(self, status: RecordingStatus) -> None:
        message = status_message(status)
        message.header.stamp.secs, message.header.stamp.nsecs = now().ros or (0, 0)
        with quiet_at_shutdown():
            self._publisher.publish(message)


def has_node() -> bool:
    """Whether rospy.init_node was called in this process."""
    return bool(rospy.core.is_initialized())


def resolve(topic: str) -> str:
    """Return a topic's name as it is in the bag.

    Without a node there is no name to put in front of `~`.
    """
    return str(rospy.resolve_name(topic)) if has_node() else '/' + topic.lstrip('~/')


def own_topics() -> RecorderTopics:
    """Return where the events and the recorder's status are, in the bag and on the wire."""
    return RecorderTopics(resolve('~oracle/events'), resolve('~record/status'))


def default_log() -> Tuple[Log, Log]:
    """Return functions that log good news and faults."""
    if has_node():
        return rospy.loginfo, rospy.logerr
    log = logging.getLogger('smach_oracle.recorder')
    return log.info, log.error


def prepare_folder(folder: str) -> None:
    """Make the folder and try that a file can be made in it.

    :raises OSError: where it cannot.
    """
    os.makedirs(folder, exist_ok=True)
    probe = os.path.join(folder, '.recorder-{}-{}'.format(os.getpid(), time.monotonic_ns()))
    os.close(os.open(probe, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
    os.unlink(probe)
