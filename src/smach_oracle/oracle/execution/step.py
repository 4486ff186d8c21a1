"""The end of a visit, off the short way of a plain success in container.py.

A state has ended. `Step.ended` judges how, makes an occasion of a failure, and goes to the oracle
with it (paper, section IV-A).
"""

from typing import Any, Mapping, Optional, Union, cast

import smach
from smach_common.foreign import repr_of

from ..asking.question import AnswerKind
from ..decision.failure_rate import FailureClass
from ..decision.policy import FailureContext
from ..machine.execution import ends_program
from ..machine.oracle import save_rates
from ..machine.places import failure_context
from ..machine.resumed import Unfinished
from ..machine.site import Route
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..machine.workers import Overrun, recall_preempts
from ..records.events import EventKind, FailureKind
from ..records.facts import LEFT, STOPPING, TAKEN_UP, UNCOUNTED
from ..records.visits import VisitResult
from ..recovery import occasions
from ..recovery.failure import (
    Announced,
    Failure,
    announced_by,
    judge,
    tell_failure,
    with_earlier_end,
)
from ..recovery.guarding import keeps_authors_way, may_stop_others
from ..recovery.occasions import FirstStep, Occasion
from ..recovery.phases import OracleState
from ..recovery.recovery import Recovery
from ..recovery.stack_room import too_deep_below, too_deep_here
from ..recovery.still_running import EndedByAnswer
from ..recovery.stop import note_end_under_preempt, note_stop_of_part, winds_down
from ..recovery.verdict import (
    ContainerEnding,
    Departure,
    Preempted,
    Verdict,
    arrives_at,
    leaving_outcome,
    natural_ending,
    preempted_ending,
)
from ..scope.scope import Reason
from ..settings.failing_outcomes import is_preempted, name_text
from ..smach_private import has_preempt_flag, lock_of, states_of, transitions_of
from .applying import Applying
from .departure import depart, is_settled, take_departure
from .transitions import Stop, be_back, go_to, message_of, obey_preempt, stop_left_behind, terminate
from .wrapping import sync_oracle

Facts = Mapping[str, object]
NO_FACTS: Facts = {}
OWN_LOOP = (
    'keeps failing: its author leads it from {} to {}, and back again. The oracle leaves that to '
    'its author. `author_recoveries: override` has the oracle recover'
)


def _facts_of(occasion: Occasion, label: str) -> Facts:
    """Return further fields of the event with which a state gives way to the oracle."""
    failure = occasion.failure
    if failure.state == label:
        return NO_FACTS if occasion.departure is None else LEFT
    told = [failure.state, int(failure.kind), failure.outcome, failure.text]
    return {'text': 'reports a failure of ' + failure.state, 'data': {TAKEN_UP: told}}


