"""What bounds the question about a state that still runs: the trial's budget, the state's end."""

import threading

import pytest
from guarded_machines import chain, guarded
from machines import FakeExpert, FakeHealth, Gate, Scripted, Watched, goto, in_thread, supersede
from test_still_running import SOON, asked, letting_go, told
from waiting import wait_for

import smach
from smach_oracle.oracle.machine import places
from smach_oracle.oracle.records.events import EventKind, FailureKind
from smach_oracle.oracle.recovery.still_running import WatchedVisit
from smach_oracle.oracle.scope.alarm_clock import AlarmClock
from smach_oracle.oracle.scope.clock import Clock
from smach_oracle.oracle.scope.scope import Scope


def warned_once(machine, gate, clock=None):
    """Run until it warns, and a little longer; return what it warned of."""
    run = in_thread(machine.run)
    if clock is not None:
        assert gate.entered.wait(10)
        clock.advance(1.0)  # now it has run too long
    assert wait_for(lambda: machine.of(EventKind.WARNING))
    assert not gate.go.wait(0.3)  # six times as long as it takes to ask
    gate.go.set()
    assert run.result() == 'done'
    (warning,) = machine.of(EventKind.WARNING)
    return warning.text


def test_where_the_questions_are_spent_the_log_warns_once():
    gate, expert = Gate(), FakeExpert(goto('A'))
    machine = asked(Scripted('aborted', gate), expert=expert, budget={'questions': 1})
    text = warned_once(machine, gate)
    assert text.startswith('A still runs after ')
    assert text.endswith("Nobody is asked: the trial's 1 question is spent")
    assert len(expert.questions) == 1


def test_where_the_minutes_are_over_the_log_warns_once(clock):
    gate, expert = Gate(), FakeExpert()
    machine = asked(Scripted('aborted', gate), expert=expert, budget={'minutes': 1})
    machine.machine.events.observers.append(
        lambda event: event.kind is EventKind.JUMP and clock.advance(61.0)
    )
    assert warned_once(machine, gate, clock).endswith("the trial's 1 minute is over")
    assert not expert.questions


def test_the_question_is_open_no_longer_than_the_minutes(clock):
    gate = Gate()

    def ask(question, cancelled, progress):
        clock.advance(61.0)

    expert = FakeExpert(ask)
    machine = asked(Scripted('aborted', gate), expert=expert, budget={'minutes': 1})
    run = in_thread(machine.run)
    assert gate.entered.wait(10)
    clock.advance(1.0)  # now it has run too long
    assert wait_for(lambda: machine.of(EventKind.QUERY_EXPIRED))
    assert not gate.go.wait(0.3)  # nobody is asked again
    gate.go.set()
    assert run.result() == 'done'
    (question,) = expert.questions
    assert 0 < question.deadline_s <= 60.0
    assert machine.of(EventKind.QUERY_EXPIRED)[0].text.endswith(
        "; the trial's 1 minute is over; it runs on"
    )
    assert not machine.of(EventKind.WARNING)


@pytest.mark.parametrize(
    'answer, warnings',
    [(goto('B'), ['A has ended by itself; the answer is not used']), (goto('A'), [])],
)
def test_an_answer_to_a_state_that_ends_at_that_moment_is_told_of(answer, warnings, monkeypatch):
    gate = Gate()
    take_out = WatchedVisit._take_out

    def take_out_late(visit, answer):
        assert Scope().wait(20, visit._ended)
        take_out(visit, answer)

    monkeypatch.setattr(WatchedVisit, '_take_out', take_out_late)
    machine = asked(Scripted('aborted', gate), Scripted(), expert=FakeExpert(answer))
    machine.machine.events.observers.append(
        lambda event: event.kind is EventKind.QUERY_ANSWERED and gate.go.set()
    )
    assert machine.run() == 'done'
    assert [kind for kind, _ in told(machine)][:2] == ['QUERY_OPENED', 'QUERY_ANSWERED']
    assert [event.text for event in machine.of(EventKind.WARNING)] == warnings
    (answered,) = [event.query_id for event in machine.of(EventKind.QUERY_ANSWERED)]
    assert answered not in [event.query_id for event in machine.of(EventKind.QUERY_CANCELLED)]


