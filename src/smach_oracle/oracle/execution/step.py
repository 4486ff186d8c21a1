"""The work around a state, off the short way of a plain success in container.py."""

from time import monotonic
from typing import Any, Mapping, Optional

import smach
from smach_oracle.foreign import repr_of

from ..asking.question import AnswerKind
from ..branches.passed_over import tell_passed_over
from ..decision.policy import FailureContext
from ..machine.execution import ends_program
from ..machine.repeats import note_visit
from ..machine.resumed import Unfinished
from ..machine.snapshots import UserdataGate
from ..machine.tree_node import TreeNode
from ..machine.userdata_view import view_behind
from ..machine.workers import recall_preempts
from ..places.stepping_back import failure_context
from ..records.events import EventKind, FailureKind
from ..records.facts import LEFT, UNCOUNTED
from ..records.state_record import StateRecord
from ..records.visits import VisitResult
from ..recovery import occasions
from ..recovery.failure import (
    ContainerEnding,
    Failure,
    Route,
    author_recovers,
    leaving_outcome,
    natural_ending,
    preempted_ending,
    visit_result,
)
from ..recovery.judging import HeldBack, Overrun, judge
from ..recovery.stack_room import too_deep_below, too_deep_here
from ..recovery.still_running import TakenOut, WatchedVisit
from ..recovery.stop import note_end_under_preempt, winds_down
from .boundary import pass_boundary
from .departure import Departure, is_settled, take_departure
from .oracle_visit import visit_oracle
from .starting_over import keep_start
from .transitions import Stop, go_to, message_of, obey_preempt, stop_left_behind, terminate
from .unwell_failure import why_unwell_after

NO_FACTS: Mapping[str, Any] = {}
STATE_START = EventKind.STATE_START  # looked up once


def before_step(node: TreeNode) -> Optional[Stop]:
    """Before the first state of an execution, and before any state under a preempt request.

    Likewise before any state while an operator has a say. Under a request the state is preempted
    too, unless the last one has serviced the request.

    :returns: None where the state is executed now.
    """
    if node.engine.stepped:
        node.tree.control.calm(node.engine)
    else:
        node.begin_stepping()
        if node.tree.restarts.is_due:
            keep_start(node)
    if node.is_left_behind():
        stop_left_behind(node)
        return Stop()
    was_preempted = node.machine.preempt_requested()
    if was_preempted:
        _heed_preempt(node)
    is_drawn = node.records.take_drawn()
    return pass_boundary(node, was_preempted, is_drawn) if node.engine.attentive else None


def _heed_preempt(node: TreeNode) -> None:
    if node.engine.lock_is_held:
        _pass_preempt_on(node)
    else:
        with node.machine._state_transitioning_lock:
            _pass_preempt_on(node)


def _pass_preempt_on(node: TreeNode) -> None:
    machine = node.machine
    node.execution.tell_preempt()
    last = machine._preempted_state
    if last is not None and not last.preempt_requested():
        machine._preempt_requested = False
        machine._preempted_state = machine._preempted_label = None
        node.execution.note_no_preempt()
        return
    if last is not None:
        last.recall_preempt()
    current = machine._current_state
    machine._preempted_state = current
    machine._preempted_label = machine._current_label
    # to our engine: who asked, and now waits for the lock, need not ask again
    machine._is_preempt_passed_on = True
    if current is not None:
        current.request_preempt()


def execute_observed(
    node: TreeNode, record: StateRecord, state: smach.State, userdata: smach.Remapper
) -> object:
    """Execute a state of which observers hear, and about which nothing else is special.

    It returns what the state returns, and raises what it raises.
    """
    if node.tree.is_resumed:
        return Step(node, record).execute(state, userdata)
    node.events.emit(STATE_START, node.path, node.trial_id, record.label)
    begun_s = monotonic()
    try:
        return state.execute(userdata)
    finally:
        took_s = monotonic() - begun_s
        if took_s > (record.longest_s or 0.0) and not node.machine._preempt_requested:
            record.longest_s = took_s


