"""The facts of one container and its userdata that are to be stored, and those that are new."""

import contextlib
import json
import marshal
import weakref
from typing import (
    Callable,
    Dict,
    FrozenSet,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Tuple,
    Union,
    cast,
)

import smach
from smach_common.foreign import ends_program, text_of, type_name
from smach_oracle.store.codecs import CODECS, Encoded, NotStorable
from smach_oracle.store.names import (
    EXECUTION,
    HISTORY,
    KEPT_OUT,
    KEY,
    MARK,
    START,
    STATE,
    STREAKS,
    VISIT,
    WAYS,
)
from smach_oracle.store.rows import Fact

from ..machine.container_records import ContainerRecords
from ..records.history import History
from ..settings.failing_outcomes import name_text
from ..smach_private import remapping_of, states_of
from .stored_tree import StoredContainer

_NOTHING: Dict[str, object] = {}
_as_json = json.JSONEncoder(separators=(',', ':')).encode


def fact_of(path: str, name: str, plain: object) -> Fact:
    """Return a fact of plain data."""
    return Fact(path, name, Encoded(_as_json(plain), None, {}))


class ContainerFacts:
    """Tells what of a container's records differs from what is stored."""

    def __init__(
        self,
        path: str,
        records: ContainerRecords,
        on_retry: Callable[[str], str],
        before: StoredContainer,
    ) -> None:
        """`on_retry`: that of a state. `before`: what is stored."""
        self._path, self._records, self._on_retry = path, records, on_retry
        self._execution = before.execution  # number of the present one
        self._stored: Dict[str, str] = {}  # texts by name
        self._ways: Dict[str, Dict[str, object]] = {}  # by label
        self._marks: Dict[str, List[object]] = {}  # by label
        self._visits = before.visits_of_execution  # that are stored

    def begin_execution(self) -> Iterator[Fact]:
        """Yield what is new where the container begins to execute."""
        self._execution += 1
        self._visits = 0
        self._records.history.count_visits()
        yield fact_of(self._path, EXECUTION, self._execution)

    def changed(self, labels: List[str]) -> Iterator[Fact]:
        """Yield what is new of the history, and of these states."""
        history = self._records.history
        yield from self._new_visits(history)
        yield from self._if_new(HISTORY, history.told())
        yield from self.streaks()
        yield from self._states(labels)

    def states(self) -> Iterator[Fact]:
        """Yield what is new of every state, and nothing of the visits."""
        yield from self._states(list(self._records.by_label))

    def _states(self, labels: List[str]) -> Iterator[Fact]:
        for label in labels:
            record = self._records.by_label.get(label)
            if record is not None:
                counts = (record.visits, record.recoveries, record.fallbacks, record.unwell_repeats)
                told = {
                    'learned': record.rates(),
                    'counts': counts,
                    'longest_s': record.longest_s,
                    'shared': record.shared,
                }
                yield from self._if_new(STATE + label, told)
                ways, stored = record.way_results(), self._ways.get(label, _NOTHING)
                if ways != stored:  # most visits add none
                    self._ways[label] = ways
                    yield fact_of(self._path, WAYS + label, ways)

    def streaks(self) -> Iterator[Fact]:
        """Yield what is new of the ways that were gone."""
        streaks = self._records.streaks.told()
        if streaks or STREAKS in self._stored:  # else there is none, as under most policies
            yield from self._if_new(STREAKS, streaks)

    def all_states(self) -> Iterator[Fact]:
        """Yield what is new of every state."""
        yield from self.changed(list(self._records.by_label))

    def marks(self) -> Iterator[Fact]:
        """Yield what is new of the states that have begun: a jump changes marks of many at once."""
        for label, mark in self._records.marks.told():
            if self._marks.get(label) != mark:
                self._marks[label] = mark
                yield fact_of(self._path, MARK + label, [*mark, self._on_retry(label)])

    def _new_visits(self, history: History) -> Iterator[Fact]:
        visits, total = history.visits, history.visits_of_execution
        # with the latest one that is stored: an expert may have changed it
        for number in range(max(self._visits - 1, total - len(visits)), total):
            state, outcome, result = visits[number - total]
            # as many names as visits are kept, so that the store does not grow with each
            yield from self._if_new(
                '{}{}'.format(VISIT, number % cast('int', visits.maxlen)),
                [state, name_text(outcome), int(result), self._execution, number],
            )
        self._visits = total

    def _if_new(self, name: str, plain: object) -> Iterator[Fact]:
        text = _as_json(plain)
        if self._stored.get(name) != text:
            self._stored[name] = text
            yield Fact(self._path, name, Encoded(text, None, {}))


# a version of marshal's format that writes what stands in several places once: data that hold
# themselves have an end
_WITH_REFERENCES = 4
# ids of types of which the same object has the same value: classes may compare as they like
_FIXED = frozenset(map(id, (str, int, float, bool, type(None), bytes)))


class KeptOut(NamedTuple):
    """A value that cannot be stored, or one that is stored without some of its attributes."""

    key: str
    kind: str  # its type
    why: str
    value: object
    attributes: Tuple[str, ...] = ()  # that are not stored, where the rest is


