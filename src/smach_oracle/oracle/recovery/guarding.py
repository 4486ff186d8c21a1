"""States that guard what runs beside them: as they fail, the others are to stop at once.

The author of a Concurrence says so by its `child_termination_cb`. It is asked as SMACH would ask it
if the branch ended now. A plain state that fails would end its branch. A machine is recovered
inside, since it has work to go on with. Only one that can end in no other way than by a failure has
none: it watches, and is asked about as a plain state is.
"""

from typing import TYPE_CHECKING, Any, NamedTuple, Optional

import smach

from ..machine.places import links_to
from ..machine.site import route_of
from ..machine.tree_node import TreeNode
from ..machine.workers import recall_preempts
from ..records.events import FailureKind
from ..settings.failing_outcomes import is_preempted
from ..settings.settings import StateSettings
from ..smach_private import child_termination_cb_of, lock_of, outcomes_so_far, states_of

if TYPE_CHECKING:
    from .failure import Failure


class _Place(NamedTuple):
    """A branch of a Concurrence."""

    concurrence: smach.Concurrence
    label: str


def keeps_authors_way(node: TreeNode, failure: 'Failure', settings: StateSettings) -> bool:
    """Whether a failure under way goes as without an oracle.

    Its author has drawn where it leads, or has others stop at it. To be called in the thread of the
    container, its lock held.
    """
    route = failure.route
    if route is not None and node.site.foresees(failure.outcome, route, failure.kind, settings):
        return True
    if failure.kind is FailureKind.TIME_LIMIT:  # no state overruns without an oracle
        return False
    place = _asked_place(node, settings)
    if place is None or (route is not None and route.is_state):
        return False
    outcome = route.target if route is not None and route.leads_on else None
    # without an oracle it would not have come to raise
    if outcome is None and node.execution.failures:
        return False
    return _stops_others(node, place, failure.state, outcome)


def may_stop_others(node: TreeNode, settings: StateSettings) -> bool:
    """Whether a `child_termination_cb` is asked as a state fails, and so ends the container."""
    return _asked_place(node, settings) is not None


def _asked_place(node: TreeNode, settings: StateSettings) -> Optional[_Place]:
    """Return the branch about which a `child_termination_cb` is asked, None where none is."""
    place = _place_of(node)
    is_asked = (
        place is not None
        and settings.author_recoveries != 'override'
        and child_termination_cb_of(place.concurrence) is not None
        and (not node.site.is_container or _only_watches(node))
    )
    return place if is_asked else None


def _place_of(node: TreeNode) -> Optional[_Place]:
    """Return the branch that a container is, None for any other container."""
    if not node.site.is_container:
        around, label = node.site.shown(), node.site.label
    elif len(node.labels_from_parent) > 1:
        link = list(links_to(node))[-1]
        around, label = link.outer_container, link.label
    else:
        return None
    return _Place(around, label) if isinstance(around, smach.Concurrence) else None


def _only_watches(node: TreeNode) -> bool:
    """Whether a machine can end by failures alone, or as it is preempted."""
    ends = {
        route.target
        for label in node.labels()
        for outcome in states_of(node.machine)[label].get_registered_outcomes()
        for route in (route_of(node.machine, label, outcome),)
        if route.leads_on and not route.is_state and not is_preempted(route.target)
    }
    return bool(ends) and all(each in node.in_force.failing for each in ends)


def _stops_others(node: TreeNode, place: _Place, state: str, outcome: Optional[str]) -> bool:
    """Whether others that still run would have to stop if the branch ended now.

    An error, for which `outcome` is None, stops them in any case.
    """
    machine = node.machine
    outcomes = {**outcomes_so_far(place.concurrence), place.label: outcome}
    running = {each for each in outcomes if outcomes[each] is None} - {place.label}
    if outcome is None or not running:
        return bool(running)
    callback: Any = child_termination_cb_of(place.concurrence)
    lock = lock_of(machine)
    lock.release()  # the callback may preempt the branches
    try:
        stopped = callback(outcomes)
        is_list = isinstance(stopped, (list, tuple, set, frozenset))
        return not running.isdisjoint(stopped) if is_list else bool(stopped)
    except BaseException:  # it raises once the branch has ended, and that stops them
        return True
    finally:
        lock.acquire()
        if machine.preempt_requested():  # the request has come after the end of the state
            recall_preempts(states_of(machine)[state])
