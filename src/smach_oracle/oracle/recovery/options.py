"""Says what comes of going on from a place: to a policy, to a person, and where nobody answers.

All of them are told by the same functions, from the menu of the ways on from where the machine
stands, and from what is known of a jump path.
"""

from collections import deque
from typing import (
    Callable,
    Collection,
    Dict,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Set,
    Tuple,
)

from ..decision.sentence import going_would_repeat
from ..decision.ways import WAITS_S, Way, WayKind
from ..machine.nesting import records_of
from ..machine.places import (
    JumpPath,
    TreePlace,
    direct_levels,
    jump_path_to,
    name_of,
    place_named,
    places_of,
    repeated_on,
    why_closed_on,
)
from ..machine.repeats import has_visited
from ..machine.site import route_of
from ..machine.tree_node import TreeNode, node_of
from ..records.visits import Visit, VisitResult
from ..settings.failing_outcomes import is_preempted
from ..settings.preconditions import PreconditionKind
from ..smach_private import initial_label_of, states_of, transitions_of
from .recovery import Recovery
from .verdict import Foreseen, streak_of

# says why a level above is not to be disturbed by this failure, '' where it may be. It looks at the
# containers that a way leaves, None: at all
WhyNotAbove = Callable[[Optional[JumpPath]], Optional[Foreseen]]


class Option(NamedTuple):
    """A place from which the machine can go on, and what comes of that.

    `closed`: why nobody can have it entered now, '' where one can. `repeats`: the states which
    would come again though they are not repeated by themselves.
    """

    jump_path: JumpPath
    closed: str
    repeats: Tuple[str, ...]


class OpenWay(NamedTuple):
    """A way of the menu, and the option that it is."""

    way: Way
    option: Option

    def blocked_by(self, why: str) -> 'OpenWay':
        """Return it with why it is not open, '' where it is."""
        return (
            self
            if why == self.way.blocked
            else OpenWay(self.way._replace(blocked=why), self.option)
        )


def option_on(recovery: Recovery, way: JumpPath) -> Option:
    """Return what comes of going to a place, from where the machine stands."""
    if (
        recovery.failure.still_runs and named(recovery, way) == recovery.record.label
    ):  # that is to wait on
        return Option(way, '', ())
    return Option(way, why_closed_on(way), repeated_on(way))


def visited_on(recovery: Recovery) -> Tuple[str, ...]:
    """Return the states to which the menu may lead back: those before the streak's first failure.

    They are told by name, the latest first.
    """
    node, record = recovery.node, recovery.record
    streak = streak_of(node, record)
    if streak is not None:
        return streak.visited
    return visited_before(node, record.label, recovery.occasion.visits_since)


def ways_on(recovery: Recovery, why_not_above: WhyNotAbove) -> List[OpenWay]:
    """Return the menu as a policy is shown it: each way says why it is blocked, if it is."""
    return [
        each.blocked_by(_why_blocked(recovery, each, why_not_above)) for each in menu_on(recovery)
    ]


def places_on(recovery: Recovery) -> Iterator[Option]:
    """Yield the places of the tree to which a person may send the machine, its own first."""
    for place in places_of(recovery.node):
        jump_path = jump_path_to(recovery.node, place)
        if jump_path is not None:
            yield option_on(recovery, jump_path)


def choices_on(recovery: Recovery) -> Iterator[Tuple[Option, Optional[Way]]]:
    """Yield the same, each with the way of the menu that leads there, None where no way does.

    Where more than one does, it is the first: of those that enter the failed state, the one that
    does nothing before.
    """
    ways: Dict[TreePlace, Way] = {}
    for way, option in menu_on(recovery):
        ways.setdefault(option.jump_path.place, way)
    for option in places_on(recovery):
        yield option, ways.get(option.jump_path.place)


# -- why the machine does not go there by itself


def _why_blocked(recovery: Recovery, each: OpenWay, why_not_above: WhyNotAbove) -> str:
    """Say why a way of the menu is not open, '' where it is."""
    way, option = each
    foreseen = why_not_above(option.jump_path) if option.jump_path.left_containers else None
    return (
        (foreseen.text if foreseen is not None else '')
        or why_repeats(recovery, option)
        # a wait is for what still runs
        or (way.kind is not WayKind.WAIT and why_closed(recovery, option))
        or (way.kind is WayKind.PREPARE and function_that_runs(recovery))
        or ''
    )