class WeakIds:
    """The objects that were seen. One that has no weak references, such as a list, is kept."""

    def __init__(self) -> None:
        self._seen: Dict[int, Callable[[], object]] = {}

    def add(self, value: object) -> bool:
        """Note an object, and return whether it is new."""
        seen = self._seen.get(id(value))
        if seen is not None and seen() is value:
            return False
        try:
            self._seen[id(value)] = weakref.ref(value)
        except TypeError:
            self._seen[id(value)] = lambda: value
        return True


class _Known(NamedTuple):
    value: object
    stored: Union[Encoded, str]  # why not
    print_: Optional[bytes] = None  # of plain data: differs where the value does


class UserdataFacts:
    """Tells what of the userdata of one container differs from what is stored.

    A key is looked at where it holds another object than before, or one that may have changed
    inside: a list, an array, a message. Of those it is enough to look at what the states can reach
    that have run since.
    """

    def __init__(self, path: str, tell: Callable[[KeptOut], None]) -> None:
        """`tell` gets each value that cannot be stored, when it is first seen."""
        self._path, self._tell = path, tell
        self._known: Dict[str, _Known] = {}

    def changed(self, data: Dict[str, object], reached: Optional[FrozenSet[str]]) -> Iterator[Fact]:
        """Yield the facts that are new.

        `data`: the userdata. `reached`: keys whose values may have changed inside. None means all.
        """
        known = self._known
        for key, value in dict(data).items():
            before = known.get(key)
            if (
                before is not None
                and before.value is value
                and (id(type(value)) in _FIXED or (reached is not None and key not in reached))
            ):
                continue
            yield from self._look(key, value, before)
        for key in [key for key in known if key not in data]:
            stored = known.pop(key).stored
            yield Fact(
                self._path, (KEPT_OUT if isinstance(stored, str) else KEY) + _told(key), None
            )

    def _look(self, key: str, value: object, before: Optional[_Known]) -> Iterator[Fact]:
        print_ = _print_of(value)
        if before is not None and print_ is not None and print_ == before.print_:
            if before.value is not value:
                self._known[key] = before._replace(value=value)
            return
        told = _told(key)
        dropped: List[str] = []
        try:
            if told != text_of(key):
                raise NotStorable('its name is no text in UTF-8')
            encoded = CODECS.encode(value, dropped.append)
        except NotStorable as err:
            yield from self._keep_out(key, value, str(err), before)
            return
        if dropped:
            self._tell(KeptOut(told, type_name(value), '', value, tuple(sorted(set(dropped)))))
        self._known[key] = _Known(
            value, encoded._replace(parts={}), print_ if _is_plain(encoded) else None
        )
        if before is None or isinstance(before.stored, str):
            if before is not None:
                yield Fact(self._path, KEPT_OUT + told, None)
        elif before.stored[:2] == encoded[:2]:
            return
        yield Fact(self._path, KEY + told, encoded)

    def _keep_out(
        self, key: str, value: object, why: str, before: Optional[_Known]
    ) -> Iterator[Fact]:
        kind, told = type_name(value), _told(key)
        self._known[key] = _Known(value, kind)
        if before is not None and before.stored == kind:
            return
        if before is not None and not isinstance(before.stored, str):
            yield Fact(self._path, KEY + told, None)
        yield fact_of(self._path, KEPT_OUT + told, [kind, why])
        self._tell(KeptOut(told, kind, why, value))


def start_facts(path: str, data: Mapping[str, object]) -> Iterator[Fact]:
    """Yield the userdata of a container before the first state of the trial.

    What cannot be stored is left out. It is named as any other such key of the container.
    """
    for key, value in data.items():
        told = _told(key)
        if told == text_of(key):
            with contextlib.suppress(NotStorable):
                yield Fact(path, START + told, CODECS.encode(value, lambda attribute: None))


def _told(key: object) -> str:
    """Return a key as a file can hold it: one made of a file's name may be no UTF-8."""
    return text_of(key).encode('utf-8', 'backslashreplace').decode('utf-8')


def _print_of(value: object) -> Optional[bytes]:
    """Return bytes that differ where plain data differ, or None for anything else."""
    try:
        # to compare, never loaded. It raises for a value of another type than plain ones
        return marshal.dumps(cast('bytes', value), _WITH_REFERENCES)
    except BaseException as err:  # a value that lends its memory may raise anything
        if ends_program(err):
            raise
        return None


def _is_plain(encoded: Encoded) -> bool:
    """Whether a value has no bytes and no arrays: marshal does not tell these apart."""
    parts, whole = encoded.parts, encoded.whole
    text = encoded.text or ('' if whole is None else parts[whole].decode('ascii'))
    return len(parts) == (whole is not None) and '"$b' not in text


def keys_of(machine: smach.StateMachine, label: str) -> FrozenSet[str]:
    """Return the keys of a container that one of its states can read or write."""
    state = states_of(machine).get(label)
    if state is None:
        return frozenset()
    remapping = remapping_of(machine, label)
    return frozenset(
        remapping.get(key, key)
        for key in set(state.get_registered_input_keys()).union(state.get_registered_output_keys())
    )
