"""Makes the menu of a failure: the ways on, from where the machine stands."""

from collections import deque
from typing import Collection, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

import smach

from ..decision.ways import WAITS_S, Way, WayKind
from ..machine.jump_path import JumpPath, jump_path_to
from ..machine.nesting import nodes_of
from ..machine.places import TreePlace, is_direct, levels_above, place_named
from ..machine.site import route_of
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode, node_of
from ..records.visits import Visit, VisitResult
from ..settings.failing_outcomes import is_preempted
from ..smach_private import initial_label_of, states_of, transitions_of

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
    """Return the states that were visited before a state, the latest first, by name.

    They are those from which its author's transitions lead to it. Where it has succeeded before,
    they are those since, from which the machine cannot end well without it: what is farther back
    is of an earlier round, and what may end the rounds is not asked twice about one. Those of the
    containers above come last. Each is there once.

    :param since: number of visits after its failure.
    """
    found: List[str] = []
    for level in levels_of(node):
        goal = label if level is node else state_around(level, node)
        leading = set(leading_to(level, goal))
        visits = list(level.records.history.visits)
        if level is node and since:
            del visits[-since:]
        rounds = [number for number, visit in enumerate(visits, 1) if _has_succeeded(visit, goal)]
        if rounds:
            del visits[: rounds[-1]]
            leading -= _ending_without(level, goal)
        labels = dict.fromkeys(each.state for each in reversed(visits) if each.state in leading)
        found.extend(name_of(TreePlace(level, each), node) for each in labels)
    return tuple(found[:_MOST_VISITED])


def _has_succeeded(visit: Visit, label: str) -> bool:
    return visit.state == label and visit.result in (VisitResult.SUCCESS, VisitResult.SUPERSEDED)


def _ending_without(node: TreeNode, label: str) -> Set[str]:
    """Return the states from which the container may end well without a visit of a state."""
    ending: Set[str] = set()
    while True:
        more = {
            each
            for each in node.labels()
            if each != label and each not in ending and _may_lead_to(node, each, ending)
        }
        if not more:
            return ending
        ending |= more


def _may_lead_to(node: TreeNode, label: str, goals: Collection[str]) -> bool:
    """Whether an outcome of a state leads to one of some states, or to an end that is good."""
    for outcome in dict(transitions_of(node.machine).get(label, {})):
        route = route_of(node.machine, label, outcome)
        if route.is_state:
            if route.target in goals:
                return True
        elif route.target and not (
            route.target in node.in_force.failing or is_preempted(route.target)
        ):
            return True
    return False


def leading_to(node: TreeNode, label: str) -> List[str]:
    """Return the states from which the author's transitions lead to a state, the nearest first."""
    found, drawn = {label: None}, transitions_of(node.machine)
    waiting = deque(found)
    while waiting:
        goal = waiting.popleft()
        for each in node.labels():
            if each not in found and goal in drawn.get(each, {}).values():
                found[each] = None
                waiting.append(each)
    return list(found)[1:]


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
            passed = visited[: visited.index(name) + 1]
            entered = [each for one in passed for each in _entered_at(node, one)]
            back = way._replace(
                kind=kind,
                target=name,
                back=len(passed),
                userdata=jump_path.meeting_node.in_force.userdata,
                minutes=visit_min * (1 + len(entered)),
                repeats=tuple(each for each, has_succeeded in entered if has_succeeded),
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
        if name_of(start, node) in visited:
            goals.append((kind, name_of(start, node), start))
    met = {label}
    for kind, name, place in goals:
        if name not in met and place is not None and place.node.has(place.label):
            met.add(name)
            yield kind, name, place


def _entered_at(node: TreeNode, name: str) -> Iterator[Tuple[str, bool]]:
    place = place_named(node, name)
    if place is not None:
        yield from _entered_in(place, name)


def _entered_in(place: TreePlace, name: str) -> Iterator[Tuple[str, bool]]:
    """Yield a state, or what was visited in it if it is a machine, and whether it has succeeded."""
    state = states_of(place.node.machine)[place.label]
    below = node_of(state) if isinstance(state, smach.StateMachine) else None
    inner = [] if below is None else list(_entered_below(below, name))
    visits = list(place.node.records.history.visits)
    has_succeeded = any(
        each.state == place.label and each.result is VisitResult.SUCCESS for each in visits
    )
    yield from inner or [(name, has_succeeded)]


def _entered_below(node: TreeNode, name: str) -> Iterator[Tuple[str, bool]]:
    for label in dict.fromkeys(visit.state for visit in list(node.records.history.visits)):
        if node.has(label):
            yield from _entered_in(TreePlace(node, label), '{}/{}'.format(name, label))


def _minutes_of_visit(node: TreeNode) -> float:
    """Return how long a visit has taken in this trial, on average."""
    visits = sum(
        record.visits
        for each in nodes_of(node.top().machine)
        for record in each.records.by_label.values()
    )
    return node.tree.budget.work_time.now() / 60.0 / max(1, visits)
