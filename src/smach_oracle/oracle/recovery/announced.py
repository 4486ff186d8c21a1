"""Failures that a later state reports: their author goes on from them, and ends in a failure.

WORK fails, its author leads to REPORT, and REPORT leads to `failed`. The failure is that of WORK.
"""

from typing import NamedTuple, Optional, Set, Tuple, Union

from ..decision.policy import FailureContext
from ..machine.nesting import gave_up_in
from ..machine.places import failure_context
from ..machine.site import Route, failure_kind, route_of
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..records.events import FailureKind
from ..records.visits import Visit, VisitResult
from ..settings.failing_outcomes import is_preempted
from ..smach_private import states_of
from .failure import Failure
from .stop import winds_down


class Announced(NamedTuple):
    """An earlier failure of another state, with what the visits say about it."""

    failure: Failure
    route: Route  # where the state leads that reports it
    context: FailureContext
    visits_since: int


def announced_by(
    node: TreeNode, record: StateRecord, outcome: str, judged: Union[Route, Failure]
) -> Optional[Announced]:
    """Return the failure that the end of a state reports, None where it reports none.

    It is the latest one in this execution of the container after which the author's way was kept.

    :param judged: the end of the state by itself. Its visit is not added yet.
    """
    route = _to_failing_end(node, record, outcome, judged)
    if route is None or winds_down(node) or gave_up_in(states_of(node.machine)[record.label]):
        return None
    visits = node.records.history.latest()
    place = _latest_kept(node, record.label, visits)
    if place is None:
        return None
    failed = node.record(visits[place].state)
    text = '{} has ended with {} since, which leads to {}'
    failure = Failure(
        failed.label,
        FailureKind.FAILING_OUTCOME,
        visits[place].outcome,
        text.format(record.label, outcome, route.target),
        route,
    )
    context = _context(node, failed, visits[:place])
    return Announced(failure, route, context, len(visits) - place)


def _context(node: TreeNode, failed: StateRecord, before: Tuple[Visit, ...]) -> FailureContext:
    """Return what the visits before the failure, which is counted, say about it."""
    context = failure_context(node, failed, is_counted=True)
    states = (node.record(visit.state) for visit in reversed(before) if node.has(visit.state))
    unconditioned = next((each.label for each in states if not each.has_preconditions), None)
    context = context._replace(unconditioned=unconditioned)
    if node.records.history.recalls_failure_of(failed.label):
        return context
    succeeded = (
        visit.state
        for visit in reversed(before)
        if visit.result is VisitResult.SUCCESS and visit.state != failed.label
    )
    return context._replace(succeeded_before=next(succeeded, None))


def _to_failing_end(
    node: TreeNode, record: StateRecord, outcome: str, judged: Union[Route, Failure]
) -> Optional[Route]:
    """Return where an outcome leads that fails by its target alone, None for any other.

    A success may lead there, too. A preempt reports nothing.
    """
    failing = node.in_force.failing
    if isinstance(judged, Failure):
        falls_through = judged.kind is FailureKind.FELL_THROUGH and outcome not in failing
        return judged.route if falls_through and not is_preempted(outcome) else None
    if judged.is_state or judged.target not in failing or is_preempted(outcome):
        return None
    is_meant = outcome in record.settings.intended_outcomes
    return judged if failing.excuse(outcome) and not is_meant else None


def _latest_kept(node: TreeNode, told_by: str, visits: Tuple[Visit, ...]) -> Optional[int]:
    """Return the number of the visit, which is the latest one of its state."""
    later: Set[str] = set()
    for number in reversed(range(len(visits))):
        visit = visits[number]
        if not node.has(visit.state) or visit.result is VisitResult.PREEMPTED:
            continue
        route = route_of(node.machine, visit.state, visit.outcome)
        has_failed = visit.result is VisitResult.FAILURE
        if not has_failed and not route.is_state and visit.state != told_by:
            return None  # it has reported what was before, and the oracle has gone on
        if has_failed and visit.state not in later and _is_kept(node, visit, route):
            return number if visit.state != told_by else None
        later.add(visit.state)
    return None


def _is_kept(node: TreeNode, visit: Visit, route: Route) -> bool:
    settings = node.settings_of(visit.state)
    kind = failure_kind(visit.outcome, route, settings, node.in_force.failing)
    return kind is FailureKind.FAILING_OUTCOME and node.site.foresees(
        node, visit.outcome, route, kind, settings
    )
