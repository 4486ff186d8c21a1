"""The facts of one container that are to be stored, and those of them that are new."""

import json
from typing import Any, Dict, Iterator, List, Optional, Union

from smach_oracle.store.codecs import Encoded
from smach_oracle.store.names import EXECUTION, HISTORY, MARK, STATE, VISIT
from smach_oracle.store.rows import Fact

from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..records.history import History
from ..records.visits import Visit
from .stored_container import StoredContainer

_as_json = json.JSONEncoder(separators=(',', ':')).encode
Plain = Union[Dict[str, Any], List[Any], str, int]


def fact_of(path: str, name: str, plain: Plain) -> Fact:
    """Return a fact of plain data."""
    return Fact(path, name, Encoded(_as_json(plain), None, {}))


class ContainerFacts:
    """Tells what of a container's records differs from what is stored."""

    def __init__(self, node: TreeNode, before: Optional[StoredContainer] = None) -> None:
        """`before`: what is stored of it, where the trial is resumed."""
        self._node = node
        self._path = node.key
        self._execution = 0 if before is None else before.execution  # number of the present one
        self._stored: Dict[str, str] = {}  # texts by name
        self._marks: Dict[str, List[object]] = {}  # by label
        self._latest: Optional[Visit] = None  # that is stored
        # stored ones of this execution
        self._visits = 0 if before is None else before.visits_of_execution

    def begin_execution(self) -> Iterator[Fact]:
        """Yield what is new where the container begins to execute."""
        self._execution += 1
        self._visits = 0
        self._node.records.history.count_visits()
        yield fact_of(self._path, EXECUTION, self._execution)

    def changed(self, labels: List[str]) -> Iterator[Fact]:
        """Yield what is new of the history, and of these states."""
        history = self._node.records.history
        yield from self._new_visits(history)
        yield from self._if_new(HISTORY, history.told())
        for label in labels:
            record = self._node.records.by_label.get(label)
            if record is not None:
                yield from self._if_new(STATE + label, self._of_state(record))

    def all_states(self) -> Iterator[Fact]:
        """Yield what is new of every state."""
        yield from self.changed(list(self._node.records.by_label))

    def _of_state(self, record: StateRecord) -> Dict[str, Any]:
        return {
            'learned': record.learned(),
            'counts': [record.visits, record.recoveries, record.fallbacks, record.unwell_repeats],
            'longest_s': record.longest_s,
            'shared': record.shared,
        }

    def marks(self) -> Iterator[Fact]:
        """Yield what is new of the states that have begun: a jump changes marks of many at once."""
        for label, mark in self._node.records.marks.told():
            if self._marks.get(label) != mark:
                self._marks[label] = mark
                if label in self._node.machine._states:
                    yield fact_of(
                        self._path, MARK + label, [*mark, self._node.settings_of(label).on_retry]
                    )

    def _new_visits(self, history: History) -> Iterator[Fact]:
        visits = history.visits
        total = history.visits_of_execution
        first = max(self._visits - 1, total - len(visits), 0)
        if first < min(self._visits, total) and visits[first - total] is self._latest:
            first += 1  # else an expert has changed it
        for number in range(first, total):
            state, outcome, result = visits[number - total]
            # as many names as visits are kept, so that the store does not grow with each
            yield from self._if_new(
                '{}{}'.format(VISIT, number % (visits.maxlen or 1)),
                [state, outcome, int(result), self._execution, number],
            )
        self._visits = total
        self._latest = visits[-1] if visits else None

    def _if_new(self, name: str, plain: Plain) -> Iterator[Fact]:
        text = _as_json(plain)
        if self._stored.get(name) != text:
            self._stored[name] = text
            yield Fact(self._path, name, Encoded(text, None, {}))
