"""What an expert's port may do wrong: not come back, or come back with something else than an
answer.
"""

import contextvars
import threading

import pytest
from machines import (
    FakeExpert,
    Scripted,
    give_up,
    goto,
    in_thread,
    interface,
    offered_hand,
    supersede,
    watched,
)

import smach
import smach_oracle.oracle.recovery.inquiry as inquiry
from smach_oracle.oracle.asking.question import Answer, AnswerKind
from smach_oracle.oracle.records.events import EventKind


def asking(*answers, **settings):
    """A, B, C, where B fails and the expert is asked at once."""
    expert = FakeExpert(*answers)
    machine = watched(
        Scripted(),
        Scripted('aborted'),
        Scripted(),
        expert=expert,
        settings=dict(settings, max_recoveries=0),
    )
    return machine, expert


class Strange:
    """What compares with nothing and says nothing of itself."""

    __hash__ = None

    def __eq__(self, other):
        raise ValueError('not to be compared')

    def __repr__(self):
        raise ValueError('nothing to show')


@pytest.mark.parametrize(
    'wrong',
    [
        'text',
        {'state': 'C'},
        0,
        (),
        Strange(),
        Answer(99),
        Answer('goto', state='C'),
        Answer(None),
        Answer(1, state='C'),
        goto(['A']),
        goto({}),
        goto(Strange()),
        goto(None),
        supersede(['ok']),
        supersede('ok', outputs=['k']),
        supersede('ok', outputs='k'),
        supersede('ok', outputs=5),
        give_up({'done'}),
        interface(['hand']),
        goto('C', why=5),
        Answer(AnswerKind.GOTO, 'C', by=None),
    ],
)
def test_an_answer_of_the_wrong_type_is_refused_and_asked_again(wrong):
    machine, expert = asking(wrong, goto('C'))
    assert machine.run() == 'done'
    (warning,) = machine.of(EventKind.WARNING)
    assert 'an answer does not fit' in warning.text
    assert len(expert.questions) == 2
    assert [event.by for event in machine.of(EventKind.QUERY_ANSWERED)] == ['eva']


@pytest.mark.parametrize(
    'wrong',
    [
        'text',
        {},
        0,
        Strange(),
        Answer(99),
        supersede(['ok']),
        supersede('ok', outputs=['k']),
        goto('C'),
    ],
)
def test_an_interface_that_gives_something_else_than_an_answer_has_failed(wrong):
    expert = FakeExpert(interface('hand'), goto('B'), interface=lambda *args: wrong)
    machine = offered_hand(expert)
    assert machine.run() == 'done'
    assert len(expert.questions) == 2
    (tried,) = expert.questions[1].tried
    assert tried.startswith('interface hand: ')
    assert [event.text for event in machine.of(EventKind.WARNING)] == [tried]


def test_an_interface_does_the_work_of_the_state_and_nothing_else():
    expert = FakeExpert(interface('hand'), goto('B'), interface=lambda *args: goto('B'))
    machine = offered_hand(expert)
    assert machine.run() == 'done'
    assert expert.questions[1].tried == ('interface hand: it gave GOTO, allowed: SUPERSEDE',)


class Deaf:
    """An expert's port that does not hear that its question is taken back, and answers later."""

    def __init__(self):
        self.asked = threading.Event()
        self.let_go = threading.Event()
        self.left = threading.Event()

    def __call__(self, question, cancelled, progress):
        self.cancelled = cancelled
        self.thread = threading.current_thread()
        self.asked.set()
        assert self.let_go.wait(20)
        progress('claimed', 'eva', 'late')
        self.left.set()
        return goto('C')

    def leave(self):
        """Let it answer, and wait for that."""
        self.let_go.set()
        assert self.left.wait(20)


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(inquiry, '_OVERTIME_S', 0.1)
    monkeypatch.setattr(inquiry, '_PATIENCE_S', 0.1)


