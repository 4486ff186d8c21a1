"""The end of a state: where its outcome leads, or what kind of failure it is.

Without an oracle an unsuccessful outcome leads to a state of the author's or ends the machine
(paper, section VI-A). A later state may report a failure: its author goes on from WORK, which has
failed, to REPORT, and REPORT leads to `failed`. Then the failure is that of WORK.
"""

import traceback
from functools import lru_cache, partial
from typing import Callable, Dict, NamedTuple, Optional, Set, Tuple, Union, cast

import smach
from smach_common.foreign import error_text, repr_of

from ..asking.question import names
from ..decision.policy import FailureContext
from ..identity import is_hashable
from ..machine.nesting import gave_up_in, items_under_way, nodes_in
from ..machine.places import failure_context
from ..machine.resumed import Unfinished
from ..machine.site import Route, failure_kind, judged_at, route_of
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..machine.workers import Overrun
from ..records.events import EventKind, FailureKind
from ..records.visits import Visit, VisitResult
from ..settings.failing_outcomes import is_preempted, name_text
from ..smach_private import states_of
from .guarding import may_stop_others
from .stop import winds_down


class Failure(NamedTuple):
    """One failure of a state."""

    state: str
    kind: FailureKind
    outcome: str = ''
    text: str = ''  # exception text, reasons
    route: Optional[Route] = None  # where the outcome would have led, or None where it raises
    # makes what the machine raises if the oracle gives up
    error: Optional[Callable[[], Exception]] = None
    details: str = ''  # the traceback
    # where an earlier failure would have led, in place of what is raised
    earlier_route: Optional[Route] = None

    @property
    def is_held_back(self) -> bool:
        """Whether the state was not executed, since it is not to be repeated: no failure."""
        return self.kind is FailureKind.HELD_BACK

    @property
    def still_runs(self) -> bool:
        """Whether the state has not ended, and a person is asked about it: no failure either."""
        return self.kind is FailureKind.STILL_RUNNING

    @property
    def is_counted(self) -> bool:
        """Whether it is in the rate and in the history, from which it may be taken back."""
        return self.kind not in (FailureKind.HELD_BACK, FailureKind.INTERRUPTED)

    @property
    def why_none(self) -> str:
        """Return what is to be said of the state where it has not failed, '' where it has."""
        if self.kind is FailureKind.INTERRUPTED:
            return 'has no result, since ' + self.text.partition(':')[0]
        return self.text if self.is_held_back else ''


def is_registered(state: smach.State, outcome: object) -> bool:
    """Whether a state has registered what it has returned, which may be anything."""
    try:
        return bool(outcome in state.get_registered_outcomes())
    except Exception:  # an array, or an object that compares in its own way
        return False


def raised_error(label: str, state: smach.State, err: Exception) -> Exception:
    """Return the error with which a machine passes on what a state raised.

    Its text holds the traceback.
    """
    if isinstance(err, smach.InvalidUserCodeError):
        return err
    wrapped: Exception = smach.InvalidUserCodeError(
        'Could not execute state {!r} of type {}: {}'.format(
            label, repr_of(state), traceback_of(err)
        )
    )
    wrapped.__cause__ = err
    return wrapped


def traceback_of(err: Exception) -> str:
    """Return the traceback as Python prints it."""
    return ''.join(traceback.format_exception(type(err), err, err.__traceback__))


# -- judging


class HeldBack(NamedTuple):
    """Stands in place of the outcome of a state that was not executed, to not repeat it."""

    text: str


def judge(
    node: TreeNode, record: StateRecord, outcome: object, error: Optional[Exception]
) -> Union[Route, Failure]:
    """Return where the outcome leads, or what kind of failure it is."""
    judged = _judge(node, record, outcome, error)
    if isinstance(judged, Route):
        return judged
    items = items_under_way(node)
    if judged.text.endswith(items):  # it was told before the program was stopped
        return judged
    return judged._replace(text='; '.join(filter(None, (judged.text, items))))


