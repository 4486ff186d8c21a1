"""Reads the containers of a tree at one moment from a store."""

import json
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Tuple

from smach_oracle.store.codecs import Codecs, NotReadable
from smach_oracle.store.errors import StoreDamaged
from smach_oracle.store.names import (
    ASKED,
    AT,
    EDIT,
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
from .stored_container import StoredContainer

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
