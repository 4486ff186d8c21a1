"""Waiting that a preempt or a shutdown ends at once."""

import time

import pytest
from waiting import Once

import smach

rospy = pytest.importorskip('rospy')
pytest.importorskip('smach_ros')
from smach_ros.waiting import Aside, Signal, seconds


@pytest.mark.parametrize(
    'given, meant', [(None, None), (2, 2.0), (0.5, 0.5), (rospy.Duration(1.5), 1.5)]
)
def test_durations_and_numbers_are_seconds(given, meant):
    assert seconds(given) == meant


def test_what_is_no_duration_is_refused_with_what_is_allowed():
    with pytest.raises(smach.InvalidStateError, match="'soon'.*rospy.Duration"):
        seconds('soon')


def test_notify_wakes_at_once():
    signal, happened, looks = Signal(), [], []

    def look():
        looks.append(1)
        return bool(happened)

    notifier = Once(lambda: looks, lambda: (happened.append(1), signal.notify()))
    begin = time.monotonic()
    assert signal.wait(look, longest_s=30.0)
    assert time.monotonic() - begin < 5.0
    notifier.join()


def test_what_has_happened_already_is_not_waited_for():
    assert Signal().wait(lambda: True, longest_s=30.0)


def test_wait_ends_at_its_limit():
    begin = time.monotonic()
    assert not Signal().wait(lambda: False, deadline=begin + 0.2, longest_s=30.0)
    assert 0.15 < time.monotonic() - begin < 5.0


def test_shutdown_ends_a_wait_without_end(monkeypatch):
    monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
    assert not Signal().wait(lambda: False)


def test_same_thread_may_notify_while_it_looks():
    signal = Signal()
    assert signal.wait(lambda: signal.notify() is None, longest_s=5.0)


def test_work_aside_hands_over_its_value_or_its_error():
    signal = Signal()
    good = Aside('good', signal, lambda stopped: 5)
    bad = Aside('bad', signal, lambda stopped: 1 // 0)
    assert signal.wait(lambda: good.ended and bad.ended, longest_s=10.0)
    assert (good.value, good.error) == (5, None)
    assert isinstance(bad.error, ZeroDivisionError)


def test_work_aside_can_be_stopped():
    signal = Signal()
    work = Aside('work', signal, lambda stopped: stopped.wait(30.0))
    work.stop()
    assert signal.wait(lambda: work.ended, longest_s=10.0)
    assert work.value is True
