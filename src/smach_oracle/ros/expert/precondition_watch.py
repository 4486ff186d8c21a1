"""While a question is open: how the preconditions of its choices stand, looked at again and again, for who listens."""
import contextlib
import threading
import time
from typing import Callable, Iterator, List, Optional

import rospy

from smach_oracle.msg import PreconditionCheck, PreconditionChecks

from ..oracle.question import Look, Question, Standing

TOPIC = '~oracle/preconditions'
PERIOD_S = 2.0
PATIENCE_S = 1.0  # for one function
LISTENER_PERIOD_S = 0.25  # how soon somebody who begins to listen is noticed
MOST = 500  # of one question; further ones are not looked at
MOST_HANGING = 32  # looks that have not come back, of all questions: each keeps a thread
_RESULT = {None: PreconditionCheck.UNKNOWN, True: PreconditionCheck.HOLDS, False: PreconditionCheck.DOES_NOT_HOLD}


class _Watched:
    """One precondition: the latest word on it, and the thread that looks."""

    def __init__(self, look: Look, number: int, room: threading.Semaphore) -> None:
        self.state, self.name = look.names[number]
        self._room = room
        self._look = look
        self._number = number
        self._latest = Standing(None, 'not looked at yet')
        self._at_s: Optional[float] = None
        self._thread: Optional[threading.Thread] = None
        self._began_s = 0.0

    def refresh(self) -> None:
        """Look, waiting a second at most; one who still looks is left to it."""
        if self._thread is None or not self._thread.is_alive():
            if not self._room.acquire(blocking=False):
                self._latest = Standing(None, 'not looked at: {} looks have not come back'.format(MOST_HANGING))
                return
            self._began_s = time.monotonic()
            self._thread = threading.Thread(target=self._work, name='look at ' + self.name, daemon=True)
            self._thread.start()
        self._thread.join(max(0.0, self._began_s + PATIENCE_S - time.monotonic()))

    def message(self) -> PreconditionCheck:
        """The latest word; where somebody still looks, that it hangs."""
        now_s = time.monotonic()
        standing, at_s = self._latest, self._at_s
        if self._thread is not None and self._thread.is_alive():
            standing = Standing(None, '{} has not come back for {:.0f} s'.format(self.name, now_s - self._began_s))
        text = standing.text.encode('utf-8', 'backslashreplace').decode('utf-8')
        return PreconditionCheck(self.state, self.name, _RESULT[standing.holds], text,
                                 -1.0 if at_s is None else now_s - at_s)

    def _work(self) -> None:
        try:
            self._latest = self._look.look(self._number)
        except BaseException as err:  # a function may call sys.exit
            self._latest = Standing(None, '{} raised {!r}'.format(self.name, err))
        finally:
            self._room.release()
        self._at_s = time.monotonic()


class _Session:
    """One open question."""

    def __init__(self, question: Question, look: Look, publish: Callable[[PreconditionChecks], None],
                 listened: Callable[[], bool], room: threading.Semaphore) -> None:
        self.over = threading.Event()
        self._query_id = question.query_id
        self._watched = [_Watched(look, number, room) for number in range(min(MOST, len(look.names)))]
        self._publish = publish
        self._listened = listened
        threading.Thread(target=self._run, name='preconditions', daemon=True).start()

    def _run(self) -> None:
        pause_s = 0.0
        while not self.over.wait(pause_s) and not rospy.is_shutdown():
            pause_s = LISTENER_PERIOD_S
            if self._listened():
                self._round()
                pause_s = PERIOD_S

    def _round(self) -> None:
        for watched in self._watched:
            if self.over.is_set():
                return
            watched.refresh()
        message = PreconditionChecks(query_id=self._query_id, checks=self._checks())
        message.header.stamp = rospy.get_rostime()
        if not self.over.is_set() and not rospy.is_shutdown():
            self._publish(message)

    def _checks(self) -> List[PreconditionCheck]:
        return [watched.message() for watched in self._watched]


class PreconditionWatch:
    """Of a node; several questions may be open at once."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher(TOPIC, PreconditionChecks, latch=True, queue_size=5)
        self._room = threading.Semaphore(MOST_HANGING)

    @contextlib.contextmanager
    def over(self, question: Question) -> Iterator[None]:
        """For as long as a question is open; neither its beginning nor its end waits for anything."""
        look = question.preconditions
        session = None
        if look is not None and look.names:
            session = _Session(question, look, self._publisher.publish,
                               lambda: self._publisher.get_num_connections() > 0, self._room)
        try:
            yield
        finally:
            if session is not None:
                session.over.set()
