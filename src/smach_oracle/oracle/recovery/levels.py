"""The levels above a failed state: what its author foresaw there, and what their oracles decide."""

from typing import Any, FrozenSet, List, NamedTuple, Optional, Tuple

import smach

from ..decision.policy import Action
from ..decision.sentence import cause_of, decision_sentence
from ..machine.protocols import Labels
from ..machine.tree_node import TreeNode
from ..places.levels import is_direct, levels_above
from ..places.place import Place
from ..places.stepping_back import failure_context
from ..places.way import Way, way_to
from ..records.events import EventKind, FailureKind
from ..records.facts import DECIDED_BY
from ..records.state_record import StateRecord
from .deciding import Deciding
from .failure import (
    ContainerEnding,
    Failure,
    Route,
    author_recovers,
    failure_kind,
    natural_ending,
    route_of,
)
from .stop import RecoveryStop


def _is_overridden(above: TreeNode, below: Labels) -> bool:
    """Whether the oracle takes what the author of a container around has drawn."""
    path = '/'.join(filter(None, (above.relative_path,) + below[:-1]))
    return above.in_force.of_state(path, below[-1]).author_recoveries == 'override'


class Foreseen(NamedTuple):
    """The reason why the end of a container is left to the one above it."""

    text: str
    passed_over: str = ''  # the outcome with which an item of an Iterator is passed over


def _is_passed_over(node: TreeNode, above: TreeNode, outcome: str) -> bool:
    """Whether an Iterator around a container goes on after it has ended with an outcome."""
    if node.branch is not None:
        return False
    around: Any = above.machine._states[node.below[0]]
    for label in node.below[1:-1]:
        around = around.get_children()[label]
    # what only the settings call a failure its author has not foreseen
    return (
        isinstance(around, smach.Iterator)
        and outcome in around._loop_outcomes
        and not _is_overridden(above, node.below)
        and outcome in node.in_force.failing
    )


def foreseen_above(node: TreeNode, ending: ContainerEnding) -> Optional[Foreseen]:
    """Return what the author has drawn after the end of a container, None where that is nothing.

    It may be one of any level above: a failing outcome falls through from one to the next. Where a
    Concurrence lies between, nobody knows before it has ended.
    """
    outcome = ending.outcome
    while outcome is not None and node.parent is not None:
        above = node.parent
        if above is not next(levels_above(node), None):
            return None
        if not is_direct(node):
            return (
                Foreseen('{} {} -> the next item'.format(node.path, outcome), outcome)
                if _is_passed_over(node, above, outcome)
                else None
            )
        label = node.below[0]
        route, kind = _judged_above(above, label, outcome)
        if kind is FailureKind.NOT_A_FAILURE or not route.target:
            return None
        settings = above.settings_of(label)
        if author_recovers(
            outcome, route, kind, settings.failure_outcomes, settings.author_recoveries
        ):
            return Foreseen('{}/{} {} -> {}'.format(above.path, label, outcome, route.target))
        if route.is_state:  # `author_recoveries: override`
            return None
        node, outcome = above, route.target
    return None


def _judged_above(above: TreeNode, label: str, outcome: str) -> Tuple[Route, FailureKind]:
    """Return where the end of a container leads on the level above, and what it is there."""
    route = route_of(above.machine, label, outcome)
    return route, failure_kind(
        outcome, route, above.settings_of(label).failure_outcomes, above.in_force.failing
    )


def failure_above(
    above: TreeNode, label: str, ending: ContainerEnding, text: str
) -> Optional[Failure]:
    """Return the failure that the end of a container is on the level above, else None.

    :param label: of the state there that holds the container.
    """
    if ending.error is not None:
        error = ending.error
        return Failure(label, FailureKind.EXCEPTION, '', text, None, lambda: error)
    if ending.outcome is None:
        return None
    route, kind = _judged_above(above, label, ending.outcome)
    if kind is FailureKind.NOT_A_FAILURE:
        return None
    return Failure(label, kind, ending.outcome, text, route)


