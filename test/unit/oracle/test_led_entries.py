"""Which visits the oracle has led to, and how long the longest one took."""

import copy
import threading

from machines import FakeExpert, Scripted, goto, watched
from test_still_running import asked

import smach
from smach_oracle.oracle.records.events import EventKind


def test_the_longest_visit_counts_and_not_the_latest():
    machine = watched(Scripted(lambda state, ud: threading.Event().wait(0.05) or 'ok', 'ok'))
    assert [machine.run(), machine.run()] == ['done', 'done']
    assert machine.machine._oracle.record('A').longest_s >= 0.05


def test_a_state_that_a_trial_before_was_to_enter_is_come_to_by_itself(monkeypatch):
    """All is shut down between the jump and the state."""

    def takes_long(state, ud):
        assert not threading.Event().wait(0.3)  # six times as long as it takes to ask
        return 'ok'

    expert = FakeExpert(goto('B'))
    machine = asked(
        Scripted('aborted', 'ok'), Scripted(takes_long), expert=expert, max_recoveries=0
    )
    machine.machine.events.observers.append(
        lambda event: (
            monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
            if event.kind is EventKind.JUMP
            else None
        )
    )
    assert machine.run() is None
    monkeypatch.setattr(smach, 'is_shutdown', lambda: False)
    assert machine.run() == 'done'
    assert [question.failed_state for question in expert.questions] == ['A']


def test_a_copy_that_is_made_at_a_jump_was_led_nowhere():
    def takes_long(state, ud):
        assert not threading.Event().wait(0.2)  # four times as long as it takes to ask
        return 'ok'

    expert, copies = FakeExpert(goto('B')), []
    machine = asked(
        Scripted('aborted', 'ok'),
        Scripted(takes_long, takes_long),
        expert=expert,
        max_recoveries=0,
    )
    machine.machine.events.observers.append(
        lambda event: (
            copies.append(copy.copy(machine.machine)) if event.kind is EventKind.JUMP else None
        )
    )
    assert machine.run() == 'done'
    assert {question.failed_state for question in expert.questions} == {'A', 'B'}
    del expert.questions[:]
    assert copies[0].execute() == 'done' and not expert.questions
