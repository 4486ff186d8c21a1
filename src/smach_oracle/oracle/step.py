"""What happens around the execution of a state, off the short way that a plain success takes (container.py)."""
from typing import Any, Optional

import smach

from .events import EventKind, FailureKind
from .failure import Ending, Failure, Route, author_recovers, natural_ending, route_of, visit_result
from .judging import Overrun, in_words, judge
from .ledger import Ledger
from .naming import PREEMPTED
from .question import VisitResult
from .recovery import Recovery
from .state_record import StateRecord
from .userdata import Gate, behind, keys_after_jump, missing_keys, restore, view_of
from .verdict import Verdict, VerdictKind


def before_step(machine: Any, ledger: Ledger) -> None:
    """Before the first state of an execution, and before any state under a preempt request.

    Under a request the state is preempted too, unless the last one has serviced the request.
    """
    if not ledger.stepped:
        ledger.begin_stepping()
    if not machine.preempt_requested():
        return
    if ledger.lock_is_held:
        _pass_on(machine, ledger)
    else:
        with machine._state_transitioning_lock:
            _pass_on(machine, ledger)


def _pass_on(machine: Any, ledger: Ledger) -> None:
    ledger.tell_preempt()
    last = machine._preempted_state
    if last is not None and not last.preempt_requested():
        machine._preempt_requested = False
        machine._preempted_state = machine._preempted_label = None
        ledger.preempt_told = False
        return
    if last is not None:
        last.recall_preempt()
    machine._preempted_state = machine._current_state
    machine._preempted_label = machine._current_label
    machine._is_preempt_passed_on = True  # to our engine: who asked, and now waits for the lock, need not ask again
    machine._current_state.request_preempt()


def execute_watched(machine: Any, ledger: Ledger, record: StateRecord, state: Any) -> Any:
    """Execute a state where more is to be done than to execute it; return its outcome, or an Overrun.

    Raises what the state raises.
    """
    if ledger.deep_copy_keys:
        record.snapshot = ledger.snapshot()
    ledger.emit(EventKind.STATE_START, state=record.label)
    blocked = ledger.tree.workers.blocked(state)
    if blocked:
        return Overrun(blocked)
    if record.settings.time_limit_s is not None and ledger.tree.recover:
        return _execute_limited(machine, ledger, record, state)
    return state.execute(record.view.remapper)


def _execute_limited(machine: Any, ledger: Ledger, record: StateRecord, state: Any) -> Any:
    """Execute a state in a worker; return its outcome, or an Overrun. Raises what it raises."""
    def on_late_write(key: str) -> None:
        smach.logwarn('{}/{}: a write to userdata key {!r} came after the time limit and is dropped'.format(
            ledger.path, record.label, key))

    def make_view(gate: Gate) -> Any:
        return view_of(machine, record.label, state, behind(gate))

    result = ledger.tree.workers.run(state, make_view, Gate(machine, on_late_write), record.label,
                                     record.settings.time_limit_s or 0.0, record.settings.grace_period_s)
    if result.error is not None:
        raise result.error
    return Overrun(result.overrun) if result.overrun else result.outcome


def ended(machine: Any, ledger: Ledger, record: StateRecord, outcome: Any,
          error: Optional[Exception] = None) -> Optional[str]:
    """Go on after a state has ended: to the next state (None), to the container's outcome, or through the oracle.

    Raises InvalidUserCodeError and InvalidTransitionError as the machine would without an oracle.
    """
    judged = judge(machine, ledger, record, outcome, error)
    stopping = machine.preempt_requested() or smach.is_shutdown()
    if machine.preempt_requested():
        ledger.tell_preempt()
    if isinstance(judged, Route):
        result = visit_result(outcome, FailureKind.NOT_A_FAILURE, stopping)
        ledger.visit_ended(record, outcome, result)
        return advance(machine, ledger, record, outcome, judged, learn=result is VisitResult.SUCCESS)
    if stopping:
        ledger.visit_ended(record, judged.outcome, VisitResult.PREEMPTED)
        return _end_unrecovered(machine, ledger, record, _preempted_ending(machine, ledger, judged), judged)
    return _failed(machine, ledger, record, judged)