def why_closed(recovery: Recovery, option: Option) -> str:
    """Say that a place, or one on the way down, is closed, or '' where it is not."""
    way, closed = option.jump_path, option.closed
    # of what lies on the way down it names the path
    if not closed or closed.startswith(way.meeting_node.path):
        return closed
    return '{} {}'.format(named(recovery, way), closed)


def why_repeats(recovery: Recovery, option: Option) -> str:
    """Say what would be repeated if the machine went to a place by itself, or '' if nothing."""
    if not option.repeats:
        return ''
    target, place = named(recovery, option.jump_path), option.jump_path.place
    if not has_visited(place.node, place.label):
        return 'this trial has not been in {}, and going there may repeat {}'.format(
            target, ', '.join(option.repeats)
        )
    return going_would_repeat(recovery.record.label, target, option.repeats)


def function_that_runs(recovery: Recovery) -> str:
    """Return which function among the preconditions was left behind and runs, '' for none."""
    workers = recovery.node.tree.workers
    for spec in recovery.record.settings.preconditions:
        for function in spec.of_kind(PreconditionKind.CALLABLE):
            why = workers.blocked(function.target)
            if why:
                return '{} {}'.format(function.name, why)
    return ''


def named(recovery: Recovery, way: JumpPath) -> str:
    """Return the label of a place, or its path where it is in another container."""
    place = way.place
    return place.label if place.node is recovery.node else place.path


Drawn = Mapping[str, Mapping[str, Optional[str]]]  # target by state and outcome

_MOST_VISITED = 64  # states, to which a step back may lead


# -- the menu


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
        visits = [*level.records.history.latest()]
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
        route.leads_on
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


def menu_on(recovery: Recovery) -> Iterator[OpenWay]:
    """Yield the ways of the menu, none of them blocked yet. A state that still runs has none."""
    if recovery.failure.still_runs:
        return
    node, record, visited = recovery.node, recovery.record, visited_on(recovery)
    visits = sum(each.visits for each in records_of(node))
    visit_min = node.tree.budget.work_time.now() / 60.0 / max(1, visits)
    here = record.label
    again = option_on(recovery, JumpPath((), node, (TreePlace(node, here),)))
    way = Way(WayKind.AGAIN, here, userdata=node.in_force.userdata, minutes=visit_min)
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
            places = [(one, place_named(node, one)) for one in passed]
            entered = [each for one, there in places if there for each in _entered_in(there, one)]
            back = Way(
                kind,
                name,
                back=len(passed),
                userdata=jump_path.meeting_node.in_force.userdata,
                minutes=visit_min * (1 + len(entered)),
                repeats=tuple(each for each, has_succeeded in entered if has_succeeded),
            )
            yield OpenWay(back, option_on(recovery, jump_path))


def _goals(
    node: TreeNode, label: str, visited: Sequence[str]
) -> Iterator[Tuple[WayKind, str, Optional[TreePlace]]]:
    """Yield where a step back may lead, each place once: 1, 2, 4... states back, to the starts.

    The place is None where it is gone.
    """
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
        if name not in met:
            met.add(name)
            yield kind, name, place_named(node, name)


def _entered_in(place: TreePlace, name: str) -> Iterator[Tuple[str, bool]]:
    """Yield a state, or what was visited in it if it is a machine, and whether it has succeeded."""
    below = node_of(states_of(place.node.machine)[place.label])
    inner: List[TreePlace] = []
    if below is not None:
        visited = dict.fromkeys(visit.state for visit in below.records.history.latest())
        inner = [TreePlace(below, label) for label in visited if below.has(label)]
    if not inner:
        visits = (
            visit for visit in place.node.records.history.latest() if visit.state == place.label
        )
        yield name, any(visit.result is VisitResult.SUCCESS for visit in visits)
        return
    for each in inner:
        yield from _entered_in(each, '/'.join((name, each.label)))
