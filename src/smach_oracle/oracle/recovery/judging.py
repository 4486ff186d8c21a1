"""Judges how a state has ended: where its outcome leads, or what kind of failure it is."""

from functools import lru_cache, partial
from typing import Any, Callable, NamedTuple, Optional, Union

import smach
from smach_oracle.foreign import error_text, repr_of

from ..machine.nesting import items_under_way
from ..machine.resumed import Unfinished
from ..machine.tree_node import TreeNode
from ..records.events import FailureKind
from ..records.state_record import StateRecord
from .failure import (
    Failure,
    Route,
    failure_kind,
    is_registered,
    raised_error,
    route_of,
    traceback_of,
    unbound_text,
    unregistered_text,
)


class Overrun(NamedTuple):
    """Stands in place of the outcome of a state that overran its time limit, or still runs."""

    text: str


class HeldBack(NamedTuple):
    """Stands in place of the outcome of a state that was not executed, to not repeat it."""

    text: str


def judge(
    node: TreeNode, record: StateRecord, outcome: Any, error: Optional[Exception]
) -> Union[Route, Failure]:
    """Return where the outcome leads, or what kind of failure it is."""
    judged = _judge(node, record, outcome, error)
    if isinstance(judged, Route):
        return judged
    items = items_under_way(node)
    return judged._replace(text='; '.join(filter(None, (judged.text, items)))) if items else judged


def _judge(
    node: TreeNode, record: StateRecord, outcome: Any, error: Optional[Exception]
) -> Union[Route, Failure]:
    machine = node.machine
    label, state = record.label, machine._states[record.label]
    if error is not None:
        return Failure(
            label,
            FailureKind.EXCEPTION,
            '',
            error_text(error),
            None,
            _once(partial(raised_error, label, state, error)),
            traceback_of(error),
        )
    if isinstance(outcome, Overrun):
        return Failure(label, FailureKind.TIME_LIMIT, '', outcome.text, None)
    if isinstance(outcome, Unfinished):
        return _failure_before(node, label, outcome)
    if isinstance(outcome, HeldBack):
        return Failure(label, FailureKind.HELD_BACK, '', outcome.text, None)
    if not is_registered(state, outcome):
        text = unregistered_text(label, state, outcome)
        if node.branch is not None and isinstance(outcome, str):
            # Concurrences and Iterators go on with such an outcome
            return Failure(
                label, FailureKind.UNREGISTERED_OUTCOME, outcome, text, Route(outcome, False)
            )
        return Failure(
            label,
            FailureKind.UNREGISTERED_OUTCOME,
            outcome if isinstance(outcome, str) else '',
            text,
            None,
            _once(partial(smach.InvalidTransitionError, text)),
        )
    route = route_of(machine, label, outcome)
    kind = failure_kind(outcome, route, record.settings.failure_outcomes, node.in_force.failing)
    if kind is FailureKind.NOT_A_FAILURE:
        return route
    if route.target:
        return Failure(label, kind, outcome, _description(node, label, state), route)
    text = unbound_text(label, outcome, machine.get_registered_outcomes())
    return Failure(
        label, kind, outcome, text, route, _once(partial(smach.InvalidTransitionError, text))
    )


def _once(make: Callable[[], Exception]) -> Callable[[], Exception]:
    """Have an error made once: SMACH logs each that is made."""
    return lru_cache(maxsize=1)(make)


def _failure_before(node: TreeNode, label: str, before: Unfinished) -> Failure:
    """Return the failure of a visit that was begun before the program was stopped."""
    route = route_of(node.machine, label, before.outcome) if before.outcome else None
    error = None
    if route is None or not route.target:
        route = None
        if before.kind not in (
            FailureKind.INTERRUPTED,
            FailureKind.TIME_LIMIT,
            FailureKind.HELD_BACK,
        ):
            error = partial(smach.InvalidUserCodeError, '{}: {}'.format(label, before.text))
    return Failure(label, before.kind, before.outcome, before.text, route, error)


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
