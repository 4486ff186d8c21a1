"""States of a stored trial under the names that they have in a later script.

What is stored stays as it is. A fact that is read is told under the new names.
"""

import json
from typing import Any, Collection, Dict, List, Mapping, NamedTuple, Optional, Tuple

from .names import ASKED, AT, BEFORE, EDIT, ENDED, HISTORY, MARK, MOVED, STATE, VISIT, WAYS
from .rows import StoredFact, StoredValue


class StatePath(NamedTuple):
    """A state: its container, below the top machine, and its label there."""

    container: str
    label: str


class Renaming:
    """The names of states: paths below the top machine, by those of before.

    Where a container has another name, what is in it has another path. A state may also stand in
    another container.
    """

    def __init__(self, machine: str, names: Mapping[str, str], containers: Collection[str]) -> None:
        """`machine`: name of the top one. `containers`: paths of all of before, '' of the top."""
        self._machine, self._names, self._containers = machine, dict(names), containers

    def __call__(self, fact: StoredFact) -> StoredFact:
        """Return a fact under the new names."""
        path = self._below(fact.moment_path)
        place = self._place(path, fact.label)
        if fact.label and not self._is_here(path, place) and fact.kind != EDIT:
            fact = fact._replace(kind=MOVED)  # the userdata of then are those of another container
        fact = fact._replace(moment_path=self._whole(place.container), label=place.label)
        if not fact.path:
            return fact
        for word in (STATE, WAYS, MARK):
            if fact.name.startswith(word):
                path, label = self.state(fact.path, fact.name[len(word) :])
                return fact._replace(path=path, name=word + label)
        path = self._below(fact.path)
        fact = fact._replace(path=self._whole(self._path(path)))
        change = {AT: self._at, ASKED: self._asked, HISTORY: self._history}.get(fact.name)
        if fact.name.startswith(VISIT):
            change = self._visit
        plain = json.loads(fact.value.text or 'null')
        if change is None or not plain:
            return fact
        return fact._replace(value=StoredValue(json.dumps(change(path, plain)), None))

    def state(self, path: str, label: str) -> Tuple[str, str]:
        """Return the path of the container, or the branch, of a state now, and its label."""
        path = self._below(path)
        place = self._place(path, label)
        container = self._path(path) if self._is_branch(path) else place.container
        return self._whole(container), place.label

    def _at(self, path: str, at: List[Any]) -> List[Any]:
        if at[1] == ENDED:  # with an outcome
            return at
        place = self._place(path, at[0])
        more = at[3:]
        if at[1] == BEFORE and more:  # the states that may be repeated
            more = [[self._path(each) for each in more[0]]]
        at = [place.label, *at[1:2], *map(self._jumped_to, at[2:3]), *more]
        if self._is_here(path, place):
            return at
        return [place.label, MOVED, self._whole('/'.join(filter(None, place))), at]

    def _jumped_to(self, value: object) -> object:
        """Return the path of a place to which a jump was under way. Anything else as it is."""
        if isinstance(value, str) and value.startswith(self._machine + '/'):
            return self._whole(self._path(self._below(value)))
        return value

    def _asked(self, path: str, asked: List[str]) -> List[str]:
        return [self._place(path, asked[0]).label, *asked[1:]]

    def _visit(self, path: str, visit: List[Any]) -> List[Any]:
        return [self._place(path, visit[0]).label, *visit[1:]]

    def _history(self, path: str, told: List[Any]) -> List[Any]:
        labels = [self._label_here(path, each) for each in told[:3]]
        return labels + [
            [self._label_here(path, state), successes, self._label_here(path, anchor), is_anchored]
            for state, successes, anchor, is_anchored in told[3:]
        ]

    def _label_here(self, path: str, label: Optional[str]) -> Optional[str]:
        """Return the label of a state that still stands in its container, else None."""
        if label is None:
            return None
        place = self._place(path, label)
        return place.label if self._is_here(path, place) else None

    def _is_here(self, path: str, place: StatePath) -> bool:
        return self._is_branch(path) or place.container == self._path(path)

    def _is_branch(self, path: str) -> bool:
        """Whether that is the path of a plain state that has an oracle of its own."""
        return path not in self._containers

    def _place(self, path: str, label: str) -> StatePath:
        """Return where a state of a container, or of a branch, stands now."""
        if not label:
            return StatePath(self._path(path), label)
        parent, _, last = path.rpartition('/')
        if self._is_branch(path) and last == label:
            path = parent
        container, _, now = self._path('{}/{}'.format(path, label) if path else label).rpartition(
            '/'
        )
        return StatePath(container, now)

    def _path(self, path: str) -> str:
        """Return the path of a state or container now."""
        if path in self._names:
            return self._names[path]
        parent, slash, label = path.rpartition('/')
        return '{}/{}'.format(self._path(parent), label) if slash else path

    def _below(self, path: str) -> str:
        return path[len(self._machine) + 1 :]

    def _whole(self, path: str) -> str:
        return '{}/{}'.format(self._machine, path) if path else self._machine


def containers_of(description: str) -> Dict[str, Mapping[str, Any]]:
    """Return the containers that the description of a structure names, by path.

    Empty where it cannot be read.
    """
    try:
        found = json.loads(description or '{}')
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def states_of(description: str) -> List[str]:
    """Return the paths of all states that the description of a structure names."""
    return [
        '/'.join(filter(None, (path, label)))
        for path, container in containers_of(description).items()
        for label in container.get('states', {})
    ]


def told_renaming(value: StoredValue) -> Tuple[str, Dict[str, str]]:
    """Return the structure of before, and the names, of a fact that states are renamed."""
    structure, names = json.loads(value.text or '["", {}]')
    return str(structure), dict(names)
