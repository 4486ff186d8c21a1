"""What a trial of the model has done to states that are not to be repeated (`on_retry`)."""

from typing import Any, Dict, Iterator, List, Set, Tuple

from .plan import TreePlan

Place = Tuple[str, str]  # path of a container, label


class Repeats:
    """The course of a trial, in the words of doc/limits.md, "States that are not repeated"."""

    def __init__(self, plan: TreePlan) -> None:
        self._plan = plan
        self.begin_trial()

    def begin_trial(self) -> None:
        """Nothing was done yet."""
        self._moment = 0
        self._came: Dict[Place, int] = {}  # when the machine came there last
        self._begun: Dict[Place, int] = {}  # when its execution was begun last by a visit
        self._done: Set[Place] = set()  # begun, also as a precondition
        self._spent: Set[Place] = set()

    def rule(self, place: Place) -> str:
        """What is set of a state."""
        return self._plan.of(*place).on_retry

    def come(self, place: Place) -> bool:
        """The machine comes to a state; returns whether it is held back."""
        self._moment += 1
        self._came[place] = self._moment
        if self.rule(place) != 'allow' and place in self._spent:
            return True
        self._begun[place] = self._moment
        self._done.add(place)
        return False

    def is_closed(self, place: Place) -> bool:
        """Whether nobody may go there."""
        return place in self._done and self.rule(place) == 'never'

    def _guarded(self, machine: Any) -> Iterator[Place]:
        """The guarded states that were begun, in a container or below it."""
        for place in sorted(self._done):
            if self.rule(place) != 'allow' and (
                place in machine.own_places()
                or (place[0] + '/').startswith(machine.path + '/')
                and machine.holds_paths()
            ):
                yield place

    def _since(self, machine: Any, target: str) -> List[Place]:
        since = self._came.get((machine.path, target), 0)
        return [place for place in self._guarded(machine) if self._begun.get(place, 0) >= since]

    def repeated_by(self, machine: Any, target: str) -> Tuple[str, ...]:
        """What would be repeated if the machine went to a state; names below the container."""
        since = self._came.get((machine.path, target), 0)
        behind = _followers(machine, target)
        found = []
        for place in self._guarded(machine):
            again = bool(since) and self._begun.get(place, 0) >= since
            waits = not since or (place in self._spent and place in self._came)
            if again or (waits and self._label_in(machine, place) in behind):
                found.append('/'.join(place)[len(machine.path) + 1 :])
        return tuple(sorted(found))

    @staticmethod
    def _label_in(machine: Any, place: Place) -> str:
        return '/'.join(place)[len(machine.path) + 1 :].split('/')[0]

    def leave_for(self, machine: Any, target: str, below: List[Place]) -> None:
        """The oracle goes to a state: what was begun since it was there last is spent."""
        self._spent.update(self._since(machine, target))
        self._spent.difference_update([(machine.path, target), *below])

    def superseded(self, place: Place) -> None:
        """An expert has done the work of a state that was held back."""
        self._spent.discard(place)
        if place in self._done:
            self._begun[place] = self._came[place]

    def blocks_precondition(self, place: Place) -> bool:
        """Whether a state is no precondition any more, since it was done."""
        return place in self._done and self.rule(place) != 'allow'

    def runs_as_precondition(self, place: Place) -> None:
        """A state, a leaf, is executed as a precondition: it does not come again by itself."""
        self._done.add(place)
        if self.rule(place) != 'allow':
            self._spent.add(place)
            self._came.pop(place, None)
            self._begun.pop(place, None)


def _followers(machine: Any, target: str) -> Set[str]:
    """The states to which the author's transitions lead from one, with that itself."""
    found, waiting = set(), [target]
    while waiting:
        label = waiting.pop()
        if label not in found:
            found.add(label)
            waiting += [
                name for name in machine.plan.transitions[label].values() if name in machine.labels
            ]
    return found
