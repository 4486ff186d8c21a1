"""Publishes the status of a question's preconditions, for as long as somebody listens."""

import contextlib
import threading
import time
from typing import Callable, Iterator, List, Optional

import rospy

from smach_oracle.msg import PreconditionCheck, PreconditionChecks
from smach_oracle.oracle.asking.question import PreconditionProbe, PreconditionStatus, Question

from ..sendable_text import sendable_text

TOPIC = '~oracle/preconditions'
PERIOD_S = 2.0
PATIENCE_S = 1.0  # for one function
LISTENER_PERIOD_S = 0.25  # how soon somebody who begins to listen is noticed
MOST_PRECONDITIONS = 500  # of one question. Further ones are not checked
MOST_HANGING = 32  # checks that have not come back, of all questions: each keeps a thread
_RESULT = {
    None: PreconditionCheck.UNKNOWN,
    True: PreconditionCheck.HOLDS,
    False: PreconditionCheck.DOES_NOT_HOLD,
}


class _WatchedPrecondition:
    """One precondition: its latest status, and the thread that checks it."""

    def __init__(
        self, probe: PreconditionProbe, number: int, free_threads: threading.Semaphore
    ) -> None:
        self.state, self.name = probe.names[number]
        self._free_threads = free_threads
        self._probe = probe
        self._number = number
        self._latest = PreconditionStatus(None, 'not checked yet')
        self._at_s: Optional[float] = None
        self._thread: Optional[threading.Thread] = None
        self._began_s = 0.0

    def refresh(self) -> None:
        """Check it, waiting a second at most. A check that takes longer goes on."""
        if self._thread is None or not self._thread.is_alive():
            if not self._free_threads.acquire(blocking=False):
                self._latest = PreconditionStatus(
                    None, 'not checked: {} checks have not come back'.format(MOST_HANGING)
                )
                return
            self._began_s = time.monotonic()
            self._thread = threading.Thread(
                target=self._check, name='check ' + self.name, daemon=True
            )
            self._thread.start()
        self._thread.join(max(0.0, self._began_s + PATIENCE_S - time.monotonic()))

    def message(self) -> PreconditionCheck:
        """Return the latest status. A check that has not come back is named as hanging."""
        now_s = time.monotonic()
        status, at_s = self._latest, self._at_s
        if self._thread is not None and self._thread.is_alive():
            status = PreconditionStatus(
                None, '{} has not come back for {:.0f} s'.format(self.name, now_s - self._began_s)
            )
        return PreconditionCheck(
            self.state,
            self.name,
            _RESULT[status.holds],
            sendable_text(status.text),
            -1.0 if at_s is None else now_s - at_s,
        )

    def _check(self) -> None:
        try:
            self._latest = self._probe.status(self._number)
        except BaseException as err:  # a function may call sys.exit
            self._latest = PreconditionStatus(None, '{} raised {!r}'.format(self.name, err))
        finally:
            self._free_threads.release()
        self._at_s = time.monotonic()


class _QuestionWatch:
    """One open question."""

    def __init__(
        self,
        question: Question,
        probe: PreconditionProbe,
        publish: Callable[[PreconditionChecks], None],
        listened: Callable[[], bool],
        free_threads: threading.Semaphore,
    ) -> None:
        self.ended = threading.Event()
        self._query_id = question.question_id
        self._watched = [
            _WatchedPrecondition(probe, number, free_threads)
            for number in range(min(MOST_PRECONDITIONS, len(probe.names)))
        ]
        self._publish = publish
        self._listened = listened
        threading.Thread(target=self._run, name='preconditions', daemon=True).start()

    def _run(self) -> None:
        pause_s = 0.0
        while not self.ended.wait(pause_s) and not rospy.is_shutdown():
            pause_s = LISTENER_PERIOD_S
            if self._listened():
                self._check_all()
                pause_s = PERIOD_S

    def _check_all(self) -> None:
        for watched in self._watched:
            if self.ended.is_set():
                return
            watched.refresh()
        message = PreconditionChecks(query_id=self._query_id, checks=self._checks())
        message.header.stamp = rospy.get_rostime()
        if not self.ended.is_set() and not rospy.is_shutdown():
            self._publish(message)

    def _checks(self) -> List[PreconditionCheck]:
        return [watched.message() for watched in self._watched]


class PreconditionWatch:
    """Watches the preconditions of a node. Several questions may be open at once."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher(TOPIC, PreconditionChecks, latch=True, queue_size=5)
        self._free_threads = threading.Semaphore(MOST_HANGING)

    @contextlib.contextmanager
    def while_open(self, question: Question) -> Iterator[None]:
        """Watch for as long as a question is open.

        Neither its beginning nor its end waits for anything.
        """
        probe = question.preconditions
        watch = None
        if probe is not None and probe.names:
            watch = _QuestionWatch(
                question,
                probe,
                self._publisher.publish,
                lambda: self._publisher.get_num_connections() > 0,
                self._free_threads,
            )
        try:
            yield
        finally:
            if watch is not None:
                watch.ended.set()