class Step:
    """The end of one visit of a state."""

    __slots__ = ('_node', '_machine', '_record')

    def __init__(self, node: TreeNode, record: StateRecord) -> None:
        self._node = node
        self._machine = node.machine
        self._record = record

    def ended(self, outcome: object, error: Optional[Exception]) -> Optional[str]:
        """Go on after the state has ended, through the oracle where it failed.

        It returns the container's outcome, or None where the machine goes on.

        :raises InvalidUserCodeError: as the machine would without an oracle.
        :raises InvalidTransitionError: likewise.
        :raises TooDeepError: where too many containers lie in each other.
        """
        follows = self._what_follows(outcome, error)
        return follows.outcome if isinstance(follows, Stop) else self._visit_oracle(follows)

    def _what_follows(self, outcome: Any, error: Optional[Exception]) -> Union[Occasion, Stop]:
        """Return why the oracle is entered, or that the machine has gone on without it."""
        node, record = self._node, self._record
        if error is not None:
            top = node.top()
            too_deep = too_deep_below(error) or too_deep_here(top.machine, top.path, error)
            if too_deep is not None:
                node.execution.give_up()  # upstream's Concurrence drops what its states raise
                raise too_deep.with_traceback(None) from None
        node.tree.early_end.note_end_of_state()
        if node.execution.is_left_behind():
            return stop_left_behind(node)
        departure = take_departure(node)
        if departure is not None:
            return self._left(departure, outcome, error)
        if isinstance(outcome, EndedByAnswer):
            if node.execution.scope.reason is None:
                return self._ended_by_answer(outcome)
            outcome, error = outcome.outcome, outcome.error
        judged = judge(node, record, outcome, error)
        if isinstance(outcome, Unfinished):
            return self._unfinished(cast('Failure', judged), outcome)
        reason = node.execution.scope.reason
        stopping = reason is not None or ends_program(error)
        # a request that comes from here on has come after the end of the state
        if reason is Reason.PREEMPTED:
            node.execution.tell_preempt()
            note_end_under_preempt(
                node, record.label, outcome if isinstance(judged, Route) else None
            )
        is_part = (
            not (stopping or isinstance(outcome, Overrun))  # which the oracle has asked to stop
            and (isinstance(judged, Failure) or is_preempted(outcome))
            and note_stop_of_part(node, record.label)
        )
        announced = None if stopping or is_part else announced_by(node, record, outcome, judged)
        if announced is not None:
            return self._announced(outcome, announced)
        if isinstance(judged, Route):
            is_stopped = stopping or is_preempted(outcome)
            result = VisitResult.PREEMPTED if is_stopped else VisitResult.SUCCESS
            node.records.visit_ended(record, outcome, result)
            failing, listed = node.in_force.failing, record.settings.failure_outcomes
            may_fail = (
                outcome in failing
                or name_text(outcome) in listed
                # a state may have the name of a failing outcome
                or (not judged.is_state and judged.target in failing)
            )
            learn = result is VisitResult.SUCCESS and not may_fail
            facts = self._facts_of_stop(outcome) if stopping else NO_FACTS
            return self._advance(outcome, judged, learn, facts)
        stopping = stopping or winds_down(node)
        if judged.is_held_back:
            return self._held_back(judged, stopping)
        if stopping or is_part:
            node.records.visit_ended(record, judged.outcome, VisitResult.PREEMPTED)
            return self._end_preempted(judged)
        keeps_way = node.tree.recover and keeps_authors_way(node, judged, record.settings)
        why = None
        looks = node.tree.recover and node.tree.health.is_set
        # not where others are to stop at once
        if looks and not (keeps_way and may_stop_others(node, record.settings)):
            why = self._why_unwell()
        if node.execution.is_left_behind():
            return stop_left_behind(node)
        if why is not None:
            return self._failed_unwell(judged, keeps_way, why)
        return self._failed(judged, keeps_way)

    # -- why the oracle is entered

    def _left(
        self, departure: Departure, outcome: object, error: Optional[Exception]
    ) -> Union[Occasion, Stop]:
        """Go as a verdict of a container below says, which has left the present state."""
        node, record = self._node, self._record
        told = outcome if isinstance(outcome, str) else ''
        if isinstance(outcome, Overrun):
            node.warn(
                'was left for a state of another container, and {}'.format(outcome.text),
                record.label,
            )
        if error is not None:
            self._warn_raised(error, 'left')
        node.records.visit_ended(
            record, told, VisitResult.FAILURE if departure.is_own(node) else VisitResult.PREEMPTED
        )
        recall_preempts(states_of(self._machine)[record.label])
        if departure.arrives_at is not node:
            return self._advance(told, Route(leaving_outcome(node), False), facts=LEFT)
        failure = Failure(
            record.label,
            FailureKind.TIME_LIMIT,
            told,
            'was left, as {} failed'.format(departure.failed_path),
        )
        return occasions.arrived(failure, self._context(), departure, told, departure.is_own(node))

    def _warn_raised(self, error: Exception, when: str) -> None:
        smach.logwarn(
            '{}/{}: raised {} when it was {}'.format(
                self._node.path, self._record.label, repr_of(error), when
            )
        )

    def _ended_by_answer(self, taken: EndedByAnswer) -> Occasion:
        """Go as an expert has answered while the state still ran. What it ended with is nothing."""
        record, answer = self._record, taken.answer
        recall_preempts(states_of(self._machine)[record.label])
        if taken.error is not None:
            self._warn_raised(taken.error, 'preempted')
        outcome = taken.outcome if isinstance(taken.outcome, str) else ''
        self._node.records.visit_ended(
            record,
            outcome,
            VisitResult.SUPERSEDED
            if answer.kind is AnswerKind.SUPERSEDE
            else VisitResult.PREEMPTED,
        )
        return occasions.ended_by_answer(taken.failure, self._context(), answer, outcome)

    def _held_back(self, failure: Failure, stopping: bool) -> Union[Occasion, Stop]:
        """Go on at a state that is not to be repeated: that was no visit, and teaches nothing."""
        node = self._node
        if stopping:
            recall_preempts(states_of(self._machine)[failure.state])  # it services none
            return self._end_preempted(failure)
        # if resumed, nobody has said whether it was done before the program stopped
        return occasions.failed(failure, self._context())._replace(keeps=node.tree.is_resumed)

    def _unfinished(self, failure: Failure, before: Unfinished) -> Union[Occasion, Stop]:
        """Go on with a visit that was begun before the program was stopped.

        It teaches nothing. A failure from before is counted and told already.
        """
        node, record = self._node, self._record
        if node.tree.early_end.end_at_shutdown():
            return stop_left_behind(node)
        if node.execution.scope.reason is not None:
            return self._end_preempted(failure)
        if failure.kind is FailureKind.INTERRUPTED:
            tell_failure(node, record, failure)
        return occasions.interrupted(failure, self._context(), before)

    def _why_unwell(self) -> Optional[str]:
        """Return why the robot was not well when the state has just failed, None where it was.

        It looks for the settle time. Where a preempt or a shutdown comes meanwhile, it returns '':
        nothing is a failure then.
        """
        scope = self._node.execution.scope
        lock = lock_of(self._machine)
        lock.release()
        try:
            why = self._node.tree.health.unwell_after(scope)
        finally:
            lock.acquire()
        return '' if scope.reason is not None else why or None

    def _failed_unwell(self, failure: Failure, keeps_way: bool, why: str) -> Union[Occasion, Stop]:
        """Go on after a failure while the robot was not well: it is not counted.

        Such a visit is no visit: it is in no history, no rate and no count, and the observers are
        told of no failure, transition or jump. They are told that the machine waits.

        `keeps_way`: see `_failed`. `why`: see `_why_unwell`.
        """
        node, record = self._node, self._record
        if keeps_way:
            if not why:
                node.records.visit_ended(record, failure.outcome, VisitResult.PREEMPTED)
            return self._end(failure, natural_ending(node, failure), UNCOUNTED if why else NO_FACTS)
        if why and record.unwell_repeats >= record.most_repeats:
            return self._failed(failure, keeps_way, why)
        if not why:  # a request came after the state's end: the meta state services it
            recall_preempts(states_of(self._machine)[record.label])
        return occasions.unwell(failure, self._context(), why)

    def _failed(
        self, failure: Failure, keeps_way: bool, why_unwell: str = ''
    ) -> Union[Occasion, Stop]:
        """Count the failure and recover from it.

        `keeps_way`: it goes as its author drew it. `why_unwell`: the robot is not well.
        """
        node, record = self._node, self._record
        state = states_of(self._machine)[record.label]
        if node.tree.recover and isinstance(state, smach.Container):
            recall_preempts(state)  # a Concurrence that has failed has preempted its branches
        context = self._context()
        node.records.note_failure(record)
        continuous = node.in_force.policy.is_continuous(context)
        tell_failure(node, record, failure, continuous)
        record.learn(True)
        record.last_failure = failure.kind, failure.outcome, failure.text
        node.records.visit_ended(record, failure.outcome, VisitResult.FAILURE)
        if not node.tree.recover or keeps_way:
            node.site.tell_item_passed_over(failure.state, failure.outcome)
            if node.tree.recover and failure.route is not None:
                self._tell_own_loop(failure.outcome, failure.route)
            return self._end(failure, natural_ending(node, failure))
        failure = with_earlier_end(node, failure)
        if is_settled(node, failure):
            ending = natural_ending(node, failure)
            if ending.state is None:
                node.execution.give_up()
            return self._end(failure, ending)
        asked = node.tree.resumed.take_asked(node.records, record)
        if asked is not None:
            return occasions.interrupted(failure, context, asked, continuous)
        if why_unwell:
            return occasions.often_unwell(failure, context, continuous, why_unwell)
        return occasions.failed(failure, context, continuous)

    def _announced(self, outcome: str, announced: Announced) -> Union[Occasion, Stop]:
        """Recover from an earlier failure, which is counted. This state only reports it."""
        node, failure, context = self._node, announced.failure, announced.context
        node.records.visit_ended(self._record, outcome, VisitResult.SUCCESS)
        if not node.tree.recover:
            return self._advance(outcome, announced.route)
        continuous = node.in_force.policy.is_continuous(context)
        return occasions.announced(
            failure, context, continuous, by=outcome, visits_since=announced.visits_since
        )

    def _context(self) -> FailureContext:
        """Return what the visits so far say about a failure of the state."""
        return failure_context(self._node, self._record)

    def _tell_own_loop(self, outcome: str, route: Route) -> None:
        """Say, once in a trial, that the state keeps failing on the way that its author drew."""
        node, record = self._node, self._record
        if record.failure_class is not FailureClass.HIGH:
            return
        if node.records.history.keeps_failing(record.label):
            node.warn_once('own loop', OWN_LOOP.format(outcome, route.target), record.label)

    # -- without the oracle

    def _end_preempted(self, failure: Failure) -> Stop:
        """End the container by a failure while a preempt or a shutdown is under way.

        An overrun, and a state that was held back, go as preempted ones, all else as it would.
        """
        node, facts = self._node, self._facts_of_stop(failure.outcome)
        if failure.kind not in (FailureKind.TIME_LIMIT, FailureKind.HELD_BACK):
            return self._end(failure, natural_ending(node, failure), facts)
        ending = preempted_ending(node, failure)
        if ending.obeys:
            obey_preempt(node, states_of(self._machine)[failure.state])
        return self._end(failure, ending, facts)

    def _facts_of_stop(self, outcome: str) -> Facts:
        """Return what the TRANSITION of a state says that has ended under a preempt or a shutdown.

        Its outcome, or a PREEMPT of its container, may say it, too.
        """
        is_told = self._machine.preempt_requested() or is_preempted(outcome)
        return NO_FACTS if is_told else STOPPING

    def _end(self, failure: Failure, ending: ContainerEnding, facts: Facts = NO_FACTS) -> Stop:
        if ending.error is not None:
            if isinstance(ending.error, smach.InvalidUserCodeError):
                smach.logerr("State '{}' ended in an error.".format(self._record.label))
            raise ending.error
        target = ending.outcome if ending.state is None else ending.state
        route = Route(cast('str', target), ending.state is not None)
        return self._advance(failure.outcome, route, facts=facts)

    def _advance(
        self,
        outcome: str,
        route: Route,
        learn: bool = False,
        facts: Facts = NO_FACTS,
    ) -> Stop:
        """Make the transition that the author drew. `learn`: take the short way next time.

        `facts`: further fields of the event.
        """
        node, label = self._node, self._record.label
        self._record.left_by(outcome, route.target)
        node.emit(EventKind.TRANSITION, state=label, outcome=outcome, target=route.target, **facts)
        message = message_of(label, outcome, route.target) if route.is_state else ''
        if learn:
            drawn = transitions_of(self._machine)[label].get(outcome)
            node.records.add_edge(self._record, outcome, route.target, drawn, message)
        if not message:
            return Stop(terminate(node, label, outcome, route.target))
        go_to(node, message, route.target)
        return Stop()

    # -- the oracle

    def _visit_oracle(self, occasion: Occasion) -> Optional[str]:
        """Enter the meta state, recover, and go as the verdict says.

        It returns the container's outcome, or None where the machine goes on. Where the oracle
        gives up, it raises what the machine would raise without one.
        """
        node, machine = self._node, self._machine
        meta = self._enter_oracle(occasion)
        lock = lock_of(machine)
        record = node.record(occasion.failure.state)  # or an earlier one, which this one reports
        try:
            recovery = Recovery(node, record, occasion)
            meta.begin(recovery)
            if has_preempt_flag(machine):
                meta.request_preempt()  # it came from a callback on the way here
            verdict: Optional[Verdict] = None
            lock.release()
            try:
                meta.execute(machine.userdata)
                verdict = self._in_time(occasion, meta.take_verdict())
            finally:
                lock.acquire()
                recovery.settle(verdict)
            return Applying(recovery, meta, self._record.label).apply(verdict)
        except BaseException:
            be_back(node, self._record.label)
            raise

    def _enter_oracle(self, occasion: Occasion) -> OracleState:
        node, record, meta_label = self._node, self._record, self._node.settings.oracle_label
        occasions.log_occasion(occasion, '/'.join((node.path, occasion.failure.state)))
        sync_oracle(node)
        if occasion.first_step is not FirstStep.ENTER_AGAIN:
            record.left_by(occasion.what, meta_label)
            save_rates(node)
            facts = _facts_of(occasion, record.label)
            node.emit(EventKind.TRANSITION, record.label, occasion.outcome, meta_label, **facts)
        # sync_oracle refuses any other state of this name
        meta = cast('OracleState', states_of(self._machine)[meta_label])
        go_to(node, message_of(record.label, occasion.what, meta_label), meta_label)
        return meta

    def _in_time(self, occasion: Occasion, verdict: Verdict) -> Verdict:
        """Return a verdict, or what comes before it: the trial's early end, another departure."""
        node = self._node
        if node.tree.early_end.why is not None:
            return Preempted()
        level = arrives_at(verdict)
        if level is None or level is node or depart(node, self._record.label, verdict, level):
            return verdict
        # another one, of a branch beside, leaves the container
        return Preempted(ContainerEnding(outcome=leaving_outcome(node, occasion.failure)))