def test_an_answer_after_the_state_has_ended_is_none(log):
    gate = Gate()

    def ask(question, cancelled, progress):
        gate.go.set()
        assert cancelled.wait(20)
        assert wait_for(lambda: machine.of(EventKind.QUERY_CANCELLED))
        return goto('B')

    machine = asked(Scripted('aborted', gate), Scripted(), expert=FakeExpert(ask))
    assert machine.run() == 'done'
    assert wait_for(lambda: any('came too late' in text for _, text in log))
    assert [kind for kind, _ in told(machine)] == ['QUERY_OPENED', 'QUERY_CANCELLED']


def test_a_state_that_is_held_back_is_no_longer_one_that_the_oracle_has_entered():
    machine, expert = guarded(
        chain(DETECT=Scripted('ok', 'aborted'), POUR=Scripted(), PLACE=Scripted('aborted')),
        goto('DETECT'),
        supersede('ok'),
        supersede('ok'),
        max_recoveries=0,
    )
    assert machine.run() == 'done' and len(expert.questions) == 3
    assert expert.questions[2].failure_kind is FailureKind.HELD_BACK
    assert not machine.machine._oracle.record('POUR').entered_by_oracle


def test_the_clock_lives_on_after_an_alarm_that_fails(log):
    clock, rung = AlarmClock(Clock()), threading.Event()

    def fails():
        raise RuntimeError('no more threads')

    clock.ring_in(0.0, fails)
    clock.ring_in(0.05, rung.set)
    assert rung.wait(10)
    assert any('no more threads' in text for _, text in log)


def test_an_alarm_that_is_due_before_those_that_wait_comes_first():
    class Told(Clock):
        def wait(self, *args):
            waits.set()
            super().wait(*args)

    waits, rung = threading.Event(), threading.Event()
    clock = AlarmClock(Told())
    clock.ring_in(60.0, lambda: None)
    assert waits.wait(10)
    clock.ring_in(0.05, rung.set)
    assert rung.wait(10)


def test_the_answer_waits_until_the_robot_is_well():
    health = FakeHealth()

    def ask(question, cancelled, progress):
        health.now = 'motors: off'
        return goto('B')

    machine = asked(
        Scripted('aborted', Gate()),
        Scripted(),
        expert=FakeExpert(ask),
        health=health,
        health_settle_s=0.05,
    )
    run = in_thread(machine.run)
    assert wait_for(lambda: machine.of(EventKind.HEALTH_WAIT_START))
    assert machine.visits() == ['A', 'A']
    health.now = ''
    assert run.result() == 'done' and machine.visits() == ['A', 'A', 'B']


def test_a_state_that_has_closed_meanwhile_is_refused_and_asked_again(monkeypatch):
    closed = []
    monkeypatch.setattr(
        places, 'why_closed', lambda node, label: 'still runs' if closed and label == 'B' else ''
    )

    class ClosesB(Gate):
        def __call__(self, state, ud):
            outcome = super().__call__(state, ud)
            closed.append('B')  # after the answer was taken
            return outcome

    expert = FakeExpert(goto('B'), goto('C'))
    machine = asked(Scripted('aborted', ClosesB()), Scripted(), Scripted(), expert=expert)
    assert machine.run() == 'done' and machine.visits() == ['A', 'A', 'C']
    assert [event.text for event in machine.of(EventKind.WARNING)] == [
        'cannot go to B, as was answered: B still runs'
    ]
    assert expert.questions[1].text == 'was taken out while it still ran'


def test_a_state_that_is_answered_and_then_taken_away_is_an_error():
    def take_away(state, ud):
        ended = Gate()(state, ud)
        for table in (machine.machine._states, machine.machine._transitions):
            del table['B']
        return ended

    machine = asked(Scripted('aborted', take_away), Scripted(), expert=FakeExpert(goto('B')))
    with pytest.raises(smach.InvalidStateError, match='there is no way to SM_ROOT/B'):
        machine.run()


