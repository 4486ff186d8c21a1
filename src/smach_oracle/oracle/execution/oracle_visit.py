"""One visit of the meta state: entered by a failure, left by a verdict (paper, section IV-A)."""
import contextlib
from typing import Any, Iterator, Mapping, Optional, Sequence, cast

import smach

from ..asking.question import Answer
from ..decision.policy import FailureContext
from ..machine.learned_rates import save_rates
from ..machine.repeats import leave_for, note_superseded
from ..machine.tree_node import TreeNode
from ..machine.userdata_view import missing_keys
from ..places.way import Way
from ..records.events import EventKind, FailureKind
from ..records.state_record import StateRecord
from ..records.visits import VisitResult
from ..recovery.failure import (
    ContainerEnding,
    Failure,
    leaving_outcome,
    natural_ending,
    route_of,
)
from ..recovery.judging import in_words
from ..recovery.recovery import Recovery
from ..recovery.taken_out_recovery import TakenOutRecovery
from ..recovery.verdict import Verdict, VerdictKind
from .departure import depart
from .entering import prepare_entry
from .going_on import ask_to_go_on
from .oracle_state import OracleState
from .starting_over import restore_start
from .transitions import go_to, message_of, obey_preempt, stop_left_behind, terminate


class OracleVisit:
    """The way of one failure into the meta state and out of it."""

    _facts: Mapping[str, Any] = {}  # further fields of the TRANSITION to the meta state

    def __init__(self, node: TreeNode, record: StateRecord, failure: Failure) -> None:
        self._node = node
        self._machine = node.machine
        self._record = record
        self._failure = failure

    def run(self, context: FailureContext, continuous: bool) -> Optional[str]:
        """Recover, and return the container's outcome, or None where the machine goes on.

        Where the oracle gives up, it raises what the machine would raise without one.
        """
        meta = self._enter()
        with self._back_where_it_raises():
            verdict = self._recover(meta, self._recovery(context, continuous))
            if verdict.kind is VerdictKind.SUPERSEDE:
                self._note_superseded(verdict.outcome)
            return self._leave(meta, verdict)

    def _recovery(self, context: FailureContext, continuous: bool) -> Recovery:
        return Recovery(self._node, self._record, self._failure, context, continuous)

    def follow(self, answer: Answer, outcome: str, context: FailureContext) -> Optional[str]:
        """Go as an expert has answered who was asked while the state still ran.

        `outcome`: with what it ended then. It returns, and raises, what `run` does.
        """
        meta = self._pass_to_meta(outcome, outcome or 'taken_out')
        with self._back_where_it_raises():
            verdict = self._recover(meta, TakenOutRecovery(
                self._node, self._record, self._failure, context, answer))
            if verdict.kind is VerdictKind.SUPERSEDE:
                self._node.records.history.count_superseded(self._record.label, verdict.outcome)
            return self._leave(meta, verdict)

    @contextlib.contextmanager
    def _back_where_it_raises(self) -> Iterator[None]:
        """Have the failed state as the current one after an error, as without an oracle."""
        try:
            yield
        except BaseException:
            self._be_back()
            raise

    def _be_back(self) -> None:
        if self._record.label in self._machine._states:
            self._machine._set_current_state(self._record.label)

    def _enter(self) -> OracleState:
        self._tell_failure()
        what = self._failure.outcome or self._failure.kind.name.lower()
        return self._pass_to_meta(self._failure.outcome, what)

    def _pass_to_meta(self, outcome: str, what: str) -> OracleState:
        node, machine, label = self._node, self._machine, self._record.label
        meta_label = node.settings.oracle_label
        machine._sync_oracle()
        self._note_passage(outcome, what)
        # _sync_oracle refuses any other state of this name
        meta = cast(OracleState, machine._states[meta_label])
        go_to(node, message_of(label, what, meta_label), meta_label)
        return meta

    def _tell_failure(self) -> None:
        failure = self._failure
        # what was in doubt, or had not begun, has not failed
        told = (' ' + failure.text if failure.is_held_back
                else ': ' + failure.text if failure.kind is FailureKind.INTERRUPTED
                else ' failed: ' + (failure.details or in_words(failure)))
        smach.logwarn('{}/{}{}'.format(self._node.path, self._record.label, told))

    def _note_passage(self, outcome: str, what: str) -> None:
        node, label, meta_label = self._node, self._record.label, self._node.settings.oracle_label
        self._record.left_by(what, meta_label)
        save_rates(node)
        node.emit(EventKind.TRANSITION, state=label, outcome=outcome, target=meta_label,
                  **self._facts)

    def _note_superseded(self, outcome: str) -> None:
        node, record = self._node, self._record
        if not self._failure.is_counted:
            self._count_superseded(outcome)
            return
        record.take_back_failure()
        node.records.history.supersede(record.label, outcome)

    def _count_superseded(self, outcome: str) -> None:
        """Count a visit that was not one before: an expert did the work of the state."""
        self._node.records.visit_ended(self._record, outcome, VisitResult.SUPERSEDED)
        note_superseded(self._node, self._record.label)

    def _recover(self, meta: OracleState, recovery: Recovery) -> Verdict:
        meta.begin(recovery)
        if self._machine._preempt_requested:
            meta.request_preempt()  # it came from a callback on the way here
        lock = self._machine._state_transitioning_lock
        lock.release()
        try:
            meta.execute(self._machine.userdata)
            verdict = meta.take_verdict()
            if self._node.tree.early_end.why is not None:
                return Verdict(VerdictKind.PREEMPTED)
            if verdict.arrives_at is None or depart(self._node, self._record.label, verdict):
                return verdict
            return self._void()
        finally:
            lock.acquire()

    def _void(self) -> Verdict:
        """Return the verdict where another one, of a branch beside, leaves the container."""
        return Verdict(VerdictKind.PREEMPTED, ending=ContainerEnding(outcome=self._leaving()))

    def _leaving(self) -> str:
        """Return the outcome with which the container ends that is left."""
        natural = natural_ending(self._failure, self._machine.get_registered_outcomes(),
                                 self._node.in_force.failing)
        return leaving_outcome(self._machine, self._node.in_force.failing, natural.outcome)

    def _leave(self, meta: OracleState, verdict: Verdict) -> Optional[str]:
        if self._node.tree.early_end.why is not None:
            self._be_back()
            stop_left_behind(self._node)
            return None
        if verdict.arrives_at not in (None, self._node):
            return self._depart(meta)
        if verdict.way is not None:
            self._jump(verdict.way, verdict)
            return None
        if verdict.kind is VerdictKind.SUPERSEDE:
            return self._supersede(verdict)
        if verdict.kind is VerdictKind.PREEMPTED:
            return self._preempted(meta, verdict)
        return self._give_up(verdict)

    def _depart(self, meta: OracleState) -> str:
        """End the container, which is left for a level above."""
        meta.service_preempt()
        self._machine.service_preempt()
        return self._terminate(self._leaving())

    def _jump(self, way: Way, verdict: Verdict) -> None:
        if verdict.restarts:
            self._start_over(way, verdict)
            return
        entry = prepare_entry(way, verdict.written, 'jumping')
        self._note_entry(way.first)
        self._go_on(way.first, entry.userdata, entry.missing, verdict.by, verdict.text,
                    self._across(way))

    def _start_over(self, way: Way, verdict: Verdict) -> None:
        """Enter the initial state, with the userdata of the start in all containers."""
        node, target = self._node, way.first
        restore_start(node)
        leave_for(node, target)
        ask_to_go_on(node, target)
        self._note_entry(target)
        self._go_on(target, 'start', by=verdict.by, text=verdict.text, across=self._across(way))

    def _across(self, way: Way) -> Mapping[str, str]:
        """Return what is told of a jump that crosses containers."""
        return {'to': way.down[-1].path} if len(way.down) > 1 else {}

    def _supersede(self, verdict: Verdict) -> Optional[str]:
        route = route_of(self._machine, self._record.label, verdict.outcome)
        self._node.emit(EventKind.SUPERSEDE, state=self._record.label, outcome=verdict.outcome,
                        target=route.target, by=verdict.by, text=verdict.text)
        if not route.is_state:
            return self._terminate(route.target)
        self._note_entry(route.target)
        self._go_on(route.target, by=verdict.by)
        return None

    def _note_entry(self, label: str) -> None:
        """Note that the machine comes to this state by the oracle alone."""
        if self._node.settings.still_running_s:
            self._node.record(label).enter_by_oracle()

    def _give_up(self, verdict: Verdict) -> Optional[str]:
        ending, text = verdict.ending, verdict.text
        told = '{}; {}'.format(text, ending.error) if ending.error is not None else text
        node = self._node
        node.gave_up = ending.state is None
        node.emit(EventKind.GIVE_UP, state=self._record.label, outcome=ending.outcome or '',
                  target=ending.state or '', by=verdict.by, text=told)
        if ending.error is not None:  # SMACH has logged it where it was made
            raise ending.error
        if ending.state is not None:
            self._go_on(ending.state, by=verdict.by, text=text)
            return None
        return self._terminate(str(ending.outcome))

    def _preempted(self, meta: OracleState, verdict: Verdict) -> Optional[str]:
        ending = verdict.ending
        if self._machine.preempt_requested():
            self._node.tell_preempt()
        if ending.state is not None:  # the author's own transition: the request goes on with it
            if ending.obeys:
                obey_preempt(self._node, meta)
            self._go_on(ending.state)
            return None
        meta.service_preempt()
        self._machine.service_preempt()
        if ending.error is not None:
            raise ending.error
        return self._terminate(str(ending.outcome))

    def _go_on(self, target: str, userdata: str = 'keep', missing: Optional[Sequence[str]] = None,
               by: str = '', text: str = '', across: Optional[Mapping[str, str]] = None) -> None:
        """Leave the meta state for a state."""
        node = self._node
        if missing is None:
            missing = missing_keys(self._machine, target, self._machine.userdata._data)
        self._note_jump(target, {'missing_keys': list(missing), 'userdata': userdata,
                                 **(across or {})}, by, text)
        go_to(node, message_of(node.settings.oracle_label, target, target), target)

    def _note_jump(self, target: str, data: Mapping[str, Any], by: str, text: str) -> None:
        self._node.emit(EventKind.JUMP, state=self._record.label, target=target, by=by, text=text,
                        data=data)
        self._node.records.count_oracle_edge(target)

    def _terminate(self, outcome: str) -> str:
        """Leave the meta state for a container outcome."""
        self._node.records.count_oracle_edge(outcome)
        return terminate(self._node, self._node.settings.oracle_label, outcome, outcome)