def runs_as_precondition(node: TreeNode) -> bool:
    """Whether a container is executed as a precondition, while a level above recovers."""
    child, above = node, node.parent
    while above is not None:
        state = above.machine._states.get(child.below[0])
        label = above.machine._current_label
        if above.tree.is_precondition(above, state):
            return True
        if above.machine._is_running and label is not None and above.is_oracle(label):
            return True
        if not above.machine._is_running or above.machine._current_state is not state:
            return False
        child, above = above, above.parent
    return False


def levels_that_may_decide(node: TreeNode) -> List[TreeNode]:
    """Return the levels above to which `escalate` hands a failure, innermost first."""
    found: List[TreeNode] = []
    child = node
    for above in levels_above(node):
        if not child.settings.escalate or not is_direct(child):
            break
        found.append(above)
        child = above
    return found


class OuterDecision(NamedTuple):
    """A recovery that a level above has decided on.

    `written`: userdata keys that survive a restore, where the way ends at that level.
    """

    decided_by: TreeNode
    way: Way
    text: str
    written: FrozenSet[str]
    wait_s: float = 0.0  # waited before
    restarts: bool = False


class OuterLevel:
    """The oracle of a level above, which decides about its own state as if that had failed.

    That is a failure of the state only where the oracle does not ask.
    """

    def __init__(
        self, node: TreeNode, below: TreeNode, failure: Failure, stop: RecoveryStop
    ) -> None:
        """`below`: the level below, which asks. `failure`: as its end would be judged here."""
        self._node = node
        self._record: StateRecord = node.record(failure.state)
        self._failure = failure
        self._below = below
        self._context = failure_context(node, self._record)
        self._continuous = node.in_force.policy.is_continuous(self._context)
        self._deciding = Deciding(
            node, self._record, failure, self._context, self._continuous, stop
        )
        self.tried: List[str] = []

    def cancel(self) -> None:
        """Preempt the precondition that runs."""
        self._deciding.cancel()

    def decide(self) -> Optional[OuterDecision]:
        """Return the recovery, or None where this level asks too, or has been left meanwhile."""
        record = self._record
        if way_to(self._below, Place(self._node, record.label)) is None:
            return None
        standing = record.read_rate()
        record.learn(True)
        decider, facts = self._deciding.decide(self._foreseen)
        self.tried = ['{}: {}'.format(self._node.path, each) for each in self._deciding.tried]
        decided = self._deciding.way
        way = way_to(self._below, decided.down[-1]) if decided is not None else None
        if decided is None or way is None:
            record.take_back_failure()
            self.tried.append('{}: {}: asks too'.format(self._node.path, cause_of(facts)))
            return None
        self._node.records.note_failure(record)
        sentence = decision_sentence(facts, cause_of(facts))
        smach.loginfo('{}/{}'.format(self._node.path, sentence))
        self._node.emit(
            EventKind.FAILURE,
            state=record.label,
            outcome=self._failure.outcome,
            failure_kind=int(self._failure.kind),
            failure_class=int(standing.failure_class),
            rate=standing.rate,
            continuous=self._continuous,
            text=self._failure.text,
        )
        self._node.emit_rated(
            EventKind.DECISION,
            record,
            outcome=facts.action.value,
            target=facts.target,
            continuous=self._continuous,
            text=sentence,
            data={DECIDED_BY: decider.value},
        )
        record.recoveries += 1
        return OuterDecision(
            self._node,
            way,
            sentence,
            decided.kept(self._deciding.watch),
            facts.wait_s,
            facts.action is Action.RESTART,
        )

    def _foreseen(self) -> str:
        node = self._node
        foreseen = foreseen_above(
            node,
            natural_ending(
                self._failure, node.machine.get_registered_outcomes(), node.in_force.failing
            ),
        )
        return foreseen.text if foreseen is not None else ''