def _failed(machine: Any, ledger: Ledger, record: StateRecord, failure: Failure) -> Optional[str]:
    chain = ledger.chain(record)
    continuous = ledger.policy.is_continuous(chain)
    ledger.tell_failure(failure, record.rate, record.failure_class, continuous)
    record.learn(True)
    ledger.visit_ended(record, failure.outcome, VisitResult.FAILURE)
    kept = failure.route is not None and author_recovers(
        failure.outcome, failure.route, failure.kind, record.settings.failure_outcomes,
        record.settings.author_recoveries)
    if kept or not ledger.tree.recover:
        ending = natural_ending(failure, machine.get_registered_outcomes(), ledger.failing)
        return _end_unrecovered(machine, ledger, record, ending, failure)
    _enter_oracle(machine, ledger, record, failure)
    verdict = _recover(machine, Recovery(ledger, record, failure, chain, continuous))
    if verdict.kind is VerdictKind.SUPERSEDE:
        record.take_back_failure()
        ledger.history.supersede(verdict.outcome)
    return _leave_oracle(machine, ledger, record, verdict)


def _enter_oracle(machine: Any, ledger: Ledger, record: StateRecord, failure: Failure) -> None:
    label, meta = record.label, ledger.settings.oracle_label
    what = failure.outcome or failure.kind.name.lower()
    smach.logwarn('{}/{} failed: {}'.format(ledger.path, label, failure.details or in_words(failure)))
    record.left_by(what, meta)
    ledger.save_rates()
    machine._sync_oracle()
    ledger.emit(EventKind.TRANSITION, state=label, outcome=failure.outcome, target=meta)
    machine._set_current_state(meta)
    smach.loginfo("State machine transitioning '{}':'{}'-->'{}'".format(label, what, meta))
    machine.call_transition_cbs()


def _recover(machine: Any, recovery: Recovery) -> Verdict:
    meta = machine._current_state
    meta.begin(recovery)
    if machine._preempt_requested:
        meta.request_preempt()  # it came from a callback on the way here
    lock = machine._state_transitioning_lock
    lock.release()
    try:
        meta.execute(machine.userdata)
    finally:
        lock.acquire()
    verdict: Verdict = meta.verdict
    return verdict


def _leave_oracle(machine: Any, ledger: Ledger, record: StateRecord, verdict: Verdict) -> Optional[str]:
    if verdict.kind is VerdictKind.JUMP:
        _jump(machine, ledger, record, verdict)
        return None
    if verdict.kind is VerdictKind.SUPERSEDE:
        route = route_of(machine, record.label, verdict.outcome)
        ledger.emit(EventKind.SUPERSEDE, state=record.label, outcome=verdict.outcome, target=route.target,
                    by=verdict.by, text=verdict.text)
        if route.is_state:
            _go_on(machine, ledger, record, route.target, by=verdict.by)
            return None
        return _terminate_from_oracle(machine, ledger, route.target)
    if verdict.kind is VerdictKind.PREEMPTED:
        return _preempted_in_oracle(machine, ledger, record, verdict)
    return _give_up(machine, ledger, record, verdict.ending, verdict.by, verdict.text)


def _jump(machine: Any, ledger: Ledger, record: StateRecord, verdict: Verdict) -> None:
    snapshot = ledger.record(verdict.state).snapshot
    missing = missing_keys(machine, verdict.state, keys_after_jump(ledger, verdict.state, verdict.written))
    restores = snapshot if ledger.settings.userdata == 'restore' else None
    if restores is not None:
        restore(machine.userdata._data, restores, verdict.written, ledger.deep_copy_keys)
    if missing:
        ledger.warn('jumping there without its input keys {}'.format(', '.join(missing)), verdict.state)
    _go_on(machine, ledger, record, verdict.state, 'keep' if restores is None else 'restore', missing, verdict.by,
           verdict.text)


