"""The end of a state: where it leads, whether it is a failure, how the container would end.

Without an oracle an unsuccessful outcome leads to a state of the author's or ends the machine
(paper, section VI-A).
"""

import traceback
from typing import Any, Callable, NamedTuple, Optional, Tuple

import smach
from smach_oracle.foreign import repr_of

from ..asking.question import names
from ..machine.protocols import Machine
from ..machine.tree_node import TreeNode
from ..records.events import FailureKind
from ..records.visits import VisitResult
from ..settings.failing_outcomes import PREEMPTED, FailingNames, is_preempted


class Route(NamedTuple):
    """The target of an outcome, as the machine's author drew it."""

    target: str  # a state, a container outcome, or '' where it leads nowhere
    is_state: bool


class Failure(NamedTuple):
    """One failure of a state."""

    state: str
    kind: FailureKind
    outcome: str  # '' where there is none
    text: str  # exception text, reasons
    route: Optional[Route]  # where the outcome would have led, or None where it raises
    # makes what the machine raises if the oracle gives up
    error: Optional[Callable[[], Exception]] = None
    details: str = ''  # the traceback

    @property
    def is_held_back(self) -> bool:
        """Whether the state was not executed, since it is not to be repeated: no failure."""
        return self.kind is FailureKind.HELD_BACK

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


class ContainerEnding(NamedTuple):
    """The way a container would end, or go on, without an oracle: exactly one is set."""

    state: Optional[str] = None
    outcome: Optional[str] = None
    error: Optional[Exception] = None
    obeys: bool = False  # `state` is what the author drew after `preempted`: a preempt ends there


def is_registered(state: smach.State, outcome: object) -> bool:
    """Whether a state has registered what it has returned, which may be anything."""
    try:
        return bool(outcome in state.get_registered_outcomes())
    except Exception:  # an array, or an object that compares in its own way
        return False


def route_of(machine: Machine, label: str, outcome: str) -> Route:
    """Follow an outcome of a state.

    It leads to a state, to a container outcome by its target's or its own name, or nowhere.
    """
    transitions = machine._transitions.get(label) or {}
    if outcome not in transitions:  # registered after the state was added: nothing was drawn for it
        return Route('', False)
    target = transitions[outcome]
    if target is not None and target in machine._states:
        return Route(target, True)
    container_outcomes = machine.get_registered_outcomes()
    for name in (target, outcome):
        if name is not None and name in container_outcomes:
            return Route(name, False)
    return Route('', False)


def failure_kind(
    outcome: str, route: Route, listed: Tuple[str, ...], failing: FailingNames
) -> FailureKind:
    """Classify a registered outcome, without regard to who recovers from it."""
    if outcome in listed:
        return FailureKind.FAILING_OUTCOME
    if route.is_state:
        return FailureKind.FAILING_OUTCOME if outcome in failing else FailureKind.NOT_A_FAILURE
    if not route.target:
        return FailureKind.UNREGISTERED_OUTCOME
    if route.target in failing:
        return FailureKind.FELL_THROUGH
    return FailureKind.FAILING_OUTCOME if outcome in failing else FailureKind.NOT_A_FAILURE


def author_recovers(
    outcome: str, route: Route, kind: FailureKind, listed: Tuple[str, ...], author_recoveries: str
) -> bool:
    """Whether the author's own transition from this failing outcome stays.

    It does where it leads to another state, or, for an outcome that only sounds like a failure, to
    a container outcome that does not.
    """
    if author_recoveries == 'override' or kind is not FailureKind.FAILING_OUTCOME:
        return False
    return route.is_state or outcome not in listed


def visit_result(outcome: str, kind: FailureKind, stopping: bool) -> VisitResult:
    """Return how a visit counts that ended with `outcome`.

    `stopping`: a preempt or a shutdown is under way.
    """
    if stopping or (is_preempted(outcome) and kind is FailureKind.NOT_A_FAILURE):
        return VisitResult.PREEMPTED
    return VisitResult.SUCCESS if kind is FailureKind.NOT_A_FAILURE else VisitResult.FAILURE