def _judge(
    node: TreeNode, record: StateRecord, outcome: object, error: Optional[Exception]
) -> Union[Route, Failure]:
    machine = node.machine
    label, state = record.label, states_of(machine)[record.label]
    if error is not None:
        return Failure(
            label,
            FailureKind.EXCEPTION,
            text=_what_was_raised(error, state),
            error=_once(partial(raised_error, label, state, error)),
            details=traceback_of(error),
        )
    if isinstance(outcome, Overrun):
        return Failure(label, FailureKind.TIME_LIMIT, text=outcome.text)
    if isinstance(outcome, Unfinished):
        return _failure_before(node, label, outcome)
    if isinstance(outcome, HeldBack):
        return Failure(label, FailureKind.HELD_BACK, text=outcome.text)
    if not is_registered(state, outcome):
        text = 'State {!r} of type {} returned {}; its registered outcomes are {}'.format(
            label, repr_of(state), repr_of(outcome), names(state.get_registered_outcomes())
        )
        told = outcome if isinstance(outcome, str) else ''
        failure = Failure(label, FailureKind.UNREGISTERED_OUTCOME, told, text)
        # a Concurrence takes it as it is, an Iterator, too
        if outcome is not None and is_hashable(outcome) and not node.site.is_container:
            return failure._replace(route=Route(cast('str', outcome), False))
        return failure._replace(error=_once(partial(smach.InvalidTransitionError, text)))
    outcome = cast('str', outcome)
    route = route_of(machine, label, outcome)
    kind = failure_kind(outcome, route, record.settings, node.in_force.failing)
    if kind is FailureKind.NOT_A_FAILURE:
        return route
    if route.leads_on and _ended_as_intended(state):
        return route
    if route.leads_on:
        text = _description(node, label, state) or _failed_branches(state)
        return Failure(label, kind, outcome, text, route)
    text = (
        'Outcome {!r} of state {!r} has no transition to a state or a container outcome; '
        'the container has {}'.format(outcome, label, names(machine.get_registered_outcomes()))
    )
    unbound = _once(partial(smach.InvalidTransitionError, text))
    return Failure(label, kind, outcome, text, route, unbound)


def _what_was_raised(error: BaseException, state: smach.State) -> str:
    """Return an error in words, with that of a state by which a Concurrence raises."""
    first, text = error, error_text(error)
    while isinstance(first, smach.InvalidStateError) and first.__cause__ is not None:
        first = first.__cause__
    why = _failed_branches(state) or ('' if first is error else error_text(first))
    return '{} ({})'.format(text, why) if why else text


def _failed_branches(state: smach.State) -> str:
    """Say how branches that may have others stop have failed: nobody was asked about them."""
    told = []
    for node in nodes_in(state):
        latest = node.records.history.latest()[-1:]
        if not any(
            visit.result is VisitResult.FAILURE and node.has(visit.state) for visit in latest
        ):
            continue
        record = node.record(latest[0].state)
        if may_stop_others(node, record.settings) and record.last_failure is not None:
            _, outcome, text = record.last_failure
            how = '{} ({})'.format(outcome, text) if outcome and text else text or outcome
            path = '/'.join((*node.labels_from_parent[1:], record.label))
            told.append('{} failed: {}'.format(path, how))
    return '; '.join(told)


def _ended_as_intended(state: smach.State) -> bool:
    """Whether a container in a state has ended by an outcome that its author means so."""
    for node in nodes_in(state):
        for visit in list(node.records.history.visits)[-1:]:
            within = states_of(node.machine).get(visit.state)
            if (
                visit.result is VisitResult.SUCCESS
                and within is not None
                and not route_of(node.machine, visit.state, visit.outcome).is_state
                and (
                    name_text(visit.outcome) in node.settings_of(visit.state).intended_outcomes
                    or _ended_as_intended(within)
                )
            ):
                return True
    return False


