"""A test message to all receivers of an on-call list."""

import time
from concurrent.futures import ThreadPoolExecutor
from typing import List, NamedTuple

from .calls_text import CalledQuestion
from .delivery import NotDelivered, deliver
from .on_call import OnCallList, Receiver

SENTENCE = 'This is a test of the on-call list: no robot asks anything.'


class TriedCall(NamedTuple):
    """What has become of the test message to a receiver."""

    receiver: Receiver
    why: str  # it was not delivered. Empty where it was

    @property
    def words(self) -> str:
        """Return that as a line. It shows no address and no secret."""
        return '{}: {}'.format(self.receiver.words, self.why or 'sent')


def try_calls(on_call: OnCallList, origin: str) -> List[TriedCall]:
    """Send a test message to all at once, whoever has quiet hours, each once.

    A receiver that hangs takes as long as any delivery may, and delays no other.

    :param origin: of the console as people open it, for the link.
    """
    receivers = list(
        dict.fromkeys(each for person in on_call.people.values() for each in person.receivers)
    )
    message = CalledQuestion(
        '', 'The operator console', '', 'nothing', SENTENCE, origin + '/', time.time()
    )

    def tried(receiver: Receiver) -> TriedCall:
        try:
            deliver(receiver, [message], on_call)
        except NotDelivered as err:
            return TriedCall(receiver, str(err))
        return TriedCall(receiver, '')

    with ThreadPoolExecutor(max(1, len(receivers))) as threads:
        return list(threads.map(tried, receivers))
