"""Opens, flushes and closes the bags of the trials that run.

A bag is given up where the disk does not take it.
"""

import threading
import time
from typing import Callable, Dict, NamedTuple, Optional, Tuple, Union

from smach_oracle.msg import RecorderStatus
from smach_oracle.oracle.records.events import Event, EventKind

from .bag_repair import recover_folder
from .recorder_queue import EndItem, EventItem, MessageItem, Moment, QueueItem, SnapshotItem
from .recorder_status import DiskWatch, LossCounter, RecorderState, RecordingStatus
from .trial_bag import SyncBudget, TrialBag

FIRST_RETRY_S, LONGEST_RETRY_S = 0.5, 5.0
MEND_WAIT_S = 2.0  # for bags to be mended, before the robot goes on meanwhile
OPEN_A_BAG = (EventKind.TRIAL_START, EventKind.RESUMED)
KeptKey = Tuple[Union[str, bytes], ...]
KEPT_FOR_NEXT_BAG = 500  # latched messages and structures with which every bag begins


class RecorderTopics(NamedTuple):
    """Resolved names of the recorder's own topics."""

    events: str
    status: str


class Reporter(NamedTuple):
    """The functions by which the recorder informs people.

    Called in its writer thread, or in the machine's where the disk hangs.
    """

    info: Callable[[str], None]
    warn: Callable[[str], None]
    status: Callable[[RecordingStatus], None]


