"""The marks of all states of a stored trial: what has begun in it has begun, whatever follows.

A trial may go on from an earlier moment, or with other names of states. Neither makes undone what
the robot has done. A guarded state (`on_retry`) that may come again for that is spent.
"""

from typing import Callable, Dict, Mapping, Tuple

from ..records.visits import VisitMark
from .stored_tree import StoredContainer, StoredTree

StatePlace = Tuple[str, str]  # path of a container or branch, label
Marks = Mapping[StatePlace, VisitMark]


def same_place(path: str, label: str) -> StatePlace:
    """Return where a state is whose script has not changed."""
    return path, label


def marks_now(
    latest: StoredTree, tree: StoredTree, place_of: Callable[[str, str], StatePlace]
) -> Marks:
    """Return the marks with which a trial goes on.

    `latest`: what its last moment says. `tree`: what it goes on from, under the present names.
    `place_of`: where a state of the last moment is now.
    """
    found: Dict[StatePlace, VisitMark] = {}
    joined = set()  # several states of before are one now
    for path, container in latest.containers.items():
        for label in container.labels():
            place, mark = place_of(path, label), _mark_of(container, label)
            if place in found:
                joined.add(place)
                mark = _joined(found[place], mark)
            found[place] = mark
    for (path, label), mark in found.items():
        before = tree.container(path)
        if (path, label) in joined:
            mark.spent = mark.done
        elif before is not latest.containers.get(path):
            told = _mark_of(before, label)
            has_run_since = (mark.executed, mark.done) != (told.executed, told.done) or (
                latest.container(path).visits_of(label) > before.visits_of(label)
                and place_of is same_place
            )
            mark.spent = mark.spent or (mark.done and has_run_since)
            mark.reached = told.reached
    return found


def _mark_of(container: StoredContainer, label: str) -> VisitMark:
    """Return a mark. Where no state was guarded, visits were counted, and not numbered."""
    told = container.marks.get(label, [0, 0, 0, 0])
    is_done = bool(told[2] or container.visits_of(label) or label in container.begun)
    return VisitMark(told[0], told[1], is_done, bool(told[3]))


def _joined(one: VisitMark, other: VisitMark) -> VisitMark:
    one.reached, one.executed = max(one.reached, other.reached), max(one.executed, other.executed)
    one.done = one.done or other.done
    return one
