"""Follows how one trial went on from failures, and what came of it. Pure."""

from typing import Dict, List, Mapping, NamedTuple, Optional, Set, Tuple

from smach_oracle.oracle.decision.ways import WayKind, way_in_words
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import JUMPED_TO

from ..replaying.followed import (
    Decisions,
    GoneWay,
    Key,
    Visits,
    entered_way,
    is_act_of_person,
    key_of,
    left_by,
)
from .state_counts import StatesOfTrials

EXPERT = 'expert: '  # begins the words of what the expert chose
_DID_WORK = EXPERT + 'did its work'
_INTERFACE = EXPERT + 'interface '


class FollowedWay(NamedTuple):
    """A way that was gone from a failed state, and what came of it.

    Times are s since the trial began, without those in which its program did not run.
    """

    key: Key  # of the failed state
    words: str
    since_s: float
    until_s: float  # at which it was clear what came of it
    helped: Optional[bool]  # None: not known
    by_expert: bool
    failure: Optional[int]  # number of the state's last FAILURE, None where none was recorded
    decision: Optional[int]  # number of the DECISION that led to it, None where none


class _Going(NamedTuple):
    """A way that was gone, and whose result is not known yet."""

    way: FollowedWay
    watched: Key  # the state whose next result counts


class Recoveries:
    """Follows the ways on from the failures of one trial."""

    def __init__(self, found: StatesOfTrials) -> None:
        self._found = found
        self.ways: List[FollowedWay] = []  # whose results are clear, in the order in which they are
        self._visits = Visits()
        self._decisions = Decisions()
        self._going: List[_Going] = []
        self._failures: Dict[Key, int] = {}  # number of the last FAILURE that counts
        self._unhandled: Set[Key] = set()  # states that have failed, and nothing was tried yet
        # number of the last DECISION about a state or a container since its last failure
        self._decided: Dict[Key, int] = {}
        self._prepared: Set[Key] = set()  # preconditions were run after the decision
        # that the expert chose, by state: the name, and when
        self._interfaces: Dict[Key, Tuple[str, float]] = {}
        # states whose work the expert did: a JUMP that follows at once is where its outcome leads
        self._superseded: Set[Key] = set()

    def take(self, event: Event, now_s: float) -> None:
        """Follow an event."""
        key = key_of(event)
        is_outcome = key in self._superseded
        self._superseded.discard(key)
        ends, succeeded = self._visits.take(event)
        if ends:
            self._settle(now_s, succeeded, [each for each in self._going if each.watched == key])
        if event.kind == EventKind.FAILURE:
            self._unhandled_again(key)
            self._decided.pop(key, None)
        elif event.kind == EventKind.DECISION:
            self._decided[key] = event.seq
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
        gone = self._decisions.take(event)
        if event.kind == EventKind.JUMP and not is_outcome:
            self._jump(event, gone, now_s)

    def end(self, now_s: float, succeeded: Optional[bool]) -> None:
        """End with the trial. `succeeded`: None where its end says neither."""
        for key in list(self._unhandled):
            self._unhandled_again(key)
        for going in list(self._going):
            is_known = going.way.by_expert or succeeded is False
            self._settle(now_s, succeeded if is_known else None, [going])

    def _unhandled_again(self, key: Key) -> None:
        """Note that a state has failed, or that the trial ends, as nothing has come of it yet."""
        if key in self._unhandled:
            self._found.of('/'.join(key)).not_recovered += 1
            self._unhandled.discard(key)

    def failed(self, failure: Event) -> None:
        """Note a failure that counts."""
        self._failures[key_of(failure)] = failure.seq
        self._unhandled.add(key_of(failure))

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

    def _jump(self, event: Event, gone: Optional[GoneWay], now_s: float) -> None:
        data = event.data if isinstance(event.data, Mapping) else {}
        by_expert = is_act_of_person(event)
        if gone is not None:
            key, way = gone.key, gone.way
            decision = None if gone.decision is None else gone.decision.seq
        else:
            key, decision = (left_by(event), None) if by_expert else self._decider_of(event)
            way = entered_way(event, key, str(data.get(JUMPED_TO, '')))
            if key in self._prepared and way == WayKind.AGAIN.value:
                way = WayKind.PREPARE.value
        if by_expert:
            self._settle(now_s, None, list(self._going))
        words = way_in_words(way)
        name, since_s = self._interfaces.pop(key, ('', None))
        if by_expert:
            words = _INTERFACE + name if name else EXPERT + words.replace('going back', 'going')
        self._go(key, words, now_s, key, by_expert, since_s, decision)

    def _decider_of(self, jump: Event) -> Tuple[Key, Optional[int]]:
        """Return the state whose decision a JUMP carries out, and the number of that DECISION.

        Where the oracle of the failed state would ask, one above may decide about its own state.
        """
        places = left_by(jump), key_of(jump)
        decided = {key: self._decided.pop(key) for key in places if key in self._decided}
        key = max(decided, key=decided.__getitem__, default=places[0])
        return key, decided.get(key)

    def _go(
        self,
        key: Key,
        words: str,
        now_s: float,
        watched: Key,
        by_expert: bool,
        since_s: Optional[float] = None,
        decision: Optional[int] = None,
    ) -> None:
        self._unhandled.discard(key)
        self._settle(now_s, None, [each for each in self._going if each.watched == watched])
        began_s = now_s if since_s is None else since_s
        way = FollowedWay(
            key, words, began_s, began_s, None, by_expert, self._failures.get(key), decision
        )
        self._going.append(_Going(way, watched))

    def _settle(self, now_s: float, helped: Optional[bool], chosen: List[_Going]) -> None:
        for going in chosen:
            self._going.remove(going)
            way = going.way._replace(until_s=now_s, helped=helped)
            self.ways.append(way)
            count = self._found.of('/'.join(way.key)).way(way.words)
            for each in [count] + [self._found.choices] * way.by_expert:
                each.note(helped, way.until_s - way.since_s)
