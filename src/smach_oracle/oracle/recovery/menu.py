"""Makes the menu of a failure: the ways on, from where the machine stands.

The same function makes the ways that a policy chooses from and what a person is told of a place.
"""

from typing import Iterator, List, NamedTuple, Optional, Sequence, Tuple

import smach

from ..decision.ways import WAITS_S, Way, WayKind
from ..machine.jump_path import JumpPath, jump_path_to
from ..machine.nesting import nodes_of
from ..machine.places import TreePlace, is_direct, levels_above, place_named
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode, node_of
from ..records.visits import VisitResult
from ..smach_private import initial_label_of, states_of

_MOST_VISITED = 64  # states, to which a step back may lead


class OpenWay(NamedTuple):
    """A way, and the path of its jump."""

    way: Way
    jump_path: JumpPath


def levels_of(node: TreeNode) -> List[TreeNode]:
    """Return a container and those above it that a way may lead to, the innermost first.

    It ends where a Concurrence or an Iterator lies between: what runs in the other branches, and
    what is done of the items, is not given up for one failure.
    """
    running = [node, *levels_above(node)]
    return [level for level in levels_at_rest(node) if any(level is each for each in running)]


def levels_at_rest(node: TreeNode) -> List[TreeNode]:
    """Return those that they would be, whatever runs."""
    levels = [node]
    while is_direct(node) and node.parent is not None:
        node = node.parent
        levels.append(node)
    return levels


def visited_before(node: TreeNode, label: str, since: int = 0) -> Tuple[str, ...]:
    """Return the other states that were visited before a state, the latest first, by name.

    Those of the containers above come last. Each is there once. `since`: visits after its failure.
    """
    found: List[str] = []
    for level in levels_of(node):
        own = label if level is node else ''
        visits = list(level.records.history.visits)
        if level is node and since:
            del visits[-since:]
        labels = dict.fromkeys(
            visit.state
            for visit in reversed(visits)
            if visit.state != own and level.has(visit.state)
        )
        if level is not node:
            labels.pop(state_around(level, node), None)
        found.extend(name_of(TreePlace(level, each), node) for each in labels)
    return tuple(found[:_MOST_VISITED])


def state_around(level: TreeNode, node: TreeNode) -> str:
    """Return the state of a container in which the one below it lies."""
    while node.parent is not level and node.parent is not None:
        node = node.parent
    return node.labels_from_parent[0]


def name_of(place: TreePlace, node: TreeNode) -> str:
    """Return a place by its label, or by its path where it is in another container."""
    if place.node is node:
        return place.label
    return '/'.join(('', *filter(None, (place.node.relative_path, place.label))))


def menu_of(node: TreeNode, record: StateRecord, visited: Sequence[str]) -> Iterator[OpenWay]:
    """Yield the ways on from a failure of a state. None of them is blocked yet.

    `visited`: the states before it, as `visited_before` returns them.
    """
    visit_min, here = _minutes_of_visit(node), record.label
    way = Way(WayKind.AGAIN, here, userdata=node.in_force.userdata, minutes=visit_min)
    again = JumpPath((), node, (TreePlace(node, here),))
    yield OpenWay(way, again)
    for wait_s in WAITS_S:
        minutes = visit_min + wait_s / 60.0
        yield OpenWay(way._replace(kind=WayKind.WAIT, wait_s=wait_s, minutes=minutes), again)
    specs = record.settings.preconditions
    if specs:
        minutes = visit_min * (1 + len(specs))
        yield OpenWay(way._replace(kind=WayKind.PREPARE, minutes=minutes), again)
    for kind, name, place in _goals(node, here, visited):
        jump_path = jump_path_to(node, place)
        if jump_path is not None:
            passed = visited[: visited.index(name) + 1] if name in visited else visited
            done = tuple(each for one in passed for each in _done_at(node, one))
            back = way._replace(
                kind=kind,
                target=name,
                back=len(passed),
                minutes=visit_min * (1 + len(done)),
                repeats=done,
            )
            yield OpenWay(back, jump_path)


def _goals(
    node: TreeNode, label: str, visited: Sequence[str]
) -> Iterator[Tuple[WayKind, str, TreePlace]]:
    """Yield where a step back may lead, each place once: 1, 2, 4... states back, to the starts."""
    top = levels_of(node)[-1]
    back = 1
    goals: List[Tuple[WayKind, str, Optional[TreePlace]]] = []
    while back <= len(visited):
        name = visited[back - 1]
        goals.append((WayKind.STEP_BACK, name, place_named(node, name)))
        back *= 2
    for kind, level in ((WayKind.START, node), (WayKind.TOP, top)):
        start = TreePlace(level, initial_label_of(level.machine))
        goals.append((kind, name_of(start, node), start))
    met = {label}
    for kind, name, place in goals:
        if name not in met and place is not None and place.node.has(place.label):
            met.add(name)
            yield kind, name, place


def _done_at(node: TreeNode, name: str) -> Iterator[str]:
    place = place_named(node, name)
    if place is not None:
        yield from _done_in(place, name)


def _done_in(place: TreePlace, name: str) -> Iterator[str]:
    """Yield a state if it has succeeded last, or what has succeeded in it if it is a machine."""
    visits = list(place.node.records.history.visits)
    last = next((each.result for each in reversed(visits) if each.state == place.label), None)
    if last is not VisitResult.SUCCESS:
        return
    state = states_of(place.node.machine)[place.label]
    below = node_of(state) if isinstance(state, smach.StateMachine) else None
    inner = [] if below is None else list(_done_below(below, name))
    yield from inner or [name]


def _done_below(node: TreeNode, name: str) -> Iterator[str]:
    for label in dict.fromkeys(visit.state for visit in list(node.records.history.visits)):
        if node.has(label):
            yield from _done_in(TreePlace(node, label), '{}/{}'.format(name, label))


def _minutes_of_visit(node: TreeNode) -> float:
    """Return how long a visit has taken in this trial, on average."""
    visits = sum(
        record.visits
        for each in nodes_of(node.top().machine)
        for record in each.records.by_label.values()
    )
    return node.tree.budget.time.now() / 60.0 / max(1, visits)
