"""The containers of a tree at one moment, as a store has them."""

import json
from dataclasses import dataclass, field
from itertools import groupby
from operator import attrgetter
from typing import (
    Dict,
    Iterable,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Set,
    Tuple,
    TypedDict,
    TypeVar,
    Union,
    cast,
)

from smach_oracle.store import names
from smach_oracle.store.codecs import CODECS, NotReadable
from smach_oracle.store.errors import StoreDamaged
from smach_oracle.store.renaming import Renaming
from smach_oracle.store.rows import StoredFact, StoredValue
from smach_oracle.store.store_file import StoreFile

from ..records.events import EventKind
from ..records.history import Told
from ..records.streaks import Told as Streaks
from ..records.visits import Visit, VisitResult

_Plain = TypeVar('_Plain')
_Values = Dict[str, StoredValue]  # by key


class StoredState(TypedDict, total=False):
    """What a state has learned and counted.

    Of an earlier version are `mark`, and results of ways in `learned`.
    """

    learned: Dict[str, object]
    counts: List[int]
    longest_s: Optional[float]
    shared: Dict[str, object]
    mark: List[int]


@dataclass
class StoredContainer:
    """One container as it was.

    `at`: label (or, where it has ended, its outcome), phase, and what belongs to that, or empty
    where it has not begun in the present visit of the state that holds it. `keys`: userdata.
    `missing`: why a key that was there is not. `gone`: keys that were deleted. `visits`: of its
    latest execution, oldest first. `ways`: results of those on from a state, by label, as
    `StateRecord.way_results` tells them. `snapshots`: userdata with which its states began, by
    label. `asked`: label and id of the open question. `item`: of an Iterator, the number of the one
    under way.
    """

    at: List[object] = field(default_factory=list)
    execution: int = 0
    history: Optional[Told] = None
    streaks: Streaks = field(default_factory=dict)
    visits: List[Visit] = field(default_factory=list)
    visits_of_execution: int = 0
    states: Dict[str, StoredState] = field(default_factory=dict)
    ways: Dict[str, Dict[str, object]] = field(default_factory=dict)
    marks: Dict[str, List[int]] = field(default_factory=dict)
    begun: Set[str] = field(default_factory=set)  # at which it has stood, and which had begun
    # sent elsewhere by oracle_state: the states that may be repeated. None: it was not
    sent: Optional[List[str]] = None
    keys: Dict[str, object] = field(default_factory=dict)
    missing: Dict[str, str] = field(default_factory=dict)
    snapshots: Dict[str, Dict[str, object]] = field(default_factory=dict)
    asked: List[str] = field(default_factory=list)
    item: int = 0
    gone: List[str] = field(default_factory=list)

    def put_into(self, data: Dict[str, object]) -> None:
        """Have userdata as they were, and in the snapshots what could not be stored."""
        for key in self.gone:
            data.pop(key, None)
        data.update(self.keys)
        self.complete_snapshots(data)

    def complete_snapshots(self, data: Mapping[str, object]) -> None:
        """Have in the snapshots what could not be stored, as the userdata have it now."""
        for key in self.missing:
            if key in data:
                for snapshot in self.snapshots.values():
                    snapshot.setdefault(key, data[key])

    def labels(self) -> Set[str]:
        """Return the states of which anything is told."""
        here = {self.label} if self.at and self.phase not in (names.ENDED, names.MOVED) else set()
        return {*self.states, *self.marks, *self.begun, *here}

    def visits_of(self, label: str) -> int:
        """Return how many visits of a state have ended in the trial."""
        return self.states[label]['counts'][0] if label in self.states else 0

    @property
    def phase(self) -> str:
        """Return the phase, '' where it has not begun."""
        return str(self.at[1]) if self.at else ''

    @property
    def moved_to(self) -> str:
        """Path of the state at which it stood, where that is in another container now, else ''."""
        return str(self.at[2]) if self.phase == names.MOVED else ''

    @property
    def at_there(self) -> List[object]:
        """Return how it stands there."""
        return cast('List[object]', self.at[3])

    @property
    def jumped_to(self) -> str:
        """Path of the place below to which a jump was under way, '' for none.

        Once a container below has begun, it knows better.
        """
        has_it = self.phase in (names.BEFORE, names.IN) and len(self.at) > 2
        return str(self.at[2] or '') if has_it else ''

    @property
    def label(self) -> str:
        """Return the state where it stands, '' where it has not begun."""
        return str(self.at[0]) if self.at else ''


