"""Preconditions are looked at while somebody listens; what raises or hangs is told, and nobody
waits for it.
"""

import sys
import threading
import time

import pytest
import rospy
from waiting import stays, wait_for

from smach_oracle.msg import PreconditionCheck
from smach_oracle.oracle.asking.question import PreconditionProbe, PreconditionStatus
from smach_oracle.ros.expert import precondition_watch
from smach_oracle.ros.expert.precondition_watch import PreconditionWatch


class FakePublisher:
    """Keeps what is published; listeners as a test wants them."""

    made = None  # the last

    def __init__(self, *_, **__):
        FakePublisher.made = self
        self.sent = []
        self.listeners = 1

    def publish(self, message):
        self.sent.append(message)

    def get_num_connections(self):
        return self.listeners


class FakeProbe(PreconditionProbe):
    """Calls functions by their names."""

    def __init__(self, **functions):
        self.names = tuple(('PICK', name) for name in functions)
        self.called = []
        self._functions = list(functions.values())

    def status(self, number):
        self.called.append(number)
        return self._functions[number]()


class FakeQuestion:
    """As much of one as is needed."""

    def __init__(self, look):
        self.preconditions = look
        self.question_id = 'q1'


@pytest.fixture
def watch(monkeypatch):
    monkeypatch.setattr(precondition_watch.rospy, 'Publisher', FakePublisher)
    monkeypatch.setattr(precondition_watch.rospy, 'get_rostime', lambda: rospy.Time(1))
    for name in ('PERIOD_S', 'LISTENER_PERIOD_S'):
        monkeypatch.setattr(precondition_watch, name, 0.05)
    # so that nobody is given up for slow
    monkeypatch.setattr(precondition_watch, 'PATIENCE_S', 60.0)
    return PreconditionWatch()


def sent(watch):
    return FakePublisher.made.sent


def holds():
    return PreconditionStatus(True, 'it does')


def test_they_are_checked_again_and_again_until_the_question_is_over(watch):
    found = [PreconditionStatus(False, 'not yet')]
    look = FakeProbe(free=lambda: found[-1])
    before = threading.enumerate()
    with watch.while_open(FakeQuestion(look)):
        assert wait_for(lambda: sent(watch))
        assert [
            (each.state, each.name, each.result, each.text) for each in sent(watch)[0].checks
        ] == [('PICK', 'free', PreconditionCheck.DOES_NOT_HOLD, 'not yet')]
        assert sent(watch)[0].query_id == 'q1' and 0.0 <= sent(watch)[0].checks[0].age < 10.0
        found.append(holds())
        assert wait_for(lambda: sent(watch)[-1].checks[0].result == PreconditionCheck.HOLDS)
    assert wait_for(lambda: not set(threading.enumerate()) - set(before))
    told = len(sent(watch))
    assert stays(lambda: len(sent(watch)) == told, 0.2)


def test_nothing_is_checked_where_nobody_listens(watch):
    FakePublisher.made.listeners = 0
    look = FakeProbe(free=holds)
    with watch.while_open(FakeQuestion(look)):
        assert stays(lambda: not look.called, 0.2)
        FakePublisher.made.listeners = 1
        assert wait_for(lambda: sent(watch))


def test_what_hangs_is_told_called_once_and_keeps_nobody_waiting(monkeypatch, watch):
    monkeypatch.setattr(precondition_watch, 'PATIENCE_S', 0.05)
    never = threading.Event()
    look = FakeProbe(door=never.wait, free=holds)

    def told():
        """A machine that is busy may be too slow for so little patience with the other, too, now
        and then.
        """
        wanted = [PreconditionCheck.UNKNOWN, PreconditionCheck.HOLDS]
        return [
            each.checks
            for each in sent(watch)[2:]
            if [check.result for check in each.checks] == wanted
        ]

    with watch.while_open(FakeQuestion(look)):
        assert wait_for(told)
        door, _ = told()[-1]
        assert 'has not come back for' in door.text and door.age == -1.0
        left_s = time.monotonic()
    assert time.monotonic() - left_s < 5.0, 'the answer does not wait for it'
    assert look.called.count(0) == 1
    never.set()


def test_what_leaves_the_program_does_not(watch):
    with watch.while_open(FakeQuestion(FakeProbe(quits=lambda: sys.exit(3), free=holds))):
        assert wait_for(lambda: sent(watch))
        assert 'raised SystemExit(3)' in sent(watch)[0].checks[0].text
        assert sent(watch)[0].checks[1].result == PreconditionCheck.HOLDS


@pytest.mark.parametrize('look', [None, FakeProbe()])
def test_a_question_without_any_starts_nothing(watch, look):
    before = threading.enumerate()
    with watch.while_open(FakeQuestion(look)):
        assert not set(threading.enumerate()) - set(before)


def test_checks_that_never_come_back_keep_so_many_threads_and_no_more(monkeypatch, watch):
    monkeypatch.setattr(precondition_watch, 'PATIENCE_S', 0.01)
    never, calls = threading.Event(), []

    def door():
        calls.append(1)
        never.wait()

    def all_left_out():
        return {check.text for check in sent(watch)[-1].checks} == {
            'not checked: 32 checks have not come back'
        }

    for told in (lambda: sent(watch), all_left_out):
        look = FakeProbe(
            **{'door_{}'.format(number): door for number in range(precondition_watch.MOST_HANGING)}
        )
        with watch.while_open(FakeQuestion(look)):
            assert wait_for(told)
    assert wait_for(lambda: len(calls) >= precondition_watch.MOST_HANGING)
    assert len(calls) == precondition_watch.MOST_HANGING
    never.set()
    with watch.while_open(FakeQuestion(FakeProbe(free=holds))):
        assert wait_for(
            lambda: sent(watch) and sent(watch)[-1].checks[0].result == PreconditionCheck.HOLDS
        )