def natural_ending(
    failure: Failure, container_outcomes: Tuple[str, ...], failing: FailingNames
) -> ContainerEnding:
    """Return how the failure would have ended the container without an oracle.

    An overrun has no such ending, since the state would still run: the container's own failing
    outcome, else an error.
    """
    if failure.route is not None and failure.route.target:
        route = failure.route
        return (
            ContainerEnding(state=route.target)
            if route.is_state
            else ContainerEnding(outcome=route.target)
        )
    if failure.error is not None:
        return ContainerEnding(error=failure.error())
    for word in failing.words:
        if word in container_outcomes:
            return ContainerEnding(outcome=word)
    for outcome in sorted(container_outcomes, key=str):
        if outcome in failing:
            return ContainerEnding(outcome=outcome)
    return ContainerEnding(
        error=smach.InvalidUserCodeError('State {!r} {}'.format(failure.state, failure.text))
    )


def route_at_preempt(machine: Machine, label: str) -> Route:
    """Follow the outcome `preempted` of a state that a preempt ends before it has done anything.

    It leads nowhere where the state has no such outcome, or where it leads to the state itself.
    """
    registered = machine._states[label].get_registered_outcomes()
    outcome = next((each for each in registered if is_preempted(each)), None)
    route = Route('', False) if outcome is None else route_of(machine, label, outcome)
    return Route('', False) if route.is_state and route.target == label else route


def preempted_ending(node: TreeNode, failure: Failure) -> ContainerEnding:
    """Return how a container ends, or goes on, where a preempt or a shutdown ends a recovery.

    At a preempt it goes by the outcome `preempted` of the failed state, as its author drew it,
    unless the state still runs. Else, and once a preempt was obeyed, its own outcome `preempted`
    ends it.
    """
    machine = node.machine
    registered = machine.get_registered_outcomes()
    state = machine._states[failure.state]
    if machine.preempt_requested() and not (
        smach.is_shutdown() or node.is_left_behind() or node.tree.workers.blocked(state)
    ):
        route = route_at_preempt(machine, failure.state)
        if route.target:
            return (
                ContainerEnding(state=route.target, obeys=True)
                if route.is_state
                else (ContainerEnding(outcome=route.target))
            )
    if PREEMPTED in registered:
        return ContainerEnding(outcome=PREEMPTED)
    return natural_ending(failure, registered, node.in_force.failing)


def leaving_outcome(machine: Machine, failing: FailingNames, wanted: Optional[str]) -> str:
    """Return an outcome with which a container ends that is left: nobody goes by it.

    :param wanted: how its failure would have ended it.
    """
    outcomes = sorted(machine.get_registered_outcomes(), key=str)
    for outcome in (PREEMPTED, wanted):
        if outcome in outcomes:
            return str(outcome)
    return next((outcome for outcome in outcomes if outcome in failing), outcomes[0])


def outcome_of_early_end(node: TreeNode, outcome: Optional[str]) -> Optional[str]:
    """Return an outcome for a Concurrence or an Iterator where its trial has ended early.

    It wants one, and nobody goes by it.
    """
    if (
        outcome is not None
        or node.tree.early_end.why is None
        or not (node.branch is not None or len(node.below) > 1)
    ):
        return outcome
    return leaving_outcome(node.machine, node.in_force.failing, None)


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


def unregistered_text(label: str, state: smach.State, outcome: Any) -> str:
    """Say that the state has not registered the outcome."""
    return 'State {!r} of type {} returned {}; its registered outcomes are {}'.format(
        label, repr_of(state), repr_of(outcome), names(state.get_registered_outcomes())
    )


def unbound_text(label: str, outcome: str, container_outcomes: Tuple[str, ...]) -> str:
    """Say that the outcome leads nowhere."""
    return (
        'Outcome {!r} of state {!r} has no transition to a state or a container outcome; '
        'the container has {}'.format(outcome, label, names(container_outcomes))
    )
