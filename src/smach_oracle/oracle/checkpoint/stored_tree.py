"""The containers of a tree at one moment, as a store has them."""

import json
from typing import Any, Dict, Iterable, List, Mapping, NamedTuple, Optional, Set, Tuple

from smach_oracle.store.codecs import Codecs, NotReadable
from smach_oracle.store.errors import StoreDamaged
from smach_oracle.store.names import (
    ASKED,
    AT,
    BEFORE,
    EDIT,
    ENDED,
    EXECUTION,
    FAILED,
    GOAL,
    HISTORY,
    IN,
    ITEMS,
    KEPT_OUT,
    KEY,
    MARK,
    MOVED,
    STATE,
    VISIT,
)
from smach_oracle.store.renaming import Renaming
from smach_oracle.store.rows import StoredFact, StoredValue
from smach_oracle.store.store_file import StoreFile

from ..records.events import EventKind
from ..records.visits import Visit, VisitResult


class StoredContainer:
    """One container as it was.

    `at`: label (or, where it has ended, its outcome), phase, and what belongs to that, or empty
    where it has not begun in the present visit of the state that holds it. `keys`: userdata.
    `missing`: why a key that was there is not. `gone`: keys that were deleted. `visits`: of its
    latest execution, oldest first. `snapshots`: userdata with which its states began, by label.
    `asked`: label and id of the open question. `item`: of an Iterator, the number of the one under
    way.
    """

    def __init__(self) -> None:
        self.at: List[Any] = []
        self.execution = 0
        self.history: List[Any] = []
        self.visits: List[Visit] = []
        self.visits_of_execution = 0
        self.states: Dict[str, Mapping[str, Any]] = {}
        self.marks: Dict[str, List[Any]] = {}
        self.begun: Set[str] = set()  # states at which it has stood, and which had begun
        # sent elsewhere by oracle_state: the states that may be repeated. None: it was not
        self.sent: Optional[List[str]] = None
        self.keys: Dict[str, Any] = {}
        self.missing: Dict[str, str] = {}
        self.snapshots: Dict[str, Dict[str, Any]] = {}
        self.asked: List[str] = []
        self.item = 0
        self.gone: List[str] = []

    def complete_snapshots(self, data: Mapping[str, Any]) -> None:
        """Have in the snapshots what could not be stored, as the userdata have it now."""
        for key in self.missing:
            if key in data:
                for snapshot in self.snapshots.values():
                    snapshot.setdefault(key, data[key])

    def labels(self) -> Set[str]:
        """Return the states of which anything is told."""
        here = {self.label} if self.at and self.phase not in (ENDED, MOVED) else set()
        return {*self.states, *self.marks, *self.begun, *here}

    def visits_of(self, label: str) -> int:
        """Return how many visits of a state have ended in the trial."""
        return int(self.states.get(label, {}).get('counts', [0])[0])

    @property
    def phase(self) -> str:
        """Return the phase, '' where it has not begun."""
        return str(self.at[1]) if self.at else ''

    @property
    def moved_to(self) -> str:
        """Path of the state at which it stood, where that is in another container now, else ''."""
        return str(self.at[2]) if self.phase == MOVED else ''

    @property
    def jumped_to(self) -> str:
        """Path of the place below to which a jump was under way, '' for none.

        Once a container below has begun, it knows better.
        """
        has_it = self.phase in (BEFORE, IN) and len(self.at) > 2
        return str(self.at[2] or '') if has_it else ''

    @property
    def label(self) -> str:
        """Return the state where it stands, '' where it has not begun."""
        return str(self.at[0]) if self.at else ''


_Values = Dict[str, StoredValue]  # by key


class StoredTree(NamedTuple):
    """The containers by their keys, and what belongs to the whole tree, by name."""

    containers: Dict[str, StoredContainer]
    whole: Dict[str, Any]

    @property
    def goals(self) -> Dict[str, str]:
        """Return the servers of the goals that ran, by goal id."""
        return {
            name[len(GOAL) :]: str(server)
            for name, server in self.whole.items()
            if name.startswith(GOAL) and server
        }

    def container(self, key: str) -> StoredContainer:
        """Return what is stored of a container, nothing where nothing is."""
        return self.containers.get(key) or StoredContainer()


def read_tree(
    store: StoreFile,
    trial: int,
    codecs: Codecs,
    until: Optional[int] = None,
    renaming: Optional[Renaming] = None,
) -> StoredTree:
    """Return what a store says at a moment of a trial, by default the last one.

    `renaming`: to names that states have got since.

    :raises StoreDamaged: where the store cannot be read.
    """
    facts = store.facts(trial, until)
    return _Reading(store, codecs).read(facts if renaming is None else map(renaming, facts))


# moments of a state that has failed: what is new then, its preconditions have written
_AFTER_FAILURE = frozenset(
    kind.name for kind in (EventKind.PRECONDITION_START, EventKind.DECISION, EventKind.QUERY_OPENED)
)


