"""States with a time limit: preempted, given grace, abandoned, blocked while their thread lives."""

import threading
import time
from typing import List

import pytest
from fake_clock import FakeClock
from machines import (
    FakeExpert,
    Gate,
    Scripted,
    Watched,
    chain_of,
    contents,
    goto,
    in_thread,
    supersede,
    watched,
)
from test_preempt_and_shutdown import NotesOnly
from waiting import wait_for

import smach
import smach_oracle.oracle.machine.workers as worker
from smach_oracle.oracle.records.events import EventKind, FailureKind
from smach_oracle.oracle.scope.scope import Scope

LIMITED = {'time_limit_s': 30.0, 'grace_period_s': 5.0}
ABANDONING = {'time_limit_s': 30.0, 'grace_period_s': 0.1}
BRIEF_S = 0.1  # a limit that is waited for in full, by a state which never ends before


class LimitClock(FakeClock):
    """The time that the executive gives to states: what it waits for is over once a test allows it.

    Nothing depends on how busy the machine is, and no second is waited for in full.
    """

    def __init__(self, monkeypatch):
        FakeClock.__init__(self)
        self._over: List[threading.Event] = []
        monkeypatch.setattr(
            worker, 'Scope', lambda *around, **of: Scope(*around, **{**of, 'clock': self})
        )

    def end(self, waits, once):
        """Let the next so many waits (a limit, then a grace period) be over once `once` is set."""
        self._over += [once] * waits

    def all_over(self):
        """Whether every wait that was to end has ended."""
        return not self._over

    def wait(self, bell, left_s, longest_s, is_pause):
        """Have the time that is left pass, once a test allows it."""
        if self._over and self._over[0].is_set():
            self._over.pop(0)
            self.advance(left_s)
        else:
            bell.wait(0.005)  # who waits looks again


@pytest.fixture
def clock(monkeypatch):
    return LimitClock(monkeypatch)


class Stubborn(Scripted):
    """Ignores its preempts in its first execution until let go; writes afterwards."""

    def __init__(self, outcome='ok', **keys):
        Scripted.__init__(self, output_keys=['late', 'early'], **keys)
        self.stuck = threading.Event()
        self.let_go = threading.Event()
        self.left = threading.Event()
        self._outcome = outcome

    def execute(self, ud):
        self.runs += 1
        if self.runs > 1:
            return 'ok'
        ud.early = 'in time'
        self.stuck.set()
        assert self.let_go.wait(20)
        ud.late = 'too late'
        ud.early = 'too late'
        self.left.set()
        return self._outcome

    def leave(self):
        """Let the first execution end, and wait for it."""
        self.let_go.set()
        assert self.left.wait(20)


def limited(state, *others, expert=None, machine_settings=None, **settings):
    machine = chain_of(state, *others)
    return Watched(
        machine,
        expert=expert,
        settings=dict(machine_settings or {}, states={'A': settings or LIMITED}),
    )


def test_a_state_within_its_limit_is_as_any_other():
    state = Scripted(
        lambda self, ud: setattr(ud, 'x', ud.y + 1) or 'ok', input_keys=['y'], output_keys=['x']
    )
    machine = limited(state, **LIMITED)
    machine.machine.userdata.y = 1
    assert machine.run() == 'done'
    assert machine.machine.userdata.x == 2


def test_a_state_without_a_limit_runs_in_the_machines_own_thread_and_one_with_a_limit_does_not():
    threads = []
    state = Scripted(*[lambda self, ud: threads.append(threading.current_thread()) or 'ok'] * 2)
    watched(state).run()
    limited(state, **LIMITED).run()
    assert threads[0] is threading.current_thread()
    assert threads[1] is not threads[0]


def test_an_overrun_is_a_failure_and_the_state_is_preempted(clock):
    gate = Gate()
    machine = limited(Scripted(gate), Scripted())
    clock.end(1, gate.entered)
    assert machine.run() == 'done'
    failure = machine.of(EventKind.FAILURE)[0]
    assert failure.failure_kind == FailureKind.TIME_LIMIT
    assert failure.text == 'overran its time limit of 30 s and ended when it was preempted'
    assert machine.visits() == ['A', 'A', 'B']
    assert machine.machine['A'].preempt_requested() is False


