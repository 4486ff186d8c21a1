"""Makes a question of a failure, with everything that an expert needs (paper, section V)."""

from typing import Any, Collection, Dict, Iterator, Mapping, NamedTuple, Tuple

import smach

from ..asking.answer_rules import Target
from ..asking.question import LevelOutcome, Question, StateChoice
from ..machine.jump_path import JumpPath, jump_path_to, missing_on, repeated_on, why_closed_on
from ..machine.places import levels_above, places_of
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from .failure import Failure
from .precondition_probe import LivePreconditionProbe


class Account(NamedTuple):
    """An account of what was done about a failure so far."""

    continuous: bool
    reason: str  # why the expert is asked
    tried: Tuple[str, ...]
    written: Collection[str]  # userdata keys that the recovery has set
    fallback: str  # what happens without an answer, in words


def make_question(
    node: TreeNode, record: StateRecord, failure: Failure, account: Account, deadline_s: float
) -> Question:
    """Return a question about a failure. `deadline_s`: seconds left. 0 waits without end."""
    machine = node.machine
    state = machine._states[record.label]
    return Question(
        question_id=node.tree.resumed.take_question(record) or node.tree.next_question_id(),
        trial_id=node.tree.trial_id,
        container_path=node.path,
        failed_state=record.label,
        failure_kind=failure.kind,
        outcome=failure.outcome,
        text=failure.text,
        failure_class=int(record.failure_class),
        rate=record.rate,
        continuous=account.continuous,
        recoveries=record.recoveries,
        reason=account.reason,
        tried=account.tried,
        history=node.records.history.latest(),
        choices=tuple(_state_choices(node, account.written)),
        supersede_outcomes=node.site.choices(node, record.label),
        output_keys=tuple(sorted(state.get_registered_output_keys())),
        give_up_outcomes=tuple(sorted(machine.get_registered_outcomes(), key=str)),
        interfaces=node.settings.offers_for(node.relative_path, record.label),
        userdata=dict(machine.userdata._data),
        input_userdata=_inputs(machine, record.label, state),
        deadline_s=deadline_s,
        fallback=account.fallback,
        preconditions=LivePreconditionProbe(node),
        give_up_above=tuple(_give_up_above(node)),
    )


def targets_of(node: TreeNode) -> Mapping[Target, str]:
    """Return where a machine could go, and why it cannot go there now, '' where it can."""
    return {_target(node, way): why_closed_on(way) for way in _jump_paths(node)}


def _jump_paths(node: TreeNode) -> Iterator[JumpPath]:
    """Yield the ways to all places of the tree, its own first, in the order of the states."""
    for place in places_of(node):
        way = jump_path_to(node, place)
        if way is not None:
            yield way


def _target(node: TreeNode, way: JumpPath) -> Target:
    place = way.down[-1]
    return '' if place.node is node else place.node.path, place.label


def _state_choices(node: TreeNode, written: Collection[str]) -> Iterator[StateChoice]:
    for way in _jump_paths(node):
        container, label = _target(node, way)
        record = way.down[-1].node.record(label)
        yield StateChoice(
            label,
            1.0 - record.rate,
            int(record.failure_class),
            record.visits,
            missing_on(way, () if way.left else written),
            tuple(spec.name for spec in record.settings.preconditions),
            why_closed_on(way),
            repeated_on(way),
            container,
            _running_again(way),
        )


def _give_up_above(node: TreeNode) -> Iterator[LevelOutcome]:
    for level in levels_above(node):
        for outcome in sorted(level.machine.get_registered_outcomes(), key=str):
            yield LevelOutcome(level.path, outcome)


def _inputs(machine: smach.StateMachine, label: str, state: smach.State) -> Dict[str, object]:
    data = dict(machine.userdata._data)
    remapping = machine._remappings.get(label) or {}
    return {
        key: data[remapping.get(key, key)]
        for key in state.get_registered_input_keys()
        if remapping.get(key, key) in data
    }


# -- Concurrences and Iterators


def _running_again(way: JumpPath) -> Tuple[str, ...]:
    """Return the branches that would all run again if the machine went a way.

    They are those of the outermost Concurrence that is entered, be it the place or on the way down.
    """
    for entered in _entered_on(way):
        if isinstance(entered, smach.Concurrence):
            return tuple(map(str, entered.get_children()))
    return ()


def _entered_on(way: JumpPath) -> Iterator[smach.State]:
    """Yield the states that are entered, outermost first.

    Containers between two places, such as a Concurrence in an Iterator, are among them.
    """
    for place, below in zip(way.down, way.down[1:]):
        around: Any = place.node.machine._states[place.label]
        yield around
        for label in below.node.below[1:]:
            around = around.get_children()[label]
            yield around
    last = way.down[-1]
    yield last.node.machine._states[last.label]
