"""One visit of the meta state: entered on an occasion, left by a verdict (paper, section IV-A)."""

from typing import Any, Mapping, Optional, cast

import smach

from ..machine.learned_rates import save_rates
from ..machine.tree_node import TreeNode
from ..records.events import EventKind, FailureKind
from ..records.facts import LEFT
from ..records.state_record import StateRecord
from ..recovery.failure import ContainerEnding
from ..recovery.judging import in_words
from ..recovery.occasions import FirstStep, Occasion
from ..recovery.recovering import Recovering
from ..recovery.verdict import Preempted, Verdict, arrives_at
from .applying import Applying, leaving
from .departure import depart
from .oracle_state import OracleState
from .transitions import be_back, go_to, message_of

_NO_FACTS: Mapping[str, Any] = {}


def visit_oracle(node: TreeNode, record: StateRecord, occasion: Occasion) -> Optional[str]:
    """Enter the meta state, recover, and go as the verdict says.

    It returns the container's outcome, or None where the machine goes on. Where the oracle gives
    up, it raises what the machine would raise without one.
    """
    meta = _enter(node, record, occasion)
    try:
        verdict = _recover(node, record, occasion, meta)
        return Applying(node, record, occasion, meta).apply(verdict)
    except BaseException:
        be_back(node, record.label)
        raise


def _enter(node: TreeNode, record: StateRecord, occasion: Occasion) -> OracleState:
    machine, meta_label = node.machine, node.settings.oracle_label
    _log_failure(node, record, occasion)
    machine._sync_oracle()
    if occasion.is_told:
        record.left_by(occasion.what, meta_label)
        save_rates(node)
        node.emit(
            EventKind.TRANSITION,
            state=record.label,
            outcome=occasion.outcome,
            target=meta_label,
            **(_NO_FACTS if occasion.below is None else LEFT),
        )
    # _sync_oracle refuses any other state of this name
    meta = cast(OracleState, machine._states[meta_label])
    go_to(node, message_of(record.label, occasion.what, meta_label), meta_label)
    return meta


def _log_failure(node: TreeNode, record: StateRecord, occasion: Occasion) -> None:
    if not occasion.is_logged:
        return
    failure = occasion.failure
    words = failure.details or in_words(failure)
    place = '{}/{}'.format(node.path, record.label)
    if occasion.first is FirstStep.ENTER_AGAIN:
        # what the wait says in the log is one sentence for all who wait
        smach.loginfo('{} failed, which is not counted: {}'.format(place, words))
        return
    # what was in doubt, or had not begun, has not failed
    smach.logwarn(
        place
        + (
            ' ' + failure.text
            if failure.is_held_back
            else ': ' + failure.text
            if failure.kind is FailureKind.INTERRUPTED
            else ' failed: ' + words
        )
    )


def _recover(node: TreeNode, record: StateRecord, occasion: Occasion, meta: OracleState) -> Verdict:
    machine = node.machine
    meta.begin(Recovering(node, record, occasion))
    if machine._preempt_requested:
        meta.request_preempt()  # it came from a callback on the way here
    lock = machine._state_transitioning_lock
    lock.release()
    try:
        meta.execute(machine.userdata)
        verdict = meta.take_verdict()
        if node.tree.early_end.why is not None:
            return Preempted()
        if arrives_at(verdict) in (None, node) or depart(node, record.label, verdict):
            return verdict
        # another one, of a branch beside, leaves the container
        return Preempted(ContainerEnding(outcome=leaving(node, occasion.failure)))
    finally:
        lock.acquire()