def test_a_preempt_that_the_state_did_not_service_in_its_grace_does_not_reach_its_next_visit(clock):
    entered = threading.Event()

    def slow(state, ud):
        entered.set()
        assert wait_for(state.preempt_requested)
        return 'ok'

    seen = []
    machine = limited(
        Scripted(slow, lambda self, ud: seen.append(self.preempt_requested()) or 'ok')
    )
    clock.end(1, entered)
    assert machine.run() == 'done'
    assert seen == [False]


def test_late_outcome_and_late_writes_are_dropped(log, clock):
    state = Stubborn('aborted')
    clock.end(2, state.stuck)
    machine = limited(state, Scripted(), expert=FakeExpert(goto('B')), **ABANDONING)
    assert machine.run() == 'done'
    state.leave()
    assert wait_for(lambda: any('dropped' in text for _, text in log))
    assert contents(machine.machine.userdata) == {'early': 'in time'}
    assert len(machine.of(EventKind.FAILURE)) == 1


def test_a_nested_machine_that_is_abandoned_hands_no_late_outputs_up(clock):
    inner_state = Stubborn()
    clock.end(2, inner_state.stuck)
    inner = chain_of(inner_state, output_keys=['late'])
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add('A', inner, {'done': 'B'})
        smach.StateMachine.add('B', Scripted(), {'ok': 'done'})
    machine = Watched(
        outer,
        expert=FakeExpert(goto('B')),
        settings={'states': {'TOP': {}, 'A': ABANDONING}},
        strict=False,
    )
    machine.machine._oracle.configure(machine.machine.settings)
    assert machine.run() == 'done'
    inner_state.leave()
    assert wait_for(lambda: not inner.is_running())
    assert 'late' not in outer.userdata


def test_a_state_whose_thread_lives_is_not_entered_again(clock):
    state = Stubborn()
    clock.end(2, state.stuck)
    expert = FakeExpert(goto('A'), supersede('ok'))
    machine = limited(state, Scripted(), expert=expert, **ABANDONING)
    assert machine.run() == 'done'
    assert state.runs == 1
    assert machine.decisions() == [('ask', '')]
    assert 'still runs' in expert.questions[0].reason
    assert 'still runs' in expert.questions[0].choices[0].blocked
    assert 'still runs' in machine.of(EventKind.WARNING)[0].text, 'the answer naming it is refused'
    state.leave()


def test_a_transition_into_a_state_whose_thread_lives_fails_at_once(clock):
    state = Stubborn()
    clock.end(2, state.stuck)
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', state, {'ok': 'done'})
        smach.StateMachine.add('B', Scripted(), {'ok': 'A'})
    machine = Watched(
        machine,
        expert=FakeExpert(goto('B'), supersede('ok')),
        settings={'states': {'A': ABANDONING}},
    )
    assert machine.run() == 'done'
    failures = machine.of(EventKind.FAILURE)
    assert {event.failure_kind for event in failures} == {FailureKind.TIME_LIMIT}
    assert {event.text for event in failures[1:]} == {'still runs since it overran its time limit'}
    assert state.runs == 1
    state.leave()


def test_a_decision_says_which_state_still_runs_that_it_would_go_back_to(clock):
    state = Stubborn()
    clock.end(2, state.stuck)
    machine = Watched(
        chain_of(state, Scripted('aborted')),
        expert=FakeExpert(goto('B'), supersede('ok')),
        settings={'policy': 'algorithm1', 'states': {'A': ABANDONING}},
    )
    assert machine.run() == 'done'
    assert 'A still runs since it overran' in machine.of(EventKind.DECISION)[-1].text
    state.leave()


def test_a_state_that_overruns_as_a_precondition_is_not_met(clock):
    state = Stubborn()
    clock.end(2, state.stuck)
    machine = Watched(
        chain_of(Scripted('aborted'), state),
        preconditions={'A': ['B']},
        settings={'states': {'B': ABANDONING}},
        expert=FakeExpert(supersede('ok')),
    )
    machine.machine.events.observers.append(
        lambda event: event.kind is EventKind.PRECONDITION_END and state.leave()
    )
    machine.run()
    assert machine.of(EventKind.PRECONDITION_END)[0].text == (
        'overran its time limit of 30 s and was abandoned 0.1 s after it was preempted'
    )


