"""Sets a tree to where a stored trial stood, so that its execution goes on from there."""
import time
from typing import Any, List, Mapping, NamedTuple, Optional

import smach
from smach_oracle.store.rows import StoredTrial

from ..machine.nesting import nodes_of
from ..machine.tree_node import TreeNode
from ..records.events import EventKind, FailureKind
from ..records.state_record import StateRecord, Unfinished
from .checkpointer import BEFORE, ENDED, FAILED
from .stored_container import StoredContainer
from .stored_tree import StoredTree

SEQ_RESERVE = 1000  # event numbers behind the last stored one that may have been used
STOPPED = 'the program was stopped while it ran: nobody knows whether it was done'
NOT_BEGUN = 'the program was stopped before it began'


class Resumption(NamedTuple):
    """A trial that goes on."""

    trial: StoredTrial
    tree: StoredTree
    moment: int  # number of the one that it goes on from
    seq: int  # of the last event that is stored
    at: float  # s since the epoch, when that was
    asks: bool  # a person is asked before anything moves
    changes: List[str]  # how the script differs from the one that was stopped

    @property
    def age_s(self) -> float:
        """How long ago that was, s."""
        return max(0.0, time.time() - self.at)


def tell_resumed(top: TreeNode, resumption: Resumption) -> None:
    """Say that a trial goes on."""
    smach.logwarn('{}: trial {} goes on; its program was stopped {:.0f} s ago'.format(
        top.path, resumption.trial.trial_id, resumption.age_s))
    for change in resumption.changes:
        smach.logwarn('{}: the script has changed: {}'.format(top.path, change))
    top.emit(EventKind.RESUMED, data={
        'last_seq': resumption.seq, 'moment': resumption.moment,
        'stopped_s': round(resumption.age_s, 3), 'changes': resumption.changes})


class EntryPoint:
    """Where one container goes on; it is used up when that begins to execute."""

    def __init__(self, stored: StoredContainer) -> None:
        self._stored = stored

    @property
    def label(self) -> str:
        """The state in which it goes on."""
        return self._stored.label

    def take_over_records(self, node: TreeNode) -> None:
        """Have the visits of the execution that was stopped."""
        stored = self._stored
        if stored.history:
            node.records.history.take_over(stored.visits, stored.visits_of_execution,
                                           stored.history)

    def enter(self, node: TreeNode) -> None:
        """Have the userdata as it was, and the state in which it goes on as the current one."""
        stored, machine = self._stored, node.machine
        data = machine.userdata._data
        for key in stored.gone:
            data.pop(key, None)
        data.update(stored.keys)
        for key, why in sorted(stored.missing.items()):
            node.warn('userdata key {!r} {}'.format(key, 'has the value that the script gives it, '
                                                    'as {}'.format(why) if key in data
                                                    else 'is missing, as ' + why))
        machine._set_current_state(stored.label)


def go_on(top: TreeNode, resumption: Resumption) -> None:
    """Set every container of the tree to where it was; to be called once the trial has begun."""
    nodes = list(nodes_of(top.machine))
    latest = 0
    for node in nodes:
        stored = resumption.tree.container(node.key)
        for label, told in stored.states.items():
            if label in node.machine._states and not node.is_oracle(label):
                latest = max(latest, _restore(node, node.record(label), told))
        if stored.history:
            node.records.history.take_over([], 0, stored.history)
    top.tree.go_on_counting(latest, resumption.tree.whole)
    top.events.go_on_behind(resumption.seq + SEQ_RESERVE)
    _activate(top, resumption, nodes)


def _restore(node: TreeNode, record: StateRecord, told: Mapping[str, Any]) -> int:
    """Have what was learned and counted of a state; return the number of its latest visit."""
    record.restore(told['learned'])
    record.go_on(told['counts'], told['longest_s'])
    mark = node.records.marks.of(record.label)
    mark.reached, mark.executed, mark.done, mark.spent = told['mark']
    return int(mark.reached)


def _activate(node: TreeNode, resumption: Resumption, nodes: List[TreeNode]) -> None:
    stored = resumption.tree.container(node.key)
    if stored.phase in ('', ENDED):
        return
    node.resuming = EntryPoint(stored)
    record = node.record(stored.label)
    inner = _below(node, stored.label, nodes)
    if stored.phase == BEFORE or (stored.phase != FAILED and inner is not None):
        if inner is not None and resumption.tree.container(inner.key).phase not in ('', ENDED):
            _activate(inner, resumption, nodes)
        elif resumption.asks:
            record.resume(Unfinished(FailureKind.INTERRUPTED, '', NOT_BEGUN, _why(resumption)))
        return
    record.resume(_unfinished(stored, resumption))


def _unfinished(stored: StoredContainer, resumption: Resumption) -> Unfinished:
    why = _why(resumption) if resumption.asks else ''
    if stored.phase == FAILED:
        kind, outcome, text = stored.at[2:5]
        return Unfinished(FailureKind(kind), outcome, text, why)
    return Unfinished(FailureKind.INTERRUPTED, '', STOPPED, why)


def _why(resumption: Resumption) -> str:
    told = 'the program was stopped {:.0f} s ago'.format(resumption.age_s)
    if resumption.changes:
        told += ', and the script has changed since: ' + '; '.join(resumption.changes)
    return told


def _below(node: TreeNode, label: str, nodes: List[TreeNode]) -> Optional[TreeNode]:
    """Return the node of a state that is a wrapped machine, None for any other state."""
    state = node.machine._states.get(label)
    if not isinstance(state, smach.StateMachine):
        return None
    return next((each for each in nodes if each.machine is state), None)