class _Reading:
    """One pass over the facts of a trial."""

    def __init__(self, store: StoreFile, codecs: Codecs) -> None:
        self._store, self._codecs = store, codecs
        self._tree = StoredTree({}, {})
        self._keys: Dict[str, _Values] = {}  # by path
        self._at_entry: Dict[str, Dict[str, _Values]] = {}  # by path and label
        self._visits: Dict[str, Dict[Tuple[int, int], Visit]] = {}
        self._decoded: Dict[Tuple[str, StoredValue], Any] = {}  # by userdata key

    def read(self, facts: Iterable[StoredFact]) -> StoredTree:
        before: Optional[StoredFact] = None
        for fact in facts:
            if before is not None and before.moment != fact.moment:
                self._note_entry(before)
            before = fact
            if fact.name:
                self._take(fact)
        if before is not None:
            self._note_entry(before)
        for path, container in self._tree.containers.items():
            self._put_together(path, container)
        return self._tree

    def _note_entry(self, fact: StoredFact) -> None:
        """Keep the userdata with which a state began, as its snapshot."""
        if fact.kind == EventKind.STATE_START.name:
            path = fact.moment_path
            self._at_entry.setdefault(path, {})[fact.label] = dict(self._keys.get(path, {}))

    def _take(self, fact: StoredFact) -> None:
        path, name, value = fact.path, fact.name, fact.value
        if not path:
            self._tree.whole[name] = _plain(value)
            return
        container = self._tree.containers.setdefault(path, StoredContainer())
        if name.startswith(KEY):
            self._keys.setdefault(path, {})[name[len(KEY) :]] = value
            # what somebody has set outlives a restore, and what a precondition has written
            if fact.kind == EDIT:
                for values in self._at_entry.get(path, {}).values():
                    values[name[len(KEY) :]] = value
            elif fact.kind in _AFTER_FAILURE and path == fact.moment_path:
                self._at_entry.get(path, {}).get(fact.label, {})[name[len(KEY) :]] = value
        elif name.startswith(KEPT_OUT):
            container.missing.pop(name[len(KEPT_OUT) :], None)
            if value.is_there:
                kind, why = _plain(value)
                container.missing[name[len(KEPT_OUT) :]] = '{} was not stored: {}'.format(kind, why)
        elif name.startswith(VISIT):
            state, outcome, result, *when = _plain(value)
            # of an earlier version the name says when
            execution, number = when or map(int, name[len(VISIT) :].split(':'))
            self._visits.setdefault(path, {})[execution, number] = Visit(
                state, outcome, VisitResult(result)
            )
        elif name.startswith(STATE):
            told = container.states[name[len(STATE) :]] = _plain(value)
            if 'mark' in told:  # of an earlier version
                container.marks[name[len(STATE) :]] = told['mark']
        elif name.startswith(MARK):
            container.marks[name[len(MARK) :]] = _plain(value)
        elif name == AT:
            container.at = _plain(value) or []
            container.sent = [*container.at[3:4], []][0] if fact.kind == EDIT else None
            self._note_begun(path, container.at)
        else:
            self._take_named(container, path, name, _plain(value))

    def _note_begun(self, path: str, at: List[Any]) -> None:
        """Keep which states have begun, also where the machine is sent elsewhere later."""
        if at and at[1] == MOVED:
            path, at = at[2].rpartition('/')[0], at[3]
        if at and at[1] in (IN, FAILED):
            self._tree.containers.setdefault(path, StoredContainer()).begun.add(at[0])

    def _take_named(self, container: StoredContainer, path: str, name: str, plain: Any) -> None:
        if name == HISTORY:
            container.history = plain
        elif name == ASKED:
            container.asked = plain or []
        elif name == ITEMS:
            container.item = plain or 0
        elif name == EXECUTION:
            container.execution = plain
            self._at_entry.pop(path, None)

    def _put_together(self, path: str, container: StoredContainer) -> None:
        visits = self._visits.get(path, {})
        latest = max(
            (number for execution, number in visits if execution == container.execution), default=-1
        )
        container.visits_of_execution = latest + 1
        while (container.execution, latest) in visits:
            container.visits.insert(0, visits[container.execution, latest])
            latest -= 1
        for key, value in self._keys.get(path, {}).items():
            if not value.is_there:
                container.gone.append(key)
                continue
            try:
                container.keys[key] = self._value(key, value)
            except NotReadable as err:
                container.missing[key] = str(err)
        for label, values in self._at_entry.get(path, {}).items():
            container.snapshots[label] = self._readable(values)

    def _readable(self, values: _Values) -> Dict[str, Any]:
        found = {}
        for key, value in values.items():
            try:
                if value.is_there:
                    found[key] = self._value(key, value)
            except NotReadable:
                pass  # said of the present value, or not needed any more
        return found

    def _value(self, key: str, value: StoredValue) -> Any:
        """Return a value, the same object where a container hands it to those below."""
        known = self._decoded
        if (key, value) not in known:
            known[key, value] = self._codecs.decode(value.text, value.whole, self._store.part)
        return known[key, value]


def _plain(value: StoredValue) -> Any:
    try:
        return json.loads(value.text or 'null')
    except ValueError as err:
        raise StoreDamaged('a stored fact cannot be read: {}'.format(err)) from err