def test_it_is_blocked_under_its_other_label_and_as_a_precondition_too(clock):
    state = Stubborn()
    clock.end(2, state.stuck)
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', state, {'ok': 'done'})
        smach.StateMachine.add('TWIN', state, {'ok': 'done'})
        smach.StateMachine.add('B', Scripted('aborted'), {'ok': 'done'})
    expert = FakeExpert(goto('TWIN'), goto('B'), goto('B'))
    machine = Watched(
        machine,
        expert=expert,
        preconditions={'B': ['TWIN']},
        settings={'states': {'A': ABANDONING}},
    )
    assert machine.run() == 'done'
    assert state.runs == 1
    end = machine.of(EventKind.PRECONDITION_END)[0]
    assert (end.outcome, end.text) == ('not met', 'still runs since it overran its time limit')
    state.leave()


def test_once_its_thread_has_ended_the_state_is_entered_again(clock):
    state = Stubborn()
    clock.end(2, state.stuck)
    machine = limited(state, expert=FakeExpert(supersede('ok')), **ABANDONING)
    assert machine.run() == 'done'
    state.leave()
    assert wait_for(lambda: not any('worker of A' in each.name for each in threading.enumerate()))
    assert machine.run() == 'done'
    assert state.runs == 2
    assert state.preempt_requested() is False


def test_an_exception_in_the_worker_is_the_states_exception():
    machine = limited(Scripted(ValueError('no grasp')), max_recoveries=0, **LIMITED)
    with pytest.raises(smach.InvalidUserCodeError, match='(?s)Traceback.*no grasp'):
        machine.run()


@pytest.mark.parametrize('stop', [KeyboardInterrupt, SystemExit])
def test_ctrl_c_in_the_worker_reaches_the_machine(stop):
    machine = limited(Scripted(stop()), **LIMITED)
    with pytest.raises(stop):
        machine.run()
    assert machine.machine.is_running() is False


