"""Says what comes of going on from a place: to a policy, to a person, and where nobody answers.

All of them are told by the same functions, from the menu and from what is known of a jump path.
"""

from typing import Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple

from ..decision.sentence import going_would_repeat
from ..decision.ways import Way, WayKind
from ..machine.jump_path import (
    JumpPath,
    closed_in_words,
    jump_path_to,
    repeated_on,
    why_closed_on,
)
from ..machine.places import TreePlace, places_of
from ..machine.repeats import has_visited
from ..machine.tree_node import TreeNode
from .menu import menu_of, visited_before
from .recovery import Recovery
from .verdict import streak_of

# says why a level above is not to be disturbed by this failure, '' where it may be. It looks at the
# containers up to below the given one, None: at all
WhyNotAbove = Callable[[Optional[TreeNode]], str]


class Option(NamedTuple):
    """A place from which the machine can go on, and what comes of that.

    `closed`: why nobody can have it entered now, '' where one can. `repeats`: the states which
    would come again though they are not repeated by themselves.
    """

    jump_path: JumpPath
    closed: str
    repeats: Tuple[str, ...]

    @property
    def place(self) -> TreePlace:
        """Return the place."""
        return self.jump_path.entered_places[-1]


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
    if recovery.failure.still_runs and _is_own(recovery, way):  # that is to wait on
        return Option(way, '', ())
    return Option(way, why_closed_on(way), repeated_on(way))


def menu_on(recovery: Recovery) -> Iterator[OpenWay]:
    """Yield the ways of the menu, none of them blocked yet. A state that still runs has none."""
    if recovery.failure.still_runs:
        return
    option: Optional[Option] = None
    for way, jump_path in menu_of(recovery.node, recovery.record, visited_on(recovery)):
        if option is None or option.jump_path is not jump_path:  # several enter the failed state
            option = option_on(recovery, jump_path)
        yield OpenWay(way, option)


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
        ways.setdefault(option.place, way)
    for option in places_on(recovery):
        yield option, ways.get(option.place)


def _is_own(recovery: Recovery, way: JumpPath) -> bool:
    return way.entered_places[-1] == (recovery.node, recovery.record.label)


# -- why the machine does not go there by itself


def _why_blocked(recovery: Recovery, each: OpenWay, why_not_above: WhyNotAbove) -> str:
    """Say why a way of the menu is not open, '' where it is."""
    way, option = each
    path = option.jump_path
    return (
        (why_not_above(path.meeting_node) if path.left_containers else '')
        or why_repeats(recovery, option)
        # a wait is for what still runs
        or (way.kind is not WayKind.WAIT and why_closed(recovery, option))
        or (way.kind is WayKind.PREPARE and function_that_runs(recovery))
        or ''
    )


def why_closed(recovery: Recovery, option: Option) -> str:
    """Say that a place, or one on the way down, is closed, or '' where it is not."""
    if not option.closed:
        return ''
    return closed_in_words(option.jump_path, option.closed, named(recovery, option.jump_path))


def why_repeats(recovery: Recovery, option: Option) -> str:
    """Say what would be repeated if the machine went to a place by itself, or '' if nothing."""
    if not option.repeats:
        return ''
    target, place = named(recovery, option.jump_path), option.place
    if not has_visited(place.node, place.label):
        return 'this trial has not been in {}, and going there may repeat {}'.format(
            target, ', '.join(option.repeats)
        )
    return going_would_repeat(recovery.record.label, target, option.repeats)


def function_that_runs(recovery: Recovery) -> str:
    """Return which function among the preconditions was left behind and runs, '' for none."""
    workers = recovery.node.tree.workers
    for spec in recovery.record.settings.preconditions if workers.abandoned else ():
        for name, function in spec.functions():
            why = workers.blocked(function)
            if why:
                return '{} {}'.format(name, why)
    return ''


def named(recovery: Recovery, way: JumpPath) -> str:
    """Return the label of a place, or its path where it is in another container."""
    place = way.entered_places[-1]
    return place.label if place.node is recovery.node else place.path
