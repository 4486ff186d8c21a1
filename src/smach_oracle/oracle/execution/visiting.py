"""Executes a state where more is to be done than that."""

from time import monotonic

import smach

from ..branches.wrapper import goes_on_inside
from ..machine.repeats import has_visited, note_visit, why_held_back
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..machine.userdata import UserdataGate, view_behind
from ..machine.workers import Overrun
from ..records.events import EventKind
from ..recovery.failure import HeldBack
from ..recovery.still_running import EndedByAnswer, WatchedVisit
from ..smach_private import has_preempt_flag

STATE_START = EventKind.STATE_START  # looked up once


def execute_observed(
    node: TreeNode, record: StateRecord, state: smach.State, userdata: smach.Remapper
) -> object:
    """Execute a state of which observers hear, and about which nothing else is special.

    It returns what the state returns, and raises what it raises.
    """
    if node.tree.is_resumed:
        return execute_watched(node, record, state, userdata)
    node.events.emit(STATE_START, node.path, node.trial_id, record.label)
    begun_s = monotonic()
    try:
        return state.execute(userdata)
    finally:
        took_s = monotonic() - begun_s
        if took_s > (record.longest_s or 0.0) and not has_preempt_flag(node.machine):
            record.longest_s = took_s


def execute_watched(
    node: TreeNode, record: StateRecord, state: smach.State, userdata: smach.Remapper
) -> object:
    """Execute the state, watched, and return its outcome, an Overrun, or that it is held back.

    It raises what the state raises. With a time limit it gets a view of its own, which is shut
    when the state overruns, in place of `userdata`.
    """
    if node.tree.is_resumed:
        unfinished = node.tree.resumed.take_unfinished(node.records, record)
        if unfinished is not None:
            return unfinished
    entered_by_oracle, way_down = record.entered_by_oracle, record.way_down
    if entered_by_oracle or way_down:
        record.forget_entry()
    if node.in_force.deep_copy_keys:
        record.snapshot = node.snapshot()
    if node.tree.numbers_visits:
        # what goes on where it stood is in its visit still, if it has had one
        label = record.label
        is_new = not (has_visited(node, label) and goes_on_inside(node, label))
        why_not = note_visit(node, record) if is_new else why_held_back(node, record)
        if why_not:
            return HeldBack(why_not)
    if way_down:
        node.execution.start_below(way_down)  # before STATE_START, with which it is stored
    try:
        node.emit(STATE_START, record.label)
        blocked = node.tree.workers.blocked(state)
        if blocked:
            return Overrun(blocked)
        begun_s = monotonic()
        outcome: object = None
        try:
            if record.settings.time_limit_s is not None and node.tree.recover:
                outcome = _execute_limited(node, record, state)
            elif entered_by_oracle:
                outcome = WatchedVisit(node, record).execute(userdata)
            else:
                outcome = state.execute(userdata)
            return outcome
        finally:
            took_s = monotonic() - begun_s
            if took_s > (record.longest_s or 0.0) and not (
                isinstance(outcome, (Overrun, EndedByAnswer)) or has_preempt_flag(node.machine)
            ):
                record.longest_s = took_s
    finally:
        if way_down:
            node.execution.start_below(())


def _execute_limited(node: TreeNode, record: StateRecord, state: smach.State) -> object:
    """Execute a state in a worker, as `execute_watched` does."""
    machine, label = node.machine, record.label

    def on_late_write(key: str) -> None:
        if node.tree.is_new(node.path, label, 'late write', key):
            smach.logwarn(
                '{}/{}: a write to userdata key {!r} came after the time limit and '
                'is dropped'.format(node.path, label, key)
            )

    gate = UserdataGate(machine, on_late_write)
    view = view_behind(gate, machine, label, state)
    return node.tree.workers.run(state, view, gate, label, record.settings)
