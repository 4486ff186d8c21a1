"""The end of a state: where its outcome leads, or what kind of failure it is.

Without an oracle an unsuccessful outcome leads to a state of the author's or ends the machine
(paper, section VI-A).
"""

import traceback
from functools import lru_cache, partial
from typing import Callable, NamedTuple, Optional, Union, cast

import smach
from smach_common.foreign import error_text, repr_of

from ..asking.question import names
from ..machine.nesting import items_under_way, nodes_in
from ..machine.resumed import Unfinished
from ..machine.site import Route, failure_kind, route_of
from ..machine.state_record import RateReading, StateRecord
from ..machine.tree_node import TreeNode
from ..machine.workers import Overrun
from ..records.events import EventKind, FailureKind
from ..records.visits import VisitResult
from ..settings.failing_outcomes import is_preempted
from ..smach_private import states_of


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


def visit_result(outcome: str, stopping: bool) -> VisitResult:
    """Return how a visit counts that did not fail.

    `stopping`: a preempt or a shutdown is under way.
    """
    if stopping or is_preempted(outcome):
        return VisitResult.PREEMPTED
    return VisitResult.SUCCESS


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
    return judged._replace(text='; '.join(filter(None, (judged.text, items)))) if items else judged


def _judge(
    node: TreeNode, record: StateRecord, outcome: object, error: Optional[Exception]
) -> Union[Route, Failure]:
    machine = node.machine
    label, state = record.label, states_of(machine)[record.label]
    if error is not None:
        return Failure(
            label,
            FailureKind.EXCEPTION,
            text=error_text(error),
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
        told = outcome if isinstance(outcome, str) else None
        failure = Failure(label, FailureKind.UNREGISTERED_OUTCOME, told or '', text)
        if told is not None and not node.site.is_container:
            return failure._replace(route=Route(told, False))
        return failure._replace(error=_once(partial(smach.InvalidTransitionError, text)))
    outcome = cast(str, outcome)
    route = route_of(machine, label, outcome)
    kind = failure_kind(outcome, route, record.settings, node.in_force.failing)
    if kind is FailureKind.NOT_A_FAILURE:
        return route
    if route.target and _ended_as_intended(state):
        return route
    if route.target:
        return Failure(label, kind, outcome, _description(node, label, state), route)
    text = (
        'Outcome {!r} of state {!r} has no transition to a state or a container outcome; '
        'the container has {}'.format(outcome, label, names(machine.get_registered_outcomes()))
    )
    unbound = _once(partial(smach.InvalidTransitionError, text))
    return Failure(label, kind, outcome, text, route, unbound)


def _ended_as_intended(state: smach.State) -> bool:
    """Whether a container in a state has ended by an outcome that its author means so."""
    for node in nodes_in(state) if isinstance(state, smach.Container) else ():
        for visit in list(node.records.history.visits)[-1:]:
            within = states_of(node.machine).get(visit.state)
            if (
                visit.result is VisitResult.SUCCESS
                and within is not None
                and not route_of(node.machine, visit.state, visit.outcome).is_state
                and (
                    visit.outcome in node.settings_of(visit.state).intended_outcomes
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
    route = route_of(node.machine, label, before.outcome) if before.outcome else Route('', False)
    if route.target:
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


def in_words(failure: Failure) -> str:
    """Say in one line what went wrong."""
    if failure.outcome and failure.text and failure.route is not None:
        return '{} ({})'.format(failure.outcome, failure.text)
    return failure.text or failure.outcome


def tell_failure(
    node: TreeNode,
    record: StateRecord,
    failure: Failure,
    continuous: bool = False,
    reading: Optional[RateReading] = None,
) -> None:
    """Tell the observers. `reading`: of the rate, without this failure. None: that of now."""
    node.emit_rated(
        EventKind.FAILURE,
        record,
        reading,
        outcome=failure.outcome,
        failure_kind=int(failure.kind),
        continuous=continuous,
        text=failure.text,
    )
