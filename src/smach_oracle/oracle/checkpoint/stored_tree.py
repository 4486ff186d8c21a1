"""What a store says of the containers of a tree at one moment."""
import json
from typing import Any, Dict, Mapping, NamedTuple, Optional, Tuple

from smach_oracle.store.codecs import Codecs, NotReadable
from smach_oracle.store.errors import StoreDamaged
from smach_oracle.store.rows import Facts
from smach_oracle.store.store_file import StoreFile

from ..records.visits import Visit, VisitResult
from .container_facts import AT, EXECUTION, HISTORY, STATE, VISIT
from .stored_container import StoredContainer
from .userdata_facts import KEPT_OUT, KEY


class StoredTree(NamedTuple):
    """The containers by their keys, and what belongs to the whole tree, by name."""

    containers: Dict[str, StoredContainer]
    whole: Dict[str, Any]

    def container(self, key: str) -> StoredContainer:
        """Return what is stored of a container, nothing where nothing is."""
        return self.containers.get(key) or StoredContainer()


def read_tree(store: StoreFile, trial: int, codecs: Codecs, until: Optional[int] = None
              ) -> StoredTree:
    """Return what a store says at a moment of a trial, by default the last one.

    :raises StoreDamaged: where the store cannot be read.
    """
    tree = StoredTree({}, {})
    facts = store.facts(trial, until)
    visits: Dict[str, Dict[Tuple[int, int], Visit]] = {}
    for (path, name), value in facts.items():
        if not path:
            tree.whole[name] = _plain(value.text)
            continue
        container = tree.containers.setdefault(path, StoredContainer())
        if name.startswith(VISIT):
            execution, number = map(int, name[len(VISIT):].split(':'))
            state, outcome, result = _plain(value.text)
            visits.setdefault(path, {})[execution, number] = Visit(
                state, outcome, VisitResult(result))
        elif not name.startswith((KEY, KEPT_OUT)):
            _take(container, name, value.text)
    for path, by_number in visits.items():
        _take_visits(tree.containers[path], by_number)
    _take_userdata(tree, facts, store, codecs)
    return tree


def _take(container: StoredContainer, name: str, text: Optional[str]) -> None:
    if text is None:
        return
    plain = _plain(text)
    if name == AT:
        container.at = plain
    elif name == EXECUTION:
        container.execution = plain
    elif name == HISTORY:
        container.history = plain
    elif name.startswith(STATE):
        container.states[name[len(STATE):]] = plain


def _take_visits(container: StoredContainer, visits: Mapping[Tuple[int, int], Visit]) -> None:
    present = sorted(number for execution, number in visits if execution == container.execution)
    container.visits = [visits[container.execution, number] for number in present]
    container.visits_of_execution = present[-1] + 1 if present else 0


def _take_userdata(tree: StoredTree, facts: Facts, store: StoreFile, codecs: Codecs) -> None:
    for (path, name), value in facts.items():
        if not path or not name.startswith((KEY, KEPT_OUT)):
            continue
        container = tree.containers[path]
        is_there = value.text is not None or value.whole is not None
        if name.startswith(KEPT_OUT):
            if is_there:
                kind, why = _plain(value.text)
                container.missing[name[len(KEPT_OUT):]] = '{} was not stored: {}'.format(kind, why)
            continue
        key = name[len(KEY):]
        if not is_there:
            container.gone.append(key)
            continue
        try:
            container.keys[key] = codecs.decode(value.text, value.whole, store.part)
        except NotReadable as err:
            container.missing[key] = str(err)


def _plain(text: Optional[str]) -> Any:
    try:
        return json.loads(text or 'null')
    except ValueError as err:
        raise StoreDamaged('a stored fact cannot be read: {}'.format(err)) from err