class TrialBags:
    """One bag for each trial that runs, or has just ended.

    Used by the writer thread alone. It raises nothing on a disk error.

    After an error everything is dropped and counted, until a retry (after half a second, later
    after five, and at the start of every trial) finds that the disk takes a file again.
    """

    def __init__(
        self,
        folder: str,
        topics: RecorderTopics,
        reporter: Reporter,
        losses: LossCounter,
        watch: DiskWatch,
        late_s: float = 0.0,
    ) -> None:
        """
        :param late_s: how long a bag stays open after its trial, for messages on their way.
        """
        self._folder = folder
        self._topics = topics
        self._reporter = reporter
        self._losses = losses
        self._watch = watch
        self._budget = SyncBudget()
        self._late_s = late_s
        self._bags: Dict[str, TrialBag] = {}
        self._kept: Dict[KeptKey, MessageItem] = {}
        self._error = ''
        self._retry_at = 0.0
        self._retry_s = FIRST_RETRY_S
        self._mending: Optional[threading.Thread] = None

    def write(self, item: QueueItem) -> None:
        """Write an item of the recorder's queue into the bag or the bags that it belongs to."""
        if isinstance(item, EventItem):
            self._write_event(item.event, item.when)
        elif isinstance(item, MessageItem):
            self._keep(item)
            for bag in list(self._bags.values()):
                # what every later bag begins with is about the next trial, if this one is over
                if bag.over is None or kept_key(item) is None:
                    self._guard(bag, bag.add_raw, item)
        elif item.trial_id in self._bags:
            bag = self._bags[item.trial_id]
            if isinstance(item, EndItem):
                self._close(bag, item.when)
            elif isinstance(item, SnapshotItem):
                self._guard(bag, bag.add_message, item.topic, item.message, item.when, True)

    def _write_event(self, event: Event, when: Moment) -> None:
        if event.kind in OPEN_A_BAG:
            self._close_over(0.0)
        bag = self._bags.get(event.trial_id) or self._open(event, when)
        if bag is None:
            self._losses.add_events(event.trial_id, 1)
            return
        try:
            bag.add_event(self._topics.events, event, when)
        except OSError as err:
            self._give_up(bag, err)
        if self._error:
            self._guard(bag, bag.flush)
            if event.trial_id in self._bags:
                self._works_again(bag)
        if event.kind == EventKind.TRIAL_END and event.trial_id in self._bags:
            if self._late_s:
                bag.over = when
                self._guard(bag, bag.flush)  # a crash in the time that is left costs no event
            else:
                self._close(bag, when)

    def any_over(self) -> bool:
        """Whether a bag waits for messages after the end of its trial. Any thread."""
        return any(bag.over for bag in list(self._bags.values()))

    def _close_over(self, late_s: float) -> None:
        """Close the bags whose trials have been over for so long."""
        for bag in list(self._bags.values()):
            if bag.over and time.monotonic() - bag.over.monotonic >= late_s:
                self._close(bag, bag.over)

    def _open(self, event: Event, when: Moment) -> Optional[TrialBag]:
        if (
            self._error
            and time.monotonic() < self._retry_at
            and event.kind != EventKind.TRIAL_START
        ):
            return None
        try:
            bag = TrialBag(self._folder, event.trial_id, when, self._watch, self._budget)
        except OSError as err:
            self._fail(err)
            return None
        self._bags[event.trial_id] = bag
        for item in list(self._kept.values()):
            self._guard(bag, bag.add_raw, item._replace(when=when))
        if self._losses.events:
            self._guard(bag, self._add_status, bag, RecorderState.RECORDING, when)
        if not self._error:
            self._report(bag, RecorderState.RECORDING)
        return self._bags.get(event.trial_id)

    def _close(self, bag: TrialBag, when: Moment) -> None:
        self._guard(bag, self._add_status, bag, RecorderState.IDLE, when)
        self._guard(bag, bag.close)
        if self._bags.pop(bag.trial_id, None) is not None and not self._bags:
            self._report(bag, RecorderState.IDLE)

    def _add_status(self, bag: TrialBag, state: RecorderState, when: Moment) -> None:
        message = status_message(self._status(bag, state))
        message.header.stamp.secs, message.header.stamp.nsecs = when.ros or (0, 0)
        bag.add_message(self._topics.status, message, when, latching=True)

    def _guard(self, bag: TrialBag, work: Callable[..., None], *args: object) -> None:
        """Do what may meet a disk error, unless the bag has met one already."""
        if self._bags.get(bag.trial_id) is not bag:
            return
        try:
            work(*args)
        except OSError as err:
            self._give_up(bag, err)

    def _give_up(self, bag: TrialBag, err: OSError) -> None:
        del self._bags[bag.trial_id]
        self._losses.add_events(bag.trial_id, bag.abandon())
        self._fail(err, bag)

    def _fail(self, err: OSError, bag: Optional[TrialBag] = None) -> None:
        self._retry_s = min(2 * self._retry_s, LONGEST_RETRY_S) if self._error else FIRST_RETRY_S
        self._retry_at = time.monotonic() + self._retry_s
        if self._error:
            return
        self._error = '{}: {}'.format(self._folder, err.strerror or err)
        self._reporter.warn(
            'Trials are not recorded any more, events are dropped and counted; {}'.format(
                self._error
            )
        )
        self._report(bag, RecorderState.DROPPING)

    def _works_again(self, bag: TrialBag) -> None:
        self._error = ''
        self._reporter.info(
            'Trials are recorded again, into {}; {} events were lost so far'.format(
                bag.path, self._losses.events
            )
        )
        self._report(bag, RecorderState.RECORDING)
        self.recover()

    def _report(self, bag: Optional[TrialBag], state: RecorderState) -> None:
        self._reporter.status(self._status(bag, state))

    def _status(self, bag: Optional[TrialBag], state: RecorderState) -> RecordingStatus:
        losses = self._losses
        if bag is None:
            return RecordingStatus(
                state,
                events_lost_in_total=losses.events,
                messages_dropped=losses.messages,
                text=self._error,
            )
        return RecordingStatus(
            state,
            bag.path,
            bag.trial_id,
            bag.events_written,
            losses.of_trial(bag.trial_id),
            losses.events,
            losses.messages,
            self._error,
        )

    def _keep(self, item: MessageItem) -> None:
        """Remember messages that later bags need to be understood.

        Those are latched messages, and the structure of each container.
        """
        key = kept_key(item)
        if key is not None and (key in self._kept or len(self._kept) < KEPT_FOR_NEXT_BAG):
            self._kept[key] = item

    def recover(self) -> None:
        """Mend the bags of recorders that died in this folder, and our own that met an error.

        That is done soon for most. A large one is mended in the background: the robot need not wait
        for it.
        """
        if self._mending is None or not self._mending.is_alive():
            self._mending = threading.Thread(target=self._mend_all, name='bag mending', daemon=True)
            self._mending.start()
        self._mending.join(MEND_WAIT_S)

    def _mend_all(self) -> None:
        try:
            recover_folder(self._folder, self._reporter.info, self._reporter.warn)
        except OSError as err:
            self._reporter.warn(
                '{} cannot be searched for bags to mend: {}'.format(self._folder, err)
            )

    def wait_s(self) -> Optional[float]:
        """Return how long the writer thread may sleep. None means until something comes."""
        times = [due for due in (bag.due_s() for bag in self._bags.values()) if due is not None]
        times += [
            max(0.0, bag.over.monotonic + self._late_s - time.monotonic())
            for bag in self._bags.values()
            if bag.over
        ]
        return min(times) if times else None

    def tick(self) -> None:
        """Flush and close what is due."""
        self._close_over(self._late_s)
        for bag in list(self._bags.values()):
            if bag.due_s() == 0.0:
                self._guard(bag, bag.flush)

    def close(self) -> None:
        """Close the bags of trials that have not ended, as well as the disk lets it."""
        for bag in list(self._bags.values()):
            now = Moment(None, time.time(), time.monotonic())
            self._close(bag, now)


def kept_key(item: MessageItem) -> Optional[KeptKey]:
    """Under what a message is remembered for later bags. None means it is not."""
    if item.message_type.name == 'smach_msgs/SmachContainerStructure':
        return item.topic, item.callerid, container_path(item.data)
    return (item.topic, item.callerid) if item.latching else None


def container_path(structure: bytes) -> bytes:
    """Return the path of a serialised SmachContainerStructure: the string behind its Header."""
    frame_id_end = 16 + int.from_bytes(structure[12:16], 'little')
    size = int.from_bytes(structure[frame_id_end : frame_id_end + 4], 'little')
    return structure[frame_id_end + 4 : frame_id_end + 4 + size]


def status_message(status: RecordingStatus) -> RecorderStatus:
    """Translate to a RecorderStatus message, without a stamp."""
    return RecorderStatus(
        state=int(status.state),
        **{name: getattr(status, name) for name in RecordingStatus._fields[1:]},
    )
