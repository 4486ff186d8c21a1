"""Follows the questions of one trial: how they were answered, and how long that took. Pure."""

from typing import Dict, Optional, Set

from smach_oracle.oracle.records.events import Event, EventKind

from ..replaying.followed import Key, key_of
from .state_counts import NO_ANSWERS, StatesOfTrials

_EXPIRED, _CANCELLED, _OPEN = NO_ANSWERS
_CLOSED = {EventKind.QUERY_EXPIRED: _EXPIRED, EventKind.QUERY_CANCELLED: _CANCELLED}
INTERFACE = 'interface'


class Questions:
    """Follows the questions of one trial."""

    def __init__(self, found: StatesOfTrials) -> None:
        self._found = found
        self._opened_s: Dict[str, float] = {}  # by query id
        self._claimed: Set[str] = set()
        self._closed: Set[str] = set()
        self._states: Dict[str, str] = {}  # of each question
        self._busy_s: Dict[str, float] = {}  # since when the expert works on it
        self._answered: Dict[Key, str] = {}  # by state: a question after which nothing went on yet

    def take(self, event: Event, now_s: float, left: Optional[Key]) -> None:
        """Follow an event. `left`: the failed state from which the machine goes on, or None."""
        query = event.query_id
        if event.kind == EventKind.QUERY_OPENED:
            self._answered.pop(key_of(event), None)
            self._opened_s.setdefault(query, now_s)
            self._states[query] = '/'.join(key_of(event))
        elif event.kind == EventKind.QUERY_CLAIMED:
            if query in self._opened_s and query not in self._claimed:
                self._claimed.add(query)
                self._found.times.to_claim.append(now_s - self._opened_s[query])
            self._end_work(query, now_s)  # of somebody from whom it was taken over
            self._busy_s[query] = now_s
        elif event.kind == EventKind.QUERY_RELEASED:
            self._end_work(query, now_s)
        elif event.kind == EventKind.QUERY_ANSWERED:
            self._answer(event, now_s)
        elif event.kind in _CLOSED:
            self._end_work(query, now_s)
            self._close(query, _CLOSED[event.kind])
        elif event.kind == EventKind.INTERFACE_END:
            self._end_work(query, now_s)
        elif left is not None and left in self._answered:
            opened_s = self._opened_s[self._answered.pop(left)]
            self._found.times.to_resume.append(now_s - opened_s)

    def end(self, now_s: float) -> None:
        """End with the record: what is still open stays so."""
        for query in list(self._busy_s):
            self._end_work(query, now_s)
        for query in self._opened_s:
            self._close(query, _OPEN)

    def _answer(self, event: Event, now_s: float) -> None:
        query = event.query_id
        if query not in self._opened_s or query in self._closed:
            return  # its opening is in no bag, or it was answered before
        opened_s = self._opened_s[query]
        self._found.times.to_answer.append(now_s - opened_s)
        self._busy_s.setdefault(query, now_s if query in self._claimed else opened_s)
        if event.outcome != INTERFACE:
            self._end_work(query, now_s)
        self._close(query, event.outcome)
        self._answered[key_of(event)] = query

    def _close(self, query: str, answer: str) -> None:
        if query in self._states and query not in self._closed:
            self._closed.add(query)
            answers = self._found.of(self._states[query]).answers
            answers[answer] = answers.get(answer, 0) + 1

    def _end_work(self, query: str, now_s: float) -> None:
        since_s = self._busy_s.pop(query, None)
        if since_s is not None:
            self._found.expert_s += now_s - since_s