def _once(make: Callable[[], Exception]) -> Callable[[], Exception]:
    """Have an error made once: SMACH logs each that is made."""
    return lru_cache(maxsize=1)(make)


def _failure_before(node: TreeNode, label: str, before: Unfinished) -> Failure:
    """Return the failure of a visit that was begun before the program was stopped."""
    failure = Failure(label, before.kind, before.outcome, before.text)
    if before.outcome != '':
        route = route_of(node.machine, label, before.outcome)
        if route.leads_on:
            return failure._replace(route=route)
    raises_none = (FailureKind.INTERRUPTED, FailureKind.TIME_LIMIT, FailureKind.HELD_BACK)
    if before.kind in raises_none:
        return failure
    text = '{}: {}'.format(label, before.text)
    return failure._replace(error=partial(smach.InvalidUserCodeError, text))


def _description(node: TreeNode, label: str, state: smach.State) -> str:
    try:
        return node.tree.describe_failure(state)
    except Exception as err:  # it looks into states of any make
        smach.logwarn(
            '{}/{}: cannot say more of its failure: {}'.format(node.path, label, repr_of(err))
        )
        return ''


def with_earlier_end(node: TreeNode, failure: Failure) -> Failure:
    """Have a failure that raises end the container as an earlier one would have.

    Without an oracle the container would have ended there. So it is in the same execution, as long
    as the state of the earlier one has not succeeded since.

    :param failure: its visit is the latest one. The author has not foreseen it.
    """
    node.execution.failures += 1
    if failure.error is None or (failure.route is not None and failure.route.leads_on):
        return failure
    visits = node.records.history.latest()
    ends: Dict[str, Route] = {}
    if not node.site.is_container:  # it has those of earlier items, too
        visits = visits[-node.execution.failures :]
    for visit in visits:
        if visit.result in (VisitResult.SUCCESS, VisitResult.SUPERSEDED):
            ends.pop(visit.state, None)
        elif visit.result is VisitResult.FAILURE and node.has(visit.state):
            route, kind = judged_at(node, visit.state, visit.outcome)
            settings = node.settings_of(visit.state)
            is_failure = route.leads_on and kind is not FailureKind.NOT_A_FAILURE
            if is_failure and not node.site.foresees(visit.outcome, route, kind, settings):
                ends.setdefault(visit.state, route)
    return failure._replace(earlier_route=next(iter(ends.values()), None))


def in_words(failure: Failure) -> str:
    """Say in one line what went wrong."""
    if failure.outcome and failure.text and failure.route is not None:
        return '{} ({})'.format(failure.outcome, failure.text)
    return failure.text or failure.outcome


def tell_failure(
    node: TreeNode, record: StateRecord, failure: Failure, continuous: bool = False
) -> None:
    """Tell the observers, with the rate of now: without this failure."""
    node.emit_rated(
        EventKind.FAILURE,
        record,
        outcome=failure.outcome,
        failure_kind=int(failure.kind),
        continuous=continuous,
        text=failure.text,
    )


# -- failures that a later state reports


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
    context = _context_then(node, failed, visits[:place])
    return Announced(failure, route, context, len(visits) - place)


def _context_then(node: TreeNode, failed: StateRecord, before: Tuple[Visit, ...]) -> FailureContext:
    """Return what the visits before the failure, which is counted, say about it."""
    context = failure_context(node, failed, is_counted=True)
    states = (node.record(visit.state) for visit in reversed(before) if node.has(visit.state))
    unconditioned = next((each.label for each in states if not each.has_preconditions), None)
    context = context._replace(unconditioned=unconditioned)
    if node.records.history.failure_of(failed.label) is not None:
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
    is_meant = name_text(outcome) in record.settings.intended_outcomes
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
    return node.site.foresees(visit.outcome, route, kind, settings)
