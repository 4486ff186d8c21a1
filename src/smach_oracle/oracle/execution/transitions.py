"""Moves a machine on: to a state, or to its end."""

from typing import Any, Container, NamedTuple, Optional

import smach

from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..machine.workers import recall_preempts
from ..records.events import EventKind
from ..recovery.stop import note_obeyed
from ..settings.failing_outcomes import PREEMPTED
from ..smach_private import (
    Transitions,
    current_label_of,
    current_state_of,
    has_preempt_flag,
    preempted_state_of,
    set_current_label,
    set_executing,
    set_preempt_flag,
    set_preempted_state,
    states_of,
)


class Stop(NamedTuple):
    """The machine has gone on, or stops. `outcome`: of the container, None where it has none."""

    outcome: Optional[str] = None


def go_to(node: TreeNode, message: str, target: str) -> None:
    """Make `target` the current state, log the transition, tell the callbacks."""
    machine = node.machine
    set_current_label(machine, target)
    smach.loginfo(message)
    machine.call_transition_cbs()


def be_back(node: TreeNode, label: str) -> None:
    """Have a state as the current one again, as without an oracle, if it is there still."""
    if label in states_of(node.machine):
        set_current_label(node.machine, label)


def message_of(source: str, outcome: str, target: str) -> str:
    """Return what SMACH logs of a transition."""
    return "State machine transitioning '{}':'{}'-->'{}'".format(source, outcome, target)


def obey_preempt(node: TreeNode, state: smach.State, cleans_within: bool = False) -> None:
    """Have a preempt obeyed by the current state, as if it had run and serviced the request.

    The machine sees that before its next state. `cleans_within`: the state is entered next, a
    machine with a clean-up of its own.
    """
    recall_preempts(state)
    machine = node.machine
    set_preempt_flag(machine, True)
    note_obeyed(node, current_label_of(machine), cleans_within)
    node.records.note_drawn()
    set_preempted_state(machine, state, current_label_of(machine))


def stop_left_behind(node: TreeNode) -> Stop:
    """End the execution without an outcome. Nobody waits for one."""
    log = smach.logwarn if node.tree.early_end.why is None else smach.loginfo
    log('{}: stops, as {}'.format(node.path, node.why_left_behind()))
    set_executing(node.machine, False)
    return Stop()


def terminate(
    node: TreeNode,
    label: str,
    outcome: str,
    container_outcome: str,
    told_label: Optional[str] = None,
) -> str:
    """End the container. A preempt that its last state has serviced is serviced.

    `told_label`: the state that callbacks are told, None for `label`.
    """
    machine = node.machine
    if has_preempt_flag(machine):
        last = current_state_of(machine)
        if (
            last is not None
            and not last.preempt_requested()
            and (preempted_state_of(machine) is not None or container_outcome == PREEMPTED)
        ):
            machine.service_preempt()
    told_label = label if told_label is None else told_label
    return _end(node, label, outcome, container_outcome, told_label)


def _end(node: TreeNode, label: str, outcome: str, container_outcome: str, told_label: str) -> str:
    machine = node.machine
    set_current_label(machine, None)
    if node.site.is_container:
        smach.loginfo(
            "State machine terminating '%s':'%s':'%s'" % (label, outcome, container_outcome)
        )
    machine.call_termination_cbs([told_label], container_outcome)
    return container_outcome


def end_plainly(
    node: TreeNode, record: StateRecord, outcome: Any, states: Container[str], drawn: Transitions
) -> Optional[str]:
    """End the container the short way, where its last state has ended plainly as once before.

    It returns the container's outcome, None where more is to be done than that. `states`: of the
    container. `drawn`: the transitions of its last state.
    """
    try:
        edge = record.fast[outcome]
        is_drawn = drawn[outcome] is edge.drawn
    except (KeyError, TypeError):  # seen for the first time, or no outcome at all
        return None
    ending = edge.leads_to
    if (
        not is_drawn
        or ending in states
        # a stop or an operator may have a say, and an early end of the trial
        or has_preempt_flag(node.machine)
        or node.engine.attentive
        or node.tree.early_end.is_near()
        or smach.is_shutdown()
    ):
        return None
    edge.count += 1
    node.records.history.visited(edge.visit, record.has_preconditions)
    if node.events.observers:
        node.emit(EventKind.TRANSITION, state=record.label, outcome=outcome, target=ending)
    return _end(node, record.label, outcome, ending, record.label)
