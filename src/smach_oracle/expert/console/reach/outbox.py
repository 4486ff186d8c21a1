"""The messages to one receiver, sent by a thread of its own: one that hangs delays nobody else."""

import threading
import time
from collections import OrderedDict
from typing import Callable, Final, List, NamedTuple, Sequence

import rospy

from ..shapes.basics import CallStatus
from .calls_text import CalledQuestion
from .delivery import NotDelivered, deliver
from .on_call import OnCallList, Receiver

MOST_IN_ONE = 20  # questions of one message. The others wait for the next one
MOST_WAITING = 500
GATHER_S = 30.0  # between two messages: a fleet that fails at once sends one, and not a hundred
RETRY_AFTER_S = (5.0, 20.0, 60.0)
# dropped: somebody had come to the question before the message was sent
WAITING: Final = 'waiting'
SENT: Final = 'sent'
FAILED: Final = 'failed'
DROPPED: Final = 'dropped'


class CallResult(NamedTuple):
    """What has become of a message to a receiver about one question."""

    key: str
    receiver: Receiver
    status: CallStatus
    why: str  # it has not been delivered yet, or at all
    at: float  # s since the epoch


class Outbox:
    """Gathers, sends, and tries again a few times. Any thread may add to it."""

    def __init__(
        self,
        receiver: Receiver,
        on_call: OnCallList,
        waits: Callable[[str], bool],
        note: Callable[[CallResult], None],
        send: Callable[[Receiver, Sequence[CalledQuestion], OnCallList], None] = deliver,
        gather_s: float = GATHER_S,
        retry_after_s: Sequence[float] = RETRY_AFTER_S,
    ) -> None:
        """
        :param waits: whether a question still waits for somebody, by its key.
        :param note: takes each result.
        :param send: raises NotDelivered.
        """
        self._receiver = receiver
        self._on_call = on_call
        self._waits = waits
        self._note = note
        self._send = send
        self._gather_s = gather_s
        self._retry_after_s = retry_after_s
        self._changed = threading.Condition()
        self._pending: 'OrderedDict[str, CalledQuestion]' = OrderedDict()
        self._stopped = False
        threading.Thread(target=self._run, name='calls ' + receiver.words, daemon=True).start()

    def add(self, question: CalledQuestion) -> None:
        """Have the receiver called about a question."""
        with self._changed:
            if len(self._pending) >= MOST_WAITING:
                self._tell([question], FAILED, 'too many wait to be sent')
                return
            self._pending[question.key] = question
            self._tell([question], WAITING, '')
            self._changed.notify()

    def stop(self) -> None:
        """Send nothing any more. A message that is on its way is not called back."""
        with self._changed:
            self._stopped = True
            self._changed.notify()

    def _run(self) -> None:
        while True:
            questions = self._take()
            if not questions:
                return
            self._try(questions)
            if self._rests(self._gather_s):
                return

    def _take(self) -> List[CalledQuestion]:
        """Wait for some to send. Return none once it is stopped."""
        with self._changed:
            self._changed.wait_for(lambda: self._pending or self._stopped)
            if self._stopped:
                return []
            count = min(MOST_IN_ONE, len(self._pending))
            return [self._pending.popitem(last=False)[1] for _ in range(count)]

    def _rests(self, pause_s: float) -> bool:
        """Wait. Return whether it was stopped meanwhile."""
        with self._changed:
            return self._changed.wait_for(lambda: self._stopped, pause_s)

    def _try(self, questions: List[CalledQuestion]) -> None:
        for pause_s in (*self._retry_after_s, None):
            still = [each for each in questions if self._waits(each.key)]
            self._tell([each for each in questions if each not in still], DROPPED, '')
            questions = still
            if not questions:
                return
            try:
                self._send(self._receiver, questions, self._on_call)
            except NotDelivered as err:
                if err.final or pause_s is None:
                    rospy.logwarn('%s was not reached: %s', self._receiver.words, err)
                    self._tell(questions, FAILED, str(err))
                    return
                self._tell(questions, WAITING, str(err))
                if self._rests(pause_s):
                    return
            else:
                rospy.loginfo('%s was called about %s', self._receiver.words, questions[0].sentence)
                self._tell(questions, SENT, '')
                return

    def _tell(self, questions: Sequence[CalledQuestion], status: CallStatus, why: str) -> None:
        for question in questions:
            self._note(CallResult(question.key, self._receiver, status, why, time.time()))
