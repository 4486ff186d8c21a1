"""The marks of all states of a stored trial: what has begun in it has begun, whatever follows.

A trial may go on from an earlier moment, or with other names of states. Neither makes undone what
the robot has done. A guarded state (`on_retry`) that may come again for that is spent.
"""

from typing import Callable, Dict, Mapping, Optional, Sequence, Tuple

import smach

from ..errors import SettingsError
from ..machine.places import TreePlace, place_named
from ..machine.repeats import begin_once_more
from ..machine.tree_node import TreeNode
from ..records.visits import VisitMark
from ..settings.settings import ALLOW
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
    mark = VisitMark()
    told = container.marks.get(label, [0, 0, 0, 0])
    mark.reached, mark.executed, mark.spent = told[0], told[1], bool(told[3])
    mark.done = bool(told[2] or container.visits_of(label) or label in container.begun)
    return mark


def _joined(one: VisitMark, other: VisitMark) -> VisitMark:
    one.reached, one.executed = max(one.reached, other.reached), max(one.executed, other.executed)
    one.done = one.done or other.done
    return one


def take_over_marks(nodes: Sequence[TreeNode], marks: Marks, in_doubt: bool) -> int:
    """Have the marks of a stored trial, and return the number of the latest visit.

    `in_doubt`: any guarded state may have run that the store does not know of.
    """
    by_key = {node.key: node for node in nodes}
    for (path, label), mark in marks.items():
        node = by_key.get(path)
        if node is not None and (mark.done or mark.reached) and label in node.labels():
            node.record(label)  # of a state that only a precondition has run, too
            node.records.marks.take_over(label, mark)
    for place in (TreePlace(node, label) for node in nodes if in_doubt for label in node.labels()):
        if place.node.settings_of(place.label).on_retry != ALLOW:
            place.node.record(place.label)
            unknown = place.node.records.marks.of(place.label)
            unknown.done = unknown.spent = True
    return max((max(mark.reached, mark.executed) for mark in marks.values()), default=0)


def let_repeat(top: TreeNode, paths: Sequence[str], by_command: Optional[Sequence[str]]) -> None:
    """Let states begin once more, as a person has said, in the settings or by oracle_state.

    :raises SettingsError: for a state of the settings that is not there.
    """
    for path in [*paths, *(by_command or ())]:
        place = place_named(top, path, at_rest=True)
        if place is None and path in paths:
            raise SettingsError(
                'resume_repeat',
                path,
                'the label of a state of {}, or the path of one below it'.format(top.path),
            )
        if place is not None:
            begin_once_more(place.node, place.label)
            smach.logwarn(
                '{}: may be repeated once, as somebody has said (--repeat {})'.format(
                    place.path, path
                )
            )