class StoredTree(NamedTuple):
    """The containers by their keys, and what belongs to the whole tree, by name.

    `start`: userdata before the first state of the trial, by the keys of containers. It is stored
    where a policy may go back to it.
    """

    containers: Dict[str, StoredContainer]
    whole: Dict[str, object]
    start: Mapping[str, Dict[str, object]] = {}

    @property
    def goals(self) -> Dict[str, str]:
        """Return the servers of the goals that ran, by goal id."""
        return {
            name[len(names.GOAL) :]: str(server)
            for name, server in self.whole.items()
            if name.startswith(names.GOAL) and server
        }

    def container(self, key: str) -> StoredContainer:
        """Return what is stored of a container, nothing where nothing is."""
        return self.containers.get(key) or StoredContainer()


def read_tree(
    store: StoreFile,
    trial: int,
    until: Optional[int] = None,
    renaming: Optional[Renaming] = None,
) -> StoredTree:
    """Return what a store says at a moment of a trial, by default the last one.

    `renaming`: to names that states have got since.

    :raises StoreDamaged: where the store cannot be read.
    """
    facts = store.facts(trial, until)
    return _Reading(store).read(facts if renaming is None else map(renaming, facts))


# moments of a state that has failed: what is new then, its preconditions have written
_AFTER_FAILURE = frozenset(
    kind.name for kind in (EventKind.PRECONDITION_START, EventKind.DECISION, EventKind.QUERY_OPENED)
)


