"""The topic `~oracle/trials`: the latest trial of each machine of a node, for whoever comes late.

Events are heard by those who listen when they happen. A front end that starts during a trial, or
starts again, gets from here what it has missed: that the trial runs, since when, and its counts.
"""

import queue
import threading
import time
from collections import OrderedDict
from typing import Callable, List

import rospy

from smach_common.foreign import error_text
from smach_oracle.msg import NodeTrials, TrialCounts
from smach_oracle.oracle.records.events import Event, EventKind, EventSource, OwnObserver
from smach_oracle.trial_counter import TrialCounter

from ..connections import quiet_at_shutdown
from ..event_messages import json_of
from ..log.said_once import SaidOnce
from ..sendable_text import sendable_text

TOPIC = '~oracle/trials'
PERIOD_S = 0.2  # at most 5 Hz
MOST_MACHINES = 100  # of a node: a script may give each trial a machine of another name
_CHANGES = frozenset(
    [
        EventKind.TRIAL_START,
        EventKind.TRIAL_END,
        EventKind.RESUMED,
        EventKind.FAILURE,
        EventKind.JUMP,
        EventKind.QUERY_OPENED,
        EventKind.QUERY_ANSWERED,
        EventKind.HEALTH_WAIT_END,
    ]
)


class LatestTrial(OwnObserver):
    """The latest trial of one machine, counted as its events come."""

    observer_name = 'the publisher of ~oracle/trials'
    without_it = 'consoles that start later show older counts of the trial'

    def __init__(self, path: str, changed: Callable[[str], None]) -> None:
        """:param path: of the machine. `changed` gets it where others should see the trial now."""
        self._path = path
        self._changed = changed
        # re-entrant, as a signal handler may end a trial in the thread that counts
        self._lock = threading.RLock()
        self._counter = TrialCounter()
        self._begun = 0  # trials
        self._over = False

    @property
    def has_begun(self) -> bool:
        """Whether it has had a trial."""
        return self._begun > 0

    def __call__(self, event: Event) -> None:
        """Count one event."""
        with self._lock:
            if event.trial_id != self._counter.trial_id:
                self._counter = TrialCounter()
                self._begun += 1
            self._counter.add(event)
            self._over = event.kind == EventKind.TRIAL_END
        if event.kind in _CHANGES:
            self._changed(self._path)

    def message(self) -> TrialCounts:
        """Return the trial as it stands now."""
        with self._lock:
            counts = self._counter
            return TrialCounts(
                trial_id=sendable_text(counts.trial_id),
                machine=sendable_text(self._path),
                nth=self._begun,
                start=counts.start_time,
                duration_s=counts.duration_s,
                seq=max(counts.last_seq, 0),
                lost=counts.lost_events,
                recovers=counts.recovers is not False,
                failures=counts.failures,
                recoveries=counts.recoveries,
                questions=counts.questions,
                answered=counts.answered,
                unwell_s=counts.unwell_s,
                running=not self._over,
                ending=counts.ending.value if self._over else '',
                failure_rule=json_of(counts.rule.as_data()),
                outcome=sendable_text(counts.outcome),
            )


class TrialsPublisher:
    """Publishes in a thread of its own, so that no machine waits for it."""

    def __init__(self, topic: str = TOPIC, period_s: float = PERIOD_S) -> None:
        self._publisher = rospy.Publisher(topic, NodeTrials, queue_size=1, latch=True)
        self._error_once = SaidOnce(lambda text: rospy.logerr('%s', text))
        self._period_s = period_s
        # a signal handler may put something in, too: it takes no lock of Python's
        self._changed: 'queue.SimpleQueue[str]' = queue.SimpleQueue()
        self._lock = threading.Lock()
        # by path, the machine that changed last at the end
        self._latest: 'OrderedDict[str, LatestTrial]' = OrderedDict()
        threading.Thread(target=self._run, name='oracle trials', daemon=True).start()

    def watch(self, path: str, events: EventSource) -> None:
        """Count the trials of a top-level machine from now on, after those of an earlier one.

        :param path: of the machine, which may have had another one. A script may build a new
            machine of that path for each trial.
        """
        with self._lock:
            latest = self._latest.setdefault(path, LatestTrial(path, self._changed.put))
            while len(self._latest) > MOST_MACHINES:
                self._latest.popitem(last=False)
        others = [each for each in events.observers if not isinstance(each, LatestTrial)]
        events.observers[:] = [*others, latest]

    def _run(self) -> None:
        while not rospy.is_shutdown():
            changed = [self._changed.get()]
            time.sleep(self._period_s)
            while not self._changed.empty():
                changed.append(self._changed.get())
            try:
                message = self._message(changed)
            except Exception as err:  # this thread serves every machine of the process
                self._error_once(
                    '~oracle/trials are not published: {}. This is said once'.format(
                        error_text(err)
                    )
                )
            else:
                with quiet_at_shutdown():
                    self._publisher.publish(message)

    def _message(self, changed: List[str]) -> NodeTrials:
        with self._lock:
            for path in changed:
                if path in self._latest:
                    self._latest.move_to_end(path)
            trials = list(self._latest.values())
        message = NodeTrials(trials=[each.message() for each in trials if each.has_begun])
        message.header.stamp = rospy.get_rostime()
        return message
