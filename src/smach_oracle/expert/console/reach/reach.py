"""Calls people about open questions, and shows the pages whom it has called."""

import threading
import time
from collections import OrderedDict, deque
from datetime import datetime
from typing import Callable, Deque, Dict, List, Mapping, Optional, Sequence, Set

from ...followed_server import ListedQuestion
from ..sensors.images import BrowserFile
from ..shapes.basics import ByKey
from ..shapes.people import CallView, FailedCallView, NextCallView, ReachView
from ..web.sections import PageSections
from .calls_text import called_question
from .escalation import DueCall, Escalation
from .on_call import OnCallList, Receiver
from .outbox import DROPPED, FAILED, CallResult, Outbox

SECTION = 'reach'
MOST_FAILED = 20  # that the pages show
PICTURE_WAIT_S = 3.0  # for the picture of a question
_JITTER_S = 2.0


class Reach:
    """The calls of this console. One thread calls `look`."""

    def __init__(
        self,
        on_call: OnCallList,
        origin: str,
        sections: PageSections,
        questions: Callable[[], Sequence[ListedQuestion]],
        waits: Callable[[ListedQuestion], bool],
        picture: Callable[[str], Optional[BrowserFile]],
        outbox: Callable[..., Outbox] = Outbox,
    ) -> None:
        """
        :param origin: of the console as people open it, for links.
        :param questions: all that are open.
        :param waits: whether a question waits for somebody.
        :param picture: of a question, by its key.
        """
        self._on_call = on_call
        self._origin = origin
        self._sections = sections
        self._questions = questions
        self._waits = waits
        self._picture = picture
        self._lock = threading.Lock()
        self._escalation = Escalation(on_call)
        self._waiting: Set[str] = set()
        self._results: Dict[str, 'OrderedDict[Receiver, CallResult]'] = {}  # of open questions
        self._dropped: List[DueCall] = []
        self._unreached: List[DueCall] = []
        self._failed: Deque[FailedCallView] = deque(maxlen=MOST_FAILED)
        self._next: ByKey[NextCallView] = {}
        self._seen_s: Dict[str, float] = {}
        self._outboxes = {
            receiver: outbox(receiver, on_call, lambda key: key in self._waiting, self._note)
            for person in on_call.people.values()
            for receiver in person.receivers
        }

    def look(self) -> None:
        """Call whoever is due, and bring the section up to date."""
        now_s, moment = time.monotonic(), datetime.now()
        listed = {each.key: each for each in self._questions()}
        waits = {key: self._waits(each) for key, each in listed.items()}
        self._waiting = {key for key, waiting in waits.items() if waiting}
        self._forget(listed)
        with self._lock:
            dropped, self._dropped = self._dropped, []
            unreached, self._unreached = self._unreached, []
        for due in dropped:
            self._escalation.take_back(due)
        for due in unreached:
            self._escalation.not_reached(due)
        ready = {key: waiting for key, waiting in waits.items() if self._is_ready(key, now_s)}
        for due in self._escalation.due(now_s, moment, ready):
            picture = self._picture(due.key) if self._on_call.pictures else None
            question = called_question(listed[due.key], self._origin, picture)
            for receiver in self._on_call.people[due.person].receivers:
                self._outboxes[receiver].add(question)
        self._write_section(waits, moment)

    def stop(self) -> None:
        """Call nobody any more."""
        for outbox in self._outboxes.values():
            outbox.stop()

    def _is_ready(self, key: str, now_s: float) -> bool:
        """Whether its picture is there, or does not come."""
        since_s = self._seen_s.setdefault(key, now_s)
        return (
            not self._on_call.pictures
            or now_s - since_s >= PICTURE_WAIT_S
            or self._picture(key) is not None
        )

    def _forget(self, listed: Mapping[str, ListedQuestion]) -> None:
        with self._lock:
            self._results = {key: each for key, each in self._results.items() if key in listed}
        self._seen_s = {key: each for key, each in self._seen_s.items() if key in listed}

    def _note(self, result: CallResult) -> None:
        """Take a result, in the thread of its outbox."""
        with self._lock:
            if result.status == DROPPED:
                self._dropped.append(DueCall(result.key, result.receiver.person))
            results = self._results.setdefault(result.key, OrderedDict())
            results[result.receiver] = result
            if result.status == FAILED:
                ways = self._on_call.people[result.receiver.person].receivers
                if all(way in results and results[way].status == FAILED for way in ways):
                    self._unreached.append(DueCall(result.key, result.receiver.person))
                self._failed.append(
                    {
                        'to': result.receiver.words,
                        'question': result.key,
                        'why': result.why,
                        'at': round(result.at, 1),
                    }
                )

    def _write_section(self, waits: Mapping[str, bool], moment: datetime) -> None:
        with self._lock:
            calls = {key: _views(self._results[key]) for key in waits if key in self._results}
            failed = list(self._failed)
        following = {key: self._following(key, moment) for key, waiting in waits.items() if waiting}
        self._next = {key: each for key, each in following.items() if each is not None}
        view: ReachView = {'calls': calls, 'next': self._next, 'failed': failed}
        self._sections.put(SECTION, view)

    def _following(self, key: str, moment: datetime) -> Optional[NextCallView]:
        found = self._escalation.next_call(key, moment)
        if found is None:
            return None
        at = round(time.time() + found.in_s, 1)
        before = self._next.get(key)
        if before is not None and abs(before['at'] - at) < _JITTER_S:
            at = before['at']
        return {'people': found.people, 'at': at}


def _views(results: 'OrderedDict[Receiver, CallResult]') -> List[CallView]:
    return [
        {'to': each.receiver.words, 'status': each.status, 'why': each.why, 'at': round(each.at, 1)}
        for each in results.values()
    ]
