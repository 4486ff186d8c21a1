"""Everything an expert is told about a failure (paper, section V)."""
from typing import Any, Collection, Dict, Iterator, NamedTuple, Tuple

import smach

from ..asking.question import OutcomeChoice, Question, StateChoice
from ..machine.protocols import Machine
from ..machine.repeats import repeated_by_going_to, why_closed
from ..machine.tree_node import TreeNode
from ..machine.userdata_view import keys_after_jump, missing_keys
from ..records.state_record import StateRecord
from .branch_choices import outcomes_of_branch, running_again
from .failure import Failure, route_of
from .precondition_probe import LivePreconditionProbe


class Account(NamedTuple):
    """What was done about a failure so far."""

    continuous: bool
    reason: str  # why the expert is asked
    tried: Tuple[str, ...]
    written: Collection[str]  # userdata keys that the recovery has set
    fallback: str  # what happens without an answer, in words


def make_question(node: TreeNode, record: StateRecord, failure: Failure, account: Account,
                  deadline_s: float) -> Question:
    """Return a question about a failure. `deadline_s`: seconds left; 0 waits without end."""
    machine = node.machine
    state = machine._states[record.label]
    return Question(
        question_id=node.tree.next_question_id(), trial_id=node.tree.trial_id,
        container_path=node.path, failed_state=record.label, failure_kind=failure.kind,
        outcome=failure.outcome, text=failure.text, failure_class=int(record.failure_class),
        rate=record.rate, continuous=account.continuous, recoveries=record.recoveries,
        reason=account.reason, tried=account.tried, history=node.records.history.latest(),
        choices=tuple(_state_choices(node, account.written)),
        supersede_outcomes=(outcomes_of_branch(node, state)
                            or tuple(_supersede_outcomes(machine, record.label, state))),
        output_keys=tuple(sorted(state.get_registered_output_keys())),
        give_up_outcomes=tuple(sorted(machine.get_registered_outcomes(), key=str)),
        interfaces=node.settings.offers_for(node.relative_path, record.label),
        userdata=dict(machine.userdata._data),
        input_userdata=_inputs(machine, record.label, state), deadline_s=deadline_s,
        fallback=account.fallback, preconditions=LivePreconditionProbe(node))


def _state_choices(node: TreeNode, written: Collection[str]) -> Iterator[StateChoice]:
    """Yield the states the machine could be sent to, in the order in which they were added."""
    for label in node.labels():
        record = node.record(label)
        yield StateChoice(
            label, 1.0 - record.rate, int(record.failure_class), record.visits,
            missing_keys(node.machine, label, keys_after_jump(node, label, written)),
            tuple(spec.name for spec in record.settings.preconditions),
            why_closed(node, label), repeated_by_going_to(node, label),
            runs_again=running_again(node, label))


def _supersede_outcomes(machine: Machine, label: str,
                        state: smach.State) -> Iterator[OutcomeChoice]:
    for outcome in sorted(state.get_registered_outcomes(), key=str):
        route = route_of(machine, label, outcome)
        if route.target:
            yield OutcomeChoice(outcome, route.target)


def _inputs(machine: Machine, label: str, state: smach.State) -> Dict[str, Any]:
    data = dict(machine.userdata._data)
    remapping = machine._remappings.get(label) or {}
    return {key: data[remapping.get(key, key)] for key in state.get_registered_input_keys()
            if remapping.get(key, key) in data}