def test_a_state_of_another_container_that_was_taken_away_is_named_by_its_own_path():
    def take_away(state, ud):
        ended = Gate()(state, ud)
        for table in (top._states, top._transitions):
            del table['GONE']
        return ended

    top = smach.StateMachine(['done', 'aborted', 'preempted'])
    with top:
        smach.StateMachine.add('IN', chain(A=Scripted('aborted', take_away)), {'done': 'done'})
        smach.StateMachine.add('GONE', Scripted(), {'ok': 'done'})
    expert = FakeExpert(goto('GONE', container='SM_ROOT'))
    machine = Watched(top, expert=expert, settings=SOON)
    assert machine.run() == 'done'
    (failure,) = [event for event in machine.of(EventKind.FAILURE) if event.state == 'IN']
    assert failure.text.endswith('there is no way to SM_ROOT/GONE')


def test_a_preempt_ends_the_wait_until_the_robot_is_well_for_what_was_answered():
    health = FakeHealth()

    def ask(question, cancelled, progress):
        health.now = 'motors: off'
        return goto('B')

    machine = asked(Scripted('aborted', Gate()), Scripted(), expert=FakeExpert(ask), health=health)
    run = in_thread(machine.run)
    assert wait_for(lambda: machine.of(EventKind.HEALTH_WAIT_START))
    machine.machine.request_preempt()
    assert run.result() == 'preempted' and machine.visits() == ['A', 'A']


def taken_out(then, clock, **settings):
    """A, which still runs as an expert sends it to B. `then`: called once A has ended."""

    def runs_long(state, ud):
        clock.advance(1.0)
        return Gate()(state, ud)

    machine = asked(
        Scripted('aborted', runs_long),
        Scripted(),
        expert=FakeExpert(goto('B')),
        budget={'minutes': 1},
        **settings,
    )

    def observe(event):
        if event.kind is EventKind.TRANSITION and len(machine.visits()) == 2:
            then(machine.machine)

    machine.machine.events.observers.append(observe)
    return machine


def test_a_shutdown_as_the_state_is_taken_out_goes_before_the_answer_and_the_minutes(
    clock, monkeypatch
):
    def then(top):
        clock.advance(61.0)
        monkeypatch.setattr(smach, 'is_shutdown', lambda: True)

    machine = taken_out(then, clock)
    assert machine.run() == 'preempted' and machine.visits() == ['A', 'A']


def test_where_the_minutes_are_over_nobody_is_asked_about_a_place_that_has_closed(
    clock, monkeypatch
):
    closed = []
    monkeypatch.setattr(places, 'why_closed', lambda node, label: 'is closed' if closed else '')
    machine = taken_out(closed.append, clock, on_no_answer={'give_up': 'done'})
    machine.machine.events.observers.append(
        lambda event: event.kind is EventKind.WARNING and clock.advance(61.0)
    )
    assert machine.run() == 'aborted'
    (ending,) = machine.of(EventKind.GIVE_UP)
    assert ending.text.endswith(': the machine ends as without an oracle')


def test_the_time_of_a_question_inside_is_no_time_of_the_state(clock):
    def ask(question, cancelled, progress):
        clock.advance(100.0)
        return goto('A')

    def stays(state, ud):
        clock.advance(1.0)
        assert not threading.Event().wait(0.3)
        return 'ok'

    inner = chain(A=Scripted('aborted', 'aborted', stays))
    expert = FakeExpert(goto('X'), ask)
    machine = Watched(
        chain(X=inner),
        expert=expert,
        settings={'still_running_s': 60.0, 'still_running_factor': 1, 'max_recoveries': 0},
    )
    assert machine.run() == 'done'
    assert [question.failed_state for question in expert.questions] == ['A', 'A']


def test_the_longest_visit_of_a_state_is_told_though_the_later_ones_were_short():
    """Shorter ones came by its author's transitions, and by the oracle."""
    gate = Gate()
    long = Scripted(
        lambda state, ud: threading.Event().wait(0.2) or 'again',
        'again',
        'aborted',
        'aborted',
        gate,
        outcomes=('ok', 'again', 'aborted', 'preempted'),
    )
    bare = chain(A=long)
    bare._transitions['A']['again'] = 'A'
    expert = FakeExpert(goto('A'), goto('A'), letting_go(gate, None))
    machine = Watched(bare, expert=expert, settings=dict(SOON, policy='always_ask'))
    assert machine.run() == 'done'
    told = [question.text for question in expert.questions if 'still runs' in question.text]
    assert float(told[-1].split('its longest so far was ')[1].split(' s')[0]) >= 0.2