def _go_on(machine: Any, ledger: Ledger, record: StateRecord, target: str, userdata: str = 'keep',
           missing: Optional[Any] = None, by: str = '', text: str = '') -> None:
    """Leave the meta state for a state."""
    if missing is None:
        missing = missing_keys(machine, target, machine.userdata._data)
    ledger.emit(EventKind.JUMP, state=record.label, target=target, by=by, text=text,
                data={'missing_keys': list(missing), 'userdata': userdata})
    ledger.count_oracle_edge(target)
    machine._set_current_state(target)
    smach.loginfo("State machine transitioning '{}':'{}'-->'{}'".format(ledger.settings.oracle_label, target, target))
    machine.call_transition_cbs()


def _give_up(machine: Any, ledger: Ledger, record: StateRecord, ending: Ending, by: str, text: str) -> Optional[str]:
    told = '{}; {}'.format(text, ending.error) if ending.error is not None else text
    ledger.emit(EventKind.GIVE_UP, state=record.label, outcome=ending.outcome or '', target=ending.state or '', by=by,
                text=told)
    if ending.error is not None:
        smach.logerr(str(ending.error))
        raise ending.error
    if ending.state is not None:
        _go_on(machine, ledger, record, ending.state, by=by, text=text)
        return None
    return _terminate_from_oracle(machine, ledger, str(ending.outcome))


def _preempted_in_oracle(machine: Any, ledger: Ledger, record: StateRecord, verdict: Verdict) -> Optional[str]:
    ending, meta = verdict.ending, machine._current_state
    if machine.preempt_requested():
        ledger.tell_preempt()
    if ending.state is not None:  # the author's own transition: the request goes on to that state
        _go_on(machine, ledger, record, ending.state)
        return None
    meta.service_preempt()
    machine.service_preempt()
    if ending.error is not None:
        raise ending.error
    return _terminate_from_oracle(machine, ledger, str(ending.outcome))


def _terminate_from_oracle(machine: Any, ledger: Ledger, outcome: str) -> str:
    ledger.count_oracle_edge(outcome)
    return terminate(machine, ledger.settings.oracle_label, outcome, outcome)


def advance(machine: Any, ledger: Ledger, record: StateRecord, outcome: str, route: Route,
            learn: bool = False) -> Optional[str]:
    """Make the transition that the author drew; `learn`: take the short way next time."""
    label = record.label
    record.left_by(outcome, route.target)
    ledger.emit(EventKind.TRANSITION, state=label, outcome=outcome, target=route.target)
    if not route.is_state:
        return terminate(machine, label, outcome, route.target)
    message = "State machine transitioning '{}':'{}'-->'{}'".format(label, outcome, route.target)
    if learn:
        ledger.add_edge(record, outcome, route, message)
    machine._set_current_state(route.target)
    smach.loginfo(message)
    machine.call_transition_cbs()
    return None


def terminate(machine: Any, label: str, outcome: str, container_outcome: str) -> str:
    """End the container; a preempt that its last state has serviced is serviced."""
    last = machine._current_state
    if machine._preempt_requested and not last.preempt_requested() and (
            machine._preempted_state is not None or container_outcome == PREEMPTED):
        machine.service_preempt()
    machine._set_current_state(None)
    smach.loginfo("State machine terminating '{}':'{}':'{}'".format(label, outcome, container_outcome))
    machine.call_termination_cbs([label], container_outcome)
    return container_outcome


def _preempted_ending(machine: Any, ledger: Ledger, failure: Failure) -> Ending:
    """An overrun while a preempt or a shutdown is under way ends the container as preempted, all else as it would."""
    registered = machine.get_registered_outcomes()
    if failure.kind is FailureKind.TIME_LIMIT and PREEMPTED in registered:
        return Ending(outcome=PREEMPTED)
    return natural_ending(failure, registered, ledger.failing)


def _end_unrecovered(machine: Any, ledger: Ledger, record: StateRecord, ending: Ending,
                     failure: Failure) -> Optional[str]:
    if ending.error is not None:
        if isinstance(ending.error, smach.InvalidUserCodeError):
            smach.logerr("State '{}' ended in an error.".format(record.label))
        raise ending.error
    route = Route(ending.state, True) if ending.state is not None else Route(str(ending.outcome), False)
    return advance(machine, ledger, record, failure.outcome, route)