def test_ctrl_c_while_the_machine_waits_leaves_the_state_behind(monkeypatch):
    state = Stubborn()
    machine = limited(state, time_limit_s=10.0)

    class Interrupted(LimitClock):
        def wait(self, bell, left_s, longest_s, is_pause):
            assert state.stuck.wait(20)
            raise KeyboardInterrupt

    Interrupted(monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        machine.run()
    assert machine.machine.is_running() is False
    assert state.preempt_requested() is True
    state.leave()
    assert 'late' not in machine.machine.userdata


def test_a_preempt_reaches_a_state_in_a_worker():
    gate = Gate()
    machine = limited(Scripted(gate), time_limit_s=20.0)
    run = in_thread(machine.run)
    assert gate.entered.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert not machine.of(EventKind.FAILURE)


def test_an_overrun_under_a_preempt_ends_the_machine_as_preempted(clock):
    state = Stubborn()
    preempted = threading.Event()
    clock.end(2, preempted)
    machine = limited(state, **ABANDONING)
    run = in_thread(machine.run)
    assert state.stuck.wait(20)
    machine.machine.request_preempt()
    preempted.set()
    assert run.result() == 'preempted'
    state.leave()


def test_an_overrun_under_a_preempt_has_obeyed_it_where_its_author_cleans_up(clock):
    preempted, seen = threading.Event(), []

    def slow(state, ud):
        machine.machine.request_preempt()
        preempted.set()
        assert wait_for(state.preempt_requested, 20), 'at its limit'
        return 'ok'

    cleans = Scripted(lambda state, ud: seen.append(state.preempt_requested()) or 'aborted')
    bare = chain_of(Scripted(slow), cleans, machine_class=NotesOnly)
    bare._transitions['A']['preempted'] = 'B'
    machine = Watched(bare, settings={'states': {'A': LIMITED}})
    clock.end(1, preempted)
    assert machine.run() == 'aborted'
    assert seen == [False] and not machine.of(EventKind.DECISION)
    assert machine.machine.preempt_requested() is False


def test_an_overrun_that_nobody_resolves_stops_with_the_machines_failing_outcome():
    machine = limited(Scripted(Gate()), max_recoveries=0, time_limit_s=BRIEF_S)
    begin = time.monotonic()
    assert machine.run() == 'aborted'
    assert time.monotonic() - begin >= BRIEF_S, 'not a moment less than its limit'


def test_an_overrun_in_a_machine_without_a_failing_outcome_raises():
    machine = Watched(
        chain_of(Scripted(Gate(), outcomes=('ok',)), outcomes=('done',)),
        settings={'max_recoveries': 0, 'time_limit_s': BRIEF_S},
    )
    with pytest.raises(smach.InvalidUserCodeError, match='overran its time limit of 0.1 s'):
        machine.run()


def test_without_recovery_there_are_no_limits():
    def longer_than_its_limit(state, ud):
        time.sleep(0.02)  # what makes it late is that time passes
        return 'ok'

    machine = watched(
        Scripted(longer_than_its_limit), settings={'time_limit_s': 0.01}, recover=False
    )
    assert machine.run() == 'done'
    assert not machine.of(EventKind.FAILURE)


def test_a_limit_given_with_add():
    from smach_oracle.oracle import OracleContainer

    machine = OracleContainer(
        outcomes=['done', 'aborted', 'preempted'], settings={'max_recoveries': 0}
    )
    with machine:
        OracleContainer.add('A', Scripted(Gate()), {'ok': 'done'}, time_limit_s=BRIEF_S)
    assert machine.execute() == 'aborted'


def test_context_variables_reach_the_worker():
    import contextvars

    variable = contextvars.ContextVar('v', default='unset')
    seen = []
    variable.set('set')
    limited(Scripted(lambda self, ud: seen.append(variable.get()) or 'ok'), **LIMITED).run()
    assert seen == ['set']


def test_a_preempt_request_that_cannot_be_taken_back_is_told(log):
    class Keeps(Scripted):
        def recall_preempt(self):
            raise ValueError('mine')

    worker.recall_preempts(Keeps())
    ((level, text),) = log
    assert level == 'warn' and text.startswith('Could not take a preempt request back from')
    assert 'mine' in text


@pytest.mark.parametrize(
    'outcomes, ends',
    [
        (['abort', 'done', 'failed', 'error'], 'failed'),
        (['abort', 'done', 'fail'], 'abort'),
        (['done', 'lost'], 'lost'),
    ],
)
def test_where_nobody_is_asked_an_overrun_ends_the_machine_as_badly_as_it_can(
    outcomes, ends, clock
):
    gate = Gate()
    clock.end(1, gate.entered)
    machine = watched(
        Scripted(gate, outcomes=('ok',)),
        outcomes=outcomes,
        settings={'policy': 'always_ask', **LIMITED},
    )
    assert machine.run() == ends


def test_a_state_that_is_only_observed_runs_in_its_machines_thread_whatever_its_limit():
    threads = []
    state = Scripted(lambda state, ud: threads.append(threading.current_thread()) or 'ok')
    machine = watched(state, recover=False, settings={'states': {'A': LIMITED}})
    assert machine.run() == 'done'
    assert threads == [threading.current_thread()]


def test_a_precondition_whose_thread_lives_has_not_begun(clock):
    state = Stubborn()

    def let_it_end(question, cancelled, progress):
        state.leave()
        assert wait_for(lambda: 'worker of WAITS' not in str(threading.enumerate()))
        return supersede('ok')

    clock.end(2, state.stuck)
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('WAITS', state, {'ok': 'done'})
        smach.StateMachine.add('B', Scripted('aborted'), {'ok': 'TWIN'})
        smach.StateMachine.add('TWIN', state, {'ok': 'done'})
    machine = Watched(
        machine,
        expert=FakeExpert(goto('B'), let_it_end),
        preconditions={'B': ['TWIN']},
        settings={'states': {'WAITS': ABANDONING, 'TWIN': {'on_retry': 'confirm'}}},
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['WAITS', 'B', 'TWIN'] and state.runs == 2
