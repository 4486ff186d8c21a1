"""What recorded events say of visits, of ways that were gone, and of the time of work. Pure."""

from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Set, Tuple

from smach_oracle.oracle.decision.ways import key_of as key_of_way
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import JUMPED_FROM, JUMPED_TO, UNCOUNTED, is_counted
from smach_oracle.oracle.settings.failing_outcomes import is_preempted

from .menus import chosen_way

Key = Tuple[str, str]  # path and state

_CLOSES = frozenset((EventKind.QUERY_ANSWERED, EventKind.QUERY_EXPIRED, EventKind.QUERY_CANCELLED))
_BEGINS = frozenset((EventKind.HEALTH_WAIT_START, EventKind.HOLD_START))
_ENDS = frozenset((EventKind.HEALTH_WAIT_END, EventKind.HOLD_END))


def key_of(event: Event) -> Key:
    """Return the container and the state that an event is about."""
    return event.path, event.state


def is_act_of_person(event: Event) -> bool:
    """Whether a person acts: the next results are not those of the oracle's own ways."""
    if event.kind in (EventKind.JUMP, EventKind.GIVE_UP):
        return bool(event.by)
    return event.kind in (EventKind.SUPERSEDE, EventKind.SENT)


class WorkTime:
    """The time of a trial in which nobody is asked, nothing is held, and the program runs."""

    def __init__(self) -> None:
        self._shown_s = 0.0
        self._at_s: Optional[float] = None
        # states about which a person is asked: no event closes a question that is put again
        self._asked: Set[Key] = set()
        self._held = 0

    def take(self, event: Event) -> None:
        """Go on to the time of an event."""
        is_paused = self._asked or self._held
        if self._at_s is not None and not is_paused and event.kind != EventKind.RESUMED:
            self._shown_s += max(0.0, event.wall_time - self._at_s)
        self._at_s = event.wall_time
        if event.kind in (EventKind.TRIAL_START, EventKind.RESUMED):
            self._asked, self._held = set(), 0
        elif event.kind == EventKind.QUERY_OPENED:
            self._asked.add(key_of(event))
        elif event.kind in _CLOSES:
            self._asked.discard(key_of(event))
        self._held += (event.kind in _BEGINS) - (event.kind in _ENDS and self._held > 0)

    @property
    def minutes(self) -> float:
        """Return what has passed."""
        return self._shown_s / 60.0


class Preempts:
    """Knows which states have ended under a preempt of their container: that says nothing.

    A transition that the author drew after `preempted` obeys it.
    """

    def __init__(self) -> None:
        self._paths: Set[str] = set()

    def take(self, event: Event) -> None:
        """Follow one event."""
        if event.kind == EventKind.PREEMPT:
            self._paths.add(event.path)
        elif event.kind == EventKind.CONTAINER_START or (
            event.kind == EventKind.TRANSITION and is_preempted(event.outcome)
        ):
            self._paths.discard(event.path)

    def is_success(self, transition: Event) -> bool:
        """Whether a TRANSITION without a FAILURE before it counts as a success of its state."""
        return (
            is_counted(transition)
            and not is_preempted(transition.outcome)
            and transition.path not in self._paths
        )


class Visits:
    """Says of each end of a visit how it went."""

    def __init__(self) -> None:
        self._failed: Set[Key] = set()
        self._preempts = Preempts()

    def take(self, event: Event) -> Tuple[bool, Optional[bool]]:
        """Return whether a visit ends here, and whether in success. None: that says nothing."""
        key = key_of(event)
        self._preempts.take(event)
        if event.kind == EventKind.STATE_START:
            self._failed.discard(key)
        elif event.kind == EventKind.FAILURE:
            self._failed.add(key)
            return True, False
        elif event.kind == EventKind.TRANSITION and event.outcome and key not in self._failed:
            if event.text == UNCOUNTED['text']:
                return False, None
            return True, self._preempts.is_success(event) or None
        return False, None


class GoneWay(NamedTuple):
    """A way that was gone. `decision`: the event, None where a person has chosen it."""

    key: Key  # of the failed state
    way: str
    decision: Optional[Event] = None


class Decisions:
    """Finds the decision that a jump carries out. Branches may decide at the same time."""

    def __init__(self) -> None:
        self._open: Dict[Key, Event] = {}
        self._over: Set[Key] = set()  # states whose work a person did, or which gave up

    def take(self, event: Event) -> Optional[GoneWay]:
        """Follow an event. Return the way that is gone by a JUMP, None at all others."""
        if event.kind == EventKind.DECISION:
            self._open[key_of(event)] = event
        elif event.kind == EventKind.FAILURE:
            self._open.pop(key_of(event), None)
        elif event.kind == EventKind.STATE_START:
            self._over.discard(key_of(event))
        elif event.kind in (EventKind.SUPERSEDE, EventKind.GIVE_UP):
            self._over.add(key_of(event))
        elif event.kind == EventKind.JUMP and key_of(event) not in self._over:
            return self._gone(event)
        return None

    def _gone(self, jump: Event) -> Optional[GoneWay]:
        data: Mapping[str, Any] = jump.data if isinstance(jump.data, Mapping) else {}
        left, failed = str(data.get(JUMPED_FROM, '')), left_by(jump)
        if jump.by:
            self._open.pop(failed, None)
            return GoneWay(failed, entered_way(jump, failed, str(data.get(JUMPED_TO, ''))))
        if 'way' not in data:
            return None
        way = str(data['way'])
        fitting = [key for key, event in self._open.items() if chosen_way(event) == way]
        nearest = [key for key in fitting if key in (failed, key_of(jump))]
        around = [key for key in fitting if left.startswith('/'.join(key) + '/')]
        found: List[Key] = nearest or around or fitting
        if not found:
            return None
        return GoneWay(found[-1], way, self._open.pop(found[-1]))


def split_path(path: str) -> Key:
    """Return the container and the state of the path of a state."""
    container, _, state = path.rpartition('/')
    return container, state


def left_by(jump: Event) -> Key:
    """Return the state that a JUMP or a GIVE_UP leaves: the failed one, which may be below."""
    data: Mapping[str, Any] = jump.data if isinstance(jump.data, Mapping) else {}
    left = str(data.get(JUMPED_FROM, ''))
    return split_path(left) if left else key_of(jump)


def entered_way(jump: Event, failed: Key, entered: str) -> str:
    """Return the key of the way that enters where a JUMP leads, as a menu of the state names it.

    `failed`: the state from which it goes on. `entered`: the path of the entered state, if it is
    below the target.
    """
    container, label = split_path(entered) if entered else (jump.path, jump.target)
    if container != failed[0] or (entered and label != failed[1]):  # or a branch beside
        return key_of_way('/' + '/'.join((container, label)).partition('/')[2], '')
    return key_of_way(label, failed[1])