def test_a_port_that_ignores_its_cancellation_does_not_outlast_the_deadline(impatient):
    deaf = Deaf()
    machine, _ = asking(deaf, deadline_s=0.1)
    assert in_thread(machine.run).result() == 'aborted'
    assert machine.of(EventKind.QUERY_EXPIRED)[0].text.startswith('no answer by the deadline')
    assert 'left behind' in machine.of(EventKind.WARNING)[0].text
    count = len(machine.events)
    deaf.leave()
    assert len(machine.events) == count, 'what it tells too late is dropped'


def test_an_answer_of_a_port_that_was_left_behind_a_moment_ago_is_no_answer(impatient):
    deaf = Deaf()
    machine, _ = asking(deaf, deadline_s=0.1)

    def answers(event):
        if 'left behind' in event.text:
            deaf.leave()
            deaf.thread.join(20)

    machine.machine.events.observers.append(answers)
    assert in_thread(machine.run).result() == 'aborted'
    assert machine.visits() == ['A', 'B'] and not machine.of(EventKind.QUERY_ANSWERED)


def test_a_port_that_ignores_its_cancellation_does_not_outlast_a_preempt(impatient):
    deaf = Deaf()
    machine, _ = asking(deaf, deadline_s=0)
    run = in_thread(machine.run)
    assert deaf.asked.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert len(machine.of(EventKind.QUERY_CANCELLED)) == 1
    deaf.leave()


def test_an_interface_that_ignores_its_cancellation_does_not_outlast_the_deadline(impatient):
    deaf = Deaf()
    machine = watched(
        Scripted('aborted'),
        expert=FakeExpert(interface('hand'), interface=lambda offer, *args: deaf(*args)),
        settings={'max_recoveries': 0, 'deadline_s': 0.1, 'interfaces': {'hand': {'action': 'a'}}},
    )
    assert in_thread(machine.run).result() == 'aborted'
    assert len(machine.of(EventKind.INTERFACE_END)) == 1
    assert len(machine.of(EventKind.QUERY_EXPIRED)) == 1
    deaf.leave()


def test_the_expert_is_asked_with_the_context_of_the_machine():
    variable = contextvars.ContextVar('v', default='unset')
    variable.set('set')
    machine, _ = asking(lambda *args: goto('C', why=variable.get()))
    assert machine.run() == 'done'
    assert machine.of(EventKind.QUERY_ANSWERED)[0].text == 'set'


@pytest.mark.parametrize('stop', [KeyboardInterrupt, SystemExit])
def test_what_ends_a_program_passes_through_the_experts_port(stop):
    def stops(*args):
        raise stop()

    machine, _ = asking(stops)
    with pytest.raises(stop):
        machine.run()
    assert machine.machine.is_running() is False


def test_what_a_port_tells_after_the_program_was_interrupted_is_no_step_of_the_next_trial(
    monkeypatch,
):
    deaf = Deaf()

    def interrupted():
        if deaf.asked.is_set():
            raise KeyboardInterrupt
        return False

    def leave(state, ud):
        deaf.leave()
        return 'ok'

    machine = watched(
        Scripted('aborted', leave), expert=FakeExpert(deaf), settings={'max_recoveries': 0}
    )
    monkeypatch.setattr(smach, 'is_shutdown', interrupted)
    with pytest.raises(KeyboardInterrupt):
        machine.run()
    assert deaf.cancelled.is_set(), 'nobody needs an answer any more'
    monkeypatch.setattr(smach, 'is_shutdown', lambda: False)
    assert machine.run() == 'done'
    assert not machine.of(EventKind.QUERY_CLAIMED)


def test_what_nobody_knows_that_a_port_tells_is_no_matter():
    def tells(question, cancelled, progress):
        progress('thinking', 'eva', 'hard')
        return goto('C')

    machine, _ = asking(tells)
    assert machine.run() == 'done' and machine.visits() == ['A', 'B', 'C']