class Step:
    """One visit of a state: its execution where more is to be done than that, and its end."""

    __slots__ = ('_node', '_machine', '_record')

    def __init__(self, node: TreeNode, record: StateRecord) -> None:
        self._node = node
        self._machine = node.machine
        self._record = record

    def execute(self, state: smach.State, userdata: smach.Remapper) -> object:
        """Execute the state, watched, and return its outcome, an Overrun, or that it is held back.

        It raises what the state raises. With a time limit it gets a view of its own, which is shut
        when the state overruns, in place of `userdata`.
        """
        node, record = self._node, self._record
        if node.tree.is_resumed:
            unfinished = node.tree.resumed.take_unfinished(node, record)
            if unfinished is not None:
                return unfinished
        entered_by_oracle, way_down = record.entered_by_oracle, record.way_down
        if entered_by_oracle or way_down:
            record.forget_entry()
        if node.in_force.deep_copy_keys:
            record.snapshot = node.snapshot()
        if node.tree.numbers_visits:
            why_not = note_visit(node, record)
            if why_not:
                return HeldBack(why_not)
        if way_down:
            node.execution.start_below(way_down)  # before STATE_START, with which it is stored
        try:
            node.emit(STATE_START, record.label)
            blocked = node.tree.workers.blocked(state) if node.abandoned else ''
            if blocked:
                return Overrun(blocked)
            begun_s = monotonic()
            outcome: object = None
            try:
                if record.settings.time_limit_s is not None and node.tree.recover:
                    outcome = self._execute_limited(state, record.settings.time_limit_s)
                elif entered_by_oracle:
                    outcome = WatchedVisit(node, record).execute(userdata)
                else:
                    outcome = state.execute(userdata)
                return outcome
            finally:
                took_s = monotonic() - begun_s
                if took_s > (record.longest_s or 0.0) and not (
                    isinstance(outcome, (Overrun, TakenOut)) or self._machine._preempt_requested
                ):
                    record.longest_s = took_s
        finally:
            if way_down:
                node.execution.start_below(())

    def _execute_limited(self, state: smach.State, limit_s: float) -> object:
        """Execute a state in a worker, as `execute` does."""
        node, label = self._node, self._record.label

        def on_late_write(key: str) -> None:
            if node.tree.is_new(node.path, label, 'late write', key):
                smach.logwarn(
                    '{}/{}: a write to userdata key {!r} came after the time limit and '
                    'is dropped'.format(node.path, label, key)
                )

        gate = UserdataGate(self._machine, on_late_write)
        result = node.tree.workers.run(
            state,
            view_behind(gate, self._machine, label, state),
            gate,
            label,
            limit_s,
            self._record.settings.grace_period_s,
        )
        if result.error is not None:
            raise result.error
        return Overrun(result.overrun) if result.overrun else result.outcome

    def ended(self, outcome: Any, error: Optional[Exception] = None) -> Optional[str]:
        """Go on after the state has ended, through the oracle where it failed.

        It returns the container's outcome, or None where the machine goes on.

        :raises InvalidUserCodeError: as the machine would without an oracle.
        :raises InvalidTransitionError: likewise.
        :raises TooDeepError: where too many containers lie in each other.
        """
        node, record = self._node, self._record
        if error is not None:
            too_deep = too_deep_below(error) or too_deep_here(node, error)
            if too_deep is not None:
                node.execution.give_up()  # upstream's Concurrence drops what its states raise
                raise too_deep.with_traceback(None) from None
        node.tree.early_end.note_end_of_state(smach.is_shutdown)
        if node.is_left_behind():
            stop_left_behind(node)
            return None
        if node.execution.departure is not None:
            departure = take_departure(node)
            if departure is not None:
                return self._left(departure, outcome, error)
        if isinstance(outcome, TakenOut):
            if not (self._machine.preempt_requested() or smach.is_shutdown()):
                return self._taken_out(outcome)
            outcome, error = outcome.outcome, outcome.error
        judged = judge(node, record, outcome, error)
        if isinstance(outcome, Unfinished) and isinstance(judged, Failure):
            return self._unfinished(judged, outcome)
        stopping = self._machine.preempt_requested() or smach.is_shutdown() or ends_program(error)
        if self._machine.preempt_requested():
            node.execution.tell_preempt()
            note_end_under_preempt(
                node, record.label, outcome if isinstance(judged, Route) else None
            )
        if isinstance(judged, Route):
            result = visit_result(outcome, FailureKind.NOT_A_FAILURE, stopping)
            node.records.visit_ended(record, outcome, result)
            return self._advance(outcome, judged, learn=result is VisitResult.SUCCESS)
        stopping = stopping or winds_down(node)
        if judged.is_held_back:
            return self._held_back(judged, stopping)
        if stopping:
            node.records.visit_ended(record, judged.outcome, VisitResult.PREEMPTED)
            return self._end_unrecovered(self._preempted_ending(judged), judged)
        if node.tree.recover and node.tree.health.is_set:
            why = why_unwell_after(node)
            if why is not None:
                return self._failed_unwell(judged, why)
        return self._failed(judged)

    def _left(
        self, departure: Departure, outcome: Any, error: Optional[Exception]
    ) -> Optional[str]:
        """Go as a verdict of a container below says, which has left the present state."""
        node, record = self._node, self._record
        told = outcome if isinstance(outcome, str) else ''
        if isinstance(outcome, Overrun):
            node.warn(
                'was left for a state of another container, and {}'.format(outcome.text),
                record.label,
            )
        if error is not None:
            smach.logwarn(
                '{}/{}: raised {} when it was left'.format(node.path, record.label, repr_of(error))
            )
        node.records.visit_ended(record, told, departure.result_of(node))
        if departure.arrives_at is not node:
            wanted = leaving_outcome(self._machine, node.in_force.failing, None)
            return self._advance(told, Route(wanted, False), facts=LEFT)
        if not isinstance(outcome, Overrun):  # what still runs goes on to be preempted
            recall_preempts(self._machine._states[record.label])
        failure = Failure(
            record.label,
            FailureKind.TIME_LIMIT,
            told,
            'was left, as {} failed'.format(departure.failed),
            None,
        )
        return self._recover(
            occasions.arrived(
                failure, self._context(), departure.from_below(), told, departure.is_own(node)
            )
        )

    def _held_back(self, failure: Failure, stopping: bool) -> Optional[str]:
        """Go on at a state that is not to be repeated: that was no visit, and teaches nothing."""
        node, record = self._node, self._record
        if stopping:
            recall_preempts(self._machine._states[record.label])  # it services none
            return self._end_unrecovered(self._preempted_ending(failure), failure)
        if node.tree.is_resumed:  # nobody has said whether it was done before the program stopped
            return self._recover(
                occasions.interrupted(
                    failure,
                    self._context(),
                    Unfinished(failure.kind, '', failure.text, failure.text),
                )
            )
        return self._recover(occasions.failed(failure, self._context()))

    def _unfinished(self, failure: Failure, before: Unfinished) -> Optional[str]:
        """Go on with a visit that was begun before the program was stopped.

        It teaches nothing. A failure from before is counted and told already.
        """
        node, record = self._node, self._record
        if node.tree.early_end.end_at_shutdown(bool(smach.is_shutdown())):
            stop_left_behind(node)
            return None
        if self._machine.preempt_requested() or smach.is_shutdown():
            return self._end_unrecovered(self._preempted_ending(failure), failure)
        if failure.kind is FailureKind.INTERRUPTED:
            node.emit_rated(
                EventKind.FAILURE, record, failure_kind=int(failure.kind), text=failure.text
            )
        return self._recover(occasions.interrupted(failure, self._context(), before))

    def _failed_unwell(self, failure: Failure, why: str) -> Optional[str]:
        """Go on after a failure while the robot was not well. `why`: see `why_unwell_after`."""
        node, record = self._node, self._record
        if node.is_left_behind():
            stop_left_behind(node)
            return None
        if self._author_recovers(failure):
            if not why:
                node.records.visit_ended(record, failure.outcome, VisitResult.PREEMPTED)
            return self._end_unrecovered(
                self._natural_ending(failure), failure, UNCOUNTED if why else NO_FACTS
            )
        if why and record.unwell_repeats >= record.most_repeats:
            return self._failed(failure, why)
        state = self._machine._states[record.label]
        if not why and state.preempt_requested():
            recall_preempts(state)  # it came after the state's end: the meta state services it
        return self._recover(occasions.unwell(failure, self._context(), why))

    def _context(self) -> FailureContext:
        """Return what the visits so far say about a failure of the state."""
        return failure_context(self._node, self._record)

    def _failed(self, failure: Failure, why_unwell: str = '') -> Optional[str]:
        """Count the failure and recover from it. `why_unwell`: the robot is not well."""
        node, record = self._node, self._record
        state = self._machine._states[record.label]
        if (
            node.tree.recover
            and failure.kind is not FailureKind.TIME_LIMIT
            and isinstance(state, smach.Container)
        ):
            # a Concurrence that has failed has preempted its branches. One that overran still runs
            recall_preempts(state)
        context = self._context()
        node.records.note_failure(record)
        continuous = node.in_force.policy.is_continuous(context)
        # rate and class are those before this failure is counted
        node.emit_rated(
            EventKind.FAILURE,
            record,
            outcome=failure.outcome,
            failure_kind=int(failure.kind),
            continuous=continuous,
            text=failure.text,
        )
        record.learn(True)
        node.records.visit_ended(record, failure.outcome, VisitResult.FAILURE)
        if not node.tree.recover or self._author_recovers(failure):
            tell_passed_over(node, failure)
            return self._end_unrecovered(self._natural_ending(failure), failure)
        if is_settled(node, failure):
            return self._end_settled(failure)
        asked = node.tree.resumed.take_asked(node, record) if node.tree.is_resumed else None
        if asked is not None:
            return self._recover(occasions.interrupted(failure, context, asked, continuous))
        if why_unwell:
            return self._recover(occasions.often_unwell(failure, context, continuous, why_unwell))
        return self._recover(occasions.failed(failure, context, continuous))

    def _recover(self, occasion: occasions.Occasion) -> Optional[str]:
        return visit_oracle(self._node, self._record, occasion)

    def _end_settled(self, failure: Failure) -> Optional[str]:
        """End the container by a failure that has had its account further below."""
        ending = self._natural_ending(failure)
        if ending.state is None:
            self._node.execution.give_up()
        return self._end_unrecovered(ending, failure)

    def _taken_out(self, taken: TakenOut) -> Optional[str]:
        """Go as an expert has answered while the state still ran. What it ended with is nothing."""
        node, record, answer = self._node, self._record, taken.answer
        recall_preempts(self._machine._states[record.label])
        if taken.error is not None:
            smach.logwarn(
                '{}/{}: raised {} when it was preempted'.format(
                    node.path, record.label, repr_of(taken.error)
                )
            )
        outcome = taken.outcome if isinstance(taken.outcome, str) else ''
        node.records.visit_ended(
            record,
            outcome,
            VisitResult.SUPERSEDED
            if answer.kind is AnswerKind.SUPERSEDE
            else VisitResult.PREEMPTED,
        )
        return self._recover(occasions.taken_out(taken.failure, self._context(), answer, outcome))

    def _author_recovers(self, failure: Failure) -> bool:
        settings = self._record.settings
        branch = self._node.branch
        if branch is not None:
            return (
                failure.route is not None
                and settings.author_recoveries != 'override'
                and branch.foresees(self._node, failure.outcome)
            )
        return failure.route is not None and author_recovers(
            failure.outcome,
            failure.route,
            failure.kind,
            settings.failure_outcomes,
            settings.author_recoveries,
        )

    def _natural_ending(self, failure: Failure) -> ContainerEnding:
        return natural_ending(
            failure, self._machine.get_registered_outcomes(), self._node.in_force.failing
        )

    def _preempted_ending(self, failure: Failure) -> ContainerEnding:
        """Return how a failure ends the container while a preempt or a shutdown is under way.

        An overrun, and a state that was held back, go as preempted ones, all else as it would.
        """
        if failure.kind not in (FailureKind.TIME_LIMIT, FailureKind.HELD_BACK):
            return self._natural_ending(failure)
        ending = preempted_ending(self._node, failure)
        if ending.obeys:
            obey_preempt(self._node, self._machine._states[failure.state])
        return ending

    def _end_unrecovered(
        self, ending: ContainerEnding, failure: Failure, facts: Mapping[str, Any] = NO_FACTS
    ) -> Optional[str]:
        if ending.error is not None:
            if isinstance(ending.error, smach.InvalidUserCodeError):
                smach.logerr("State '{}' ended in an error.".format(self._record.label))
            raise ending.error
        route = (
            Route(ending.state, True)
            if ending.state is not None
            else Route(str(ending.outcome), False)
        )
        return self._advance(failure.outcome, route, facts=facts)

    def _advance(
        self, outcome: str, route: Route, learn: bool = False, facts: Mapping[str, Any] = NO_FACTS
    ) -> Optional[str]:
        """Make the transition that the author drew. `learn`: take the short way next time.

        `facts`: further fields of the event.
        """
        node, label = self._node, self._record.label
        self._record.left_by(outcome, route.target)
        node.emit(EventKind.TRANSITION, state=label, outcome=outcome, target=route.target, **facts)
        if not route.is_state:
            return terminate(node, label, outcome, route.target)
        message = message_of(label, outcome, route.target)
        if learn:
            node.records.add_edge(self._record, outcome, route.target, message)
        go_to(node, message, route.target)
        return None
