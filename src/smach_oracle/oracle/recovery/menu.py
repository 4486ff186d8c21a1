"""Makes the menu of a failure: the ways on, from where the machine stands."""

from collections import deque
from typing import Collection, Iterator, List, Mapping, Optional, Sequence, Set, Tuple

import smach

from ..decision.ways import WAITS_S, Way, WayKind
from ..machine.jump_path import JumpPath, jump_path_to
from ..machine.nesting import records_of
from ..machine.places import TreePlace, direct_levels, name_of, place_named
from ..machine.site import route_of
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode, node_of
from ..records.visits import Visit, VisitResult
from ..settings.failing_outcomes import is_preempted
from ..smach_private import initial_label_of, states_of, transitions_of

Drawn = Mapping[str, Mapping[str, Optional[str]]]  # target by state and outcome

_MOST_VISITED = 64  # states, to which a step back may lead


def visited_before(node: TreeNode, label: str, since: int) -> Tuple[str, ...]:
    """Return the states that were visited before a state, the latest first, by name.

    They are those from which its author's transitions lead to it. Where it has succeeded before,
    they are those since, from which the machine cannot end well without it: what is farther back
    is of an earlier round, and what may end the rounds is not asked twice about one. Those of the
    containers above come last. Each is there once.

    :param since: number of visits after its failure.
    """
    found: List[str] = []
    for level in direct_levels(node):
        leading = set(leading_to(level, (label,)))
        visits = _visits_of(level)
        if level is node and since:
            del visits[-since:]
        numbers = range(len(visits), 0, -1)
        last = next((each for each in numbers if _has_succeeded(visits[each - 1], label)), 0)
        if last:
            del visits[:last]
            leading -= _ending_without(level, label)
        labels = dict.fromkeys(each.state for each in reversed(visits) if each.state in leading)
        found.extend(name_of(TreePlace(level, each), node) for each in labels)
        label = next(iter(level.labels_from_parent), '')  # of the state around, on the next level
    return tuple(found[:_MOST_VISITED])


def _has_succeeded(visit: Visit, label: str) -> bool:
    return visit.state == label and visit.result in (VisitResult.SUCCESS, VisitResult.SUPERSEDED)


def _ending_without(node: TreeNode, label: str) -> Set[str]:
    """Return the states from which the container may end well without a visit of a state."""
    last = [each for each in node.labels() if each != label and _may_end_well(node, each)]
    return {*last, *leading_to(node, last, around=label)}


def _may_end_well(node: TreeNode, label: str) -> bool:
    """Whether an outcome of a state leads to an end that is no failure and no preempt."""
    routes = (
        route_of(node.machine, label, outcome)
        for outcome in dict(transitions_of(node.machine).get(label, {}))
    )
    return any(
        route.target
        and not route.is_state
        and route.target not in node.in_force.failing
        and not is_preempted(route.target)
        for route in routes
    )


def leading_to(
    node: TreeNode, goals: Collection[str], around: str = '', drawn: Optional[Drawn] = None
) -> List[str]:
    """Return the states from which the author's transitions lead to some others, nearest first.

    `around`: the state that they do so without. `drawn`: the transitions, None: all of them.
    """
    drawn = transitions_of(node.machine) if drawn is None else drawn
    found = dict.fromkeys([*goals, around])
    waiting = deque(goals)
    while waiting:
        goal = waiting.popleft()
        for each in node.labels():
            if each not in found and goal in drawn.get(each, {}).values():
                found[each] = None
                waiting.append(each)
    return [each for each in found if each not in goals and each != around]


def menu_of(
    node: TreeNode, record: StateRecord, visited: Sequence[str]
) -> Iterator[Tuple[Way, JumpPath]]:
    """Yield the ways on from a failure of a state, and their jumps. None is blocked yet.

    `visited`: the states before it, as `visited_before` returns them.
    """
    visit_min, here = _minutes_of_visit(node), record.label
    way = Way(WayKind.AGAIN, here, userdata=node.in_force.userdata, minutes=visit_min)
    again = JumpPath((), node, (TreePlace(node, here),))
    yield way, again
    for wait_s in WAITS_S:
        minutes = visit_min + wait_s / 60.0
        yield Way(WayKind.WAIT, here, 0, wait_s, way.userdata, minutes), again
    specs = record.settings.preconditions
    if specs:
        minutes = visit_min * (1 + len(specs))
        yield Way(WayKind.PREPARE, here, userdata=way.userdata, minutes=minutes), again
    for kind, name, place in _goals(node, here, visited):
        jump_path = jump_path_to(node, place)
        if jump_path is not None:
            passed = visited[: visited.index(name) + 1]
            entered = [each for one in passed for each in _entered_at(node, one)]
            back = Way(
                kind,
                name,
                back=len(passed),
                userdata=jump_path.meeting_node.in_force.userdata,
                minutes=visit_min * (1 + len(entered)),
                repeats=tuple(each for each, has_succeeded in entered if has_succeeded),
            )
            yield back, jump_path


def _goals(
    node: TreeNode, label: str, visited: Sequence[str]
) -> Iterator[Tuple[WayKind, str, TreePlace]]:
    """Yield where a step back may lead, each place once: 1, 2, 4... states back, to the starts."""
    goals = [
        (WayKind.STEP_BACK, name)
        for back, name in enumerate(visited, 1)
        if not back & (back - 1)  # 1, 2, 4...
    ]
    for kind, level in ((WayKind.START, node), (WayKind.TOP, direct_levels(node)[-1])):
        start = name_of(TreePlace(level, initial_label_of(level.machine)), node)
        if start in visited:
            goals.append((kind, start))
    met = {label}
    for kind, name in goals:
        place = place_named(node, name)
        if name not in met and place is not None:
            met.add(name)
            yield kind, name, place


def _entered_at(node: TreeNode, name: str) -> Iterator[Tuple[str, bool]]:
    """Yield a state, or what was visited in it if it is a machine, and whether it has succeeded."""
    place = place_named(node, name)
    return iter(()) if place is None else _entered_in(place, name)


def _entered_in(place: TreePlace, name: str) -> Iterator[Tuple[str, bool]]:
    state = states_of(place.node.machine)[place.label]
    below = node_of(state) if isinstance(state, smach.StateMachine) else None
    inner = {} if below is None else dict.fromkeys(visit.state for visit in _visits_of(below))
    if below is None or not any(map(below.has, inner)):
        visits = (visit for visit in _visits_of(place.node) if visit.state == place.label)
        yield name, any(visit.result is VisitResult.SUCCESS for visit in visits)
        return
    for label in filter(below.has, inner):
        yield from _entered_in(TreePlace(below, label), '{}/{}'.format(name, label))


def _visits_of(node: TreeNode) -> List[Visit]:
    return list(node.records.history.visits)


def _minutes_of_visit(node: TreeNode) -> float:
    """Return how long a visit has taken in this trial, on average."""
    visits = sum(record.visits for record in records_of(node))
    return node.tree.budget.work_time.now() / 60.0 / max(1, visits)
