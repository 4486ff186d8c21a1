"""The levels above a failed state: what its author foresaw there, and what their oracles decide."""
from typing import Any, FrozenSet, List, NamedTuple, Optional

import smach

from ..decision.policy import Action
from ..decision.sentence import cause_of, decision_sentence
from ..machine.protocols import Labels
from ..machine.tree_node import TreeNode
from ..places.levels import is_direct, levels_above
from ..places.way import Way, way_to
from ..records.events import EventKind, FailureKind
from ..records.facts import DECIDED_BY
from ..records.state_record import StateRecord
from .deciding import Deciding
from .failure import (
    ContainerEnding,
    Failure,
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


def passed_over(node: TreeNode, ending: ContainerEnding) -> str:
    """Return the outcome with which an Iterator around a container goes on, '' for none."""
    above = next(levels_above(node), None)
    if above is None or is_direct(node) or node.branch is not None or ending.outcome is None:
        return ''
    around: Any = above.machine._states[node.below[0]]
    for label in node.below[1:-1]:
        around = around.get_children()[label]
    goes_on = (isinstance(around, smach.Iterator) and ending.outcome in around._loop_outcomes
               and not _is_overridden(above, node.below))
    # what only the settings call a failure its author has not foreseen
    return ending.outcome if goes_on and ending.outcome in node.in_force.failing else ''


def foreseen_above(node: TreeNode, ending: ContainerEnding) -> str:
    """Return which transition of the author's recovers from the end of a container, '' for none.

    It may be one of any level above: a failing outcome falls through from one to the next. Where a
    Concurrence lies between, nobody knows before it has ended.
    """
    outcome = ending.outcome
    while outcome is not None and node.parent is not None:
        above = node.parent
        if above is not next(levels_above(node), None):
            return ''
        if not is_direct(node):
            goes_on = passed_over(node, ContainerEnding(outcome=outcome))
            return '{} {} -> the next item'.format(node.path, outcome) if goes_on else ''
        label = node.below[0]
        settings = above.settings_of(label)
        route = route_of(above.machine, label, outcome)
        kind = failure_kind(outcome, route, settings.failure_outcomes, above.in_force.failing)
        if kind is FailureKind.NOT_A_FAILURE or not route.target:
            return ''
        if author_recovers(outcome, route, kind, settings.failure_outcomes,
                           settings.author_recoveries):
            return '{}/{} {} -> {}'.format(above.path, label, outcome, route.target)
        if route.is_state:  # `author_recoveries: override`
            return ''
        node, outcome = above, route.target
    return ''


def failure_above(above: TreeNode, label: str, ending: ContainerEnding,
                  text: str) -> Optional[Failure]:
    """Return the failure that the end of a container is on the level above, None where it is none.

    :param label: of the state there that holds the container.
    """
    if ending.error is not None:
        error = ending.error
        return Failure(label, FailureKind.EXCEPTION, '', text, None, lambda: error)
    if ending.outcome is None:
        return None
    route = route_of(above.machine, label, ending.outcome)
    kind = failure_kind(ending.outcome, route, above.settings_of(label).failure_outcomes,
                        above.in_force.failing)
    if kind is FailureKind.NOT_A_FAILURE:
        return None
    return Failure(label, kind, ending.outcome, text, route)


def runs_as_precondition(node: TreeNode) -> bool:
    """Whether a container is executed as a precondition, while a level above recovers."""
    child, above = node, node.parent
    while above is not None and above.machine._is_running:
        state = above.machine._states.get(child.below[0])
        label = above.machine._current_label
        if above.as_precondition is state or (label is not None and above.is_oracle(label)):
            return True
        if above.machine._current_state is not state:
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

    `written`: its userdata keys that survive a restore.
    """

    way: Way
    text: str
    written: FrozenSet[str]
    wait_s: float = 0.0  # waited before
    restarts: bool = False


class OuterLevel:
    """The oracle of a level above, which decides about its own state as if that had failed.

    That is a failure of the state only where the oracle does not ask.
    """

    def __init__(self, node: TreeNode, below: TreeNode, failure: Failure,
                 stop: RecoveryStop) -> None:
        """`below`: the level below, which asks; `failure`: as its end would be judged here."""
        self._node = node
        self._record: StateRecord = node.record(failure.state)
        self._failure = failure
        self._below = below
        self._context = node.records.failure_context(self._record,
                                                     node.machine._initial_state_label or '')
        self._continuous = node.in_force.policy.is_continuous(self._context)
        self._deciding = Deciding(node, self._record, failure, self._context, self._continuous,
                                  stop)
        self.tried: List[str] = []

    def cancel(self) -> None:
        """Preempt the precondition that runs."""
        self._deciding.cancel()

    def decide(self) -> Optional[OuterDecision]:
        """Return the recovery; None where this level asks too."""
        record = self._record
        rate, failure_class = record.rate, record.failure_class
        record.learn(True)
        decider, facts = self._deciding.decide(self._foreseen)
        self.tried = ['{}: {}'.format(self._node.path, each) for each in self._deciding.tried]
        place = self._deciding.place
        if place is None:
            record.take_back_failure()
            self.tried.append('{}: {}: asks too'.format(self._node.path, cause_of(facts)))
            return None
        self._node.records.note_failure(record)
        sentence = decision_sentence(facts)
        smach.loginfo('{}/{}'.format(self._node.path, sentence))
        self._emit(EventKind.FAILURE, outcome=self._failure.outcome,
                   failure_kind=int(self._failure.kind), failure_class=int(failure_class),
                   rate=rate, continuous=self._continuous, text=self._failure.text)
        self._emit(EventKind.DECISION, outcome=facts.action.value, target=facts.target,
                   failure_class=int(record.failure_class), rate=record.rate,
                   continuous=self._continuous, text=sentence, data={DECIDED_BY: decider.value})
        record.recoveries += 1
        way = way_to(self._below, place)
        if way is None:  # it has been left meanwhile
            return None
        return OuterDecision(way, sentence, frozenset(self._deciding.watch.written()),
                             facts.wait_s, facts.action is Action.RESTART)

    def _foreseen(self) -> str:
        node = self._node
        return foreseen_above(node, natural_ending(
            self._failure, node.machine.get_registered_outcomes(), node.in_force.failing))

    def _emit(self, kind: EventKind, **fields: object) -> None:
        self._node.emit(kind, state=self._record.label, **fields)