class _Reading:
    """One pass over the facts of a trial."""

    def __init__(self, store: StoreFile) -> None:
        self._store = store
        self._tree = StoredTree({}, {})
        self._keys: Dict[str, _Values] = {}  # by path
        self._at_entry: Dict[str, Dict[str, _Values]] = {}  # by path and label
        self._start: Dict[str, _Values] = {}  # by path
        self._visits: Dict[str, Dict[Tuple[int, int], Visit]] = {}
        self._decoded: Dict[Tuple[str, StoredValue], object] = {}  # by userdata key

    def read(self, facts: Iterable[StoredFact]) -> StoredTree:
        for _, moment in groupby(facts, attrgetter('moment')):
            for fact in moment:
                if fact.name:
                    self._take(fact)
            self._note_entry(fact)
        for path, container in self._tree.containers.items():
            self._put_together(path, container)
        # what cannot be read is said of the present value
        start = {path: self._readable(values, {}) for path, values in self._start.items()}
        return self._tree._replace(start=start)

    def _note_entry(self, fact: StoredFact) -> None:
        """Keep the userdata with which a state began, as its snapshot."""
        if fact.kind == EventKind.STATE_START.name:
            path = fact.moment_path
            self._at_entry.setdefault(path, {})[fact.label] = dict(self._keys.get(path, {}))

    def _take(self, fact: StoredFact) -> None:
        path, name, value = fact.path, fact.name, fact.value
        if not path:
            self._tree.whole[name] = _plain(value, None)
            return
        container = self._tree.containers.setdefault(path, StoredContainer())
        word = name[: name.find(':') + 1] or name
        of = name[len(word) :]  # a userdata key, or a label
        if word == names.KEY:
            self._take_key(fact, of)
        elif word == names.START:
            self._start.setdefault(path, {})[of] = value
        elif word == names.KEPT_OUT:
            container.missing.pop(of, None)
            if value.is_there:
                container.missing[of] = '{} was not stored: {}'.format(*_plain(value, ['', '']))
        elif word == names.VISIT:
            visit: List[Union[str, int]] = _plain(value, [])
            state, outcome, result, *when = visit
            # of an earlier version the name says when
            execution, number = map(int, when or of.split(':'))
            self._visits.setdefault(path, {})[execution, number] = Visit(
                str(state), str(outcome), VisitResult(cast('int', result))
            )
        elif word == names.STATE:
            told = container.states[of] = _plain(value, cast('StoredState', {}))
            if 'mark' in told:  # of an earlier version
                container.marks[of] = told['mark']
        elif word == names.WAYS:
            container.ways[of] = _plain(value, {})
        elif word == names.MARK:
            mark: List[int] = _plain(value, [])
            container.marks[of] = mark[:4]
        elif word == names.AT:
            at = container.at = _plain(value, [])
            if container.phase == names.MOVED:
                path, at = container.moved_to.rpartition('/')[0], container.at_there
            is_sent = fact.kind == names.EDIT
            container.sent = (cast('List[str]', at[3]) if at[3:] else []) if is_sent else None
            # it has begun, also where the machine is sent elsewhere later
            if at and at[1] in (names.IN, names.FAILED):
                there = self._tree.containers.setdefault(path, StoredContainer())
                there.begun.add(str(at[0]))
        elif word == names.HISTORY:
            container.history = _plain(value, container.history)
        elif word == names.STREAKS:
            container.streaks = _plain(value, container.streaks)
        elif word == names.ASKED:
            container.asked = _plain(value, [])
        elif word == names.ITEMS:
            container.item = _plain(value, 0)
        elif word == names.EXECUTION:
            container.execution = _plain(value, 0)
            self._at_entry.pop(path, None)

    def _take_key(self, fact: StoredFact, key: str) -> None:
        path, entries = fact.path, self._at_entry.get(fact.path, {})
        self._keys.setdefault(path, {})[key] = fact.value
        # what somebody has set outlives a restore, and what a precondition has written
        if fact.kind == names.EDIT:
            for values in (*entries.values(), self._start.setdefault(path, {})):
                values[key] = fact.value
        elif fact.kind in _AFTER_FAILURE and path == fact.moment_path:
            entries.get(fact.label, {})[key] = fact.value

    def _put_together(self, path: str, container: StoredContainer) -> None:
        visits = self._visits.get(path, {})
        latest = max(
            (number for execution, number in visits if execution == container.execution), default=-1
        )
        container.visits_of_execution = latest + 1
        while (container.execution, latest) in visits:
            container.visits.insert(0, visits[container.execution, latest])
            latest -= 1
        values = self._keys.get(path, {})
        container.gone += (key for key, value in values.items() if not value.is_there)
        container.keys = self._readable(values, container.missing)
        for label, values in self._at_entry.get(path, {}).items():
            # what cannot be read is said of the present value, or not needed any more
            container.snapshots[label] = self._readable(values, {})

    def _readable(self, values: _Values, missing: Dict[str, str]) -> Dict[str, object]:
        """Return the values that can be read. `missing`: gets why others cannot."""
        found = {}
        for key, value in values.items():
            try:
                if value.is_there:
                    found[key] = self._value(key, value)
            except NotReadable as err:
                missing[key] = str(err)
        return found

    def _value(self, key: str, value: StoredValue) -> object:
        """Return a value, the same object where a container hands it to those below."""
        known = self._decoded
        if (key, value) not in known:
            known[key, value] = CODECS.decode(value.text, value.whole, self._store.part)
        return known[key, value]


def _plain(value: StoredValue, otherwise: _Plain) -> _Plain:
    """Return the plain data of a fact, `otherwise` where it is gone."""
    try:
        plain: Optional[_Plain] = json.loads(value.text or 'null')
    except ValueError as err:
        raise StoreDamaged('a stored fact cannot be read: {}'.format(err)) from err
    return otherwise if plain is None else plain
