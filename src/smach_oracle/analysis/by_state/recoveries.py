"""Follows how one trial went on from failures, and what came of it. Pure."""

from dataclasses import dataclass
from typing import Dict, List, Mapping, Optional, Set, Tuple

from smach_oracle.oracle.decision.ways import WayKind, way_in_words
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import JUMPED_TO

from ..replaying.followed import (
    Decisions,
    Key,
    Visits,
    entered_way,
    is_act_of_person,
    key_of,
    left_by,
)
from .state_counts import StatesOfTrials, WayCount

EXPERT = 'expert: '  # begins the words of what the expert chose
_DID_WORK = EXPERT + 'did its work'
_INTERFACE = EXPERT + 'interface '


@dataclass
class _Going:
    """A way that was gone, and whose result is not known yet."""

    count: WayCount
    since_s: float
    watched: Key  # the state whose next result counts
    by_expert: bool


class Recoveries:
    """Follows the ways on from the failures of one trial."""

    def __init__(self, found: StatesOfTrials) -> None:
        self._found = found
        self._visits = Visits()
        self._decisions = Decisions()
        self._going: List[_Going] = []
        self._unhandled: Set[Key] = set()  # states that have failed, and nothing was tried yet
        self._prepared: Set[Key] = set()  # preconditions were run after the decision
        # that the expert chose, by state: the name, and when
        self._interfaces: Dict[Key, Tuple[str, float]] = {}
        self._superseded: Set[Key] = set()

    def take(self, event: Event, now_s: float) -> None:
        """Follow an event."""
        key = key_of(event)
        ends, succeeded = self._visits.take(event)
        if ends:
            self._settle(now_s, succeeded, [each for each in self._going if each.watched == key])
        if event.kind == EventKind.FAILURE:
            self._unhandled_again(key)
        elif event.kind == EventKind.DECISION:
            self._prepared.discard(key)
        elif event.kind == EventKind.PRECONDITION_START:
            self._prepared.add(key)
        elif event.kind == EventKind.QUERY_OPENED:
            self._asked_again(key, now_s)
        elif event.kind == EventKind.QUERY_ANSWERED and event.outcome == 'interface':
            self._interfaces[key] = event.target, now_s
        elif event.kind in (EventKind.PREEMPT, EventKind.RESUMED):
            self._settle(now_s, None, list(self._going))
        elif event.kind == EventKind.SUPERSEDE:
            self._supersede(event, now_s)
        elif event.kind != EventKind.JUMP and is_act_of_person(event):
            self._settle(now_s, None, list(self._going))
        if event.kind == EventKind.JUMP:
            self._jump(event, now_s)
        else:
            self._decisions.take(event)

    def end(self, now_s: float, succeeded: Optional[bool]) -> None:
        """End with the trial. `succeeded`: None where its end says neither."""
        for key in list(self._unhandled):
            self._unhandled_again(key)
        for going in list(self._going):
            is_known = going.by_expert or succeeded is False
            self._settle(now_s, succeeded if is_known else None, [going])

    def _unhandled_again(self, key: Key) -> None:
        """Note that a state has failed, or that the trial ends, as nothing has come of it yet."""
        if key in self._unhandled:
            self._found.of('/'.join(key)).not_recovered += 1
            self._unhandled.discard(key)

    def failed(self, key: Key) -> None:
        """Note that a failure of a state counts."""
        self._unhandled.add(key)

    def _asked_again(self, key: Key, now_s: float) -> None:
        """Settle an interface after which the same question is put again."""
        if key in self._interfaces:
            name, since_s = self._interfaces.pop(key)
            self._go(key, _INTERFACE + name, now_s, key, by_expert=True, since_s=since_s)
            self._settle(now_s, False, self._going[-1:])

    def _supersede(self, event: Event, now_s: float) -> None:
        key = key_of(event)
        self._settle(now_s, None, list(self._going))
        self._superseded.add(key)
        name, since_s = self._interfaces.pop(key, ('', None))
        words = _INTERFACE + name if name else _DID_WORK
        watched = event.path, event.target
        self._go(key, words, now_s, watched, by_expert=True, since_s=since_s)

    def _jump(self, event: Event, now_s: float) -> None:
        gone = self._decisions.take(event)
        data = event.data if isinstance(event.data, Mapping) else {}
        key = left_by(event)
        if key in self._superseded:
            self._superseded.discard(key)
            return
        way = entered_way(event, key, str(data.get(JUMPED_TO, '')))
        if gone is not None:
            key, way = gone.key, gone.way
        elif key in self._prepared and way == WayKind.AGAIN.value:
            way = WayKind.PREPARE.value
        by_expert = is_act_of_person(event)
        if by_expert:
            self._settle(now_s, None, list(self._going))
        words = way_in_words(way)
        name, since_s = self._interfaces.pop(key, ('', None))
        if by_expert:
            words = _INTERFACE + name if name else EXPERT + words.replace('going back', 'going')
        self._go(key, words, now_s, key, by_expert, since_s)

    def _go(
        self,
        key: Key,
        words: str,
        now_s: float,
        watched: Key,
        by_expert: bool,
        since_s: Optional[float] = None,
    ) -> None:
        self._unhandled.discard(key)
        self._settle(now_s, None, [each for each in self._going if each.watched == watched])
        count = self._found.of('/'.join(key)).way(words)
        self._going.append(_Going(count, now_s if since_s is None else since_s, watched, by_expert))

    def _settle(self, now_s: float, helped: Optional[bool], chosen: List[_Going]) -> None:
        for going in chosen:
            self._going.remove(going)
            for count in [going.count] + [self._found.choices] * going.by_expert:
                count.helped += helped is True
                count.in_vain += helped is False
                count.not_known += helped is None
                count.seconds += now_s - going.since_s
