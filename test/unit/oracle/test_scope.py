"""Scopes, their clocks, and calls that may be left behind."""

import itertools
import threading
import time

import pytest
from fake_clock import FakeClock
from machines import in_thread

from smach_oracle.oracle.scope.alarm_clock import AlarmClock
from smach_oracle.oracle.scope.background_call import BackgroundCall
from smach_oracle.oracle.scope.clock import Clock, Flag, PausableClock
from smach_oracle.oracle.scope.scope import LOOK_S, CallEnd, Reason, Scope, standing_still

BRIEF_S = 0.1  # waited for in full


class SlowPoll(Clock):
    """A clock that is looked at only when a bell rings, or when the time is over."""

    def wait(self, bell, left_s, longest_s, is_pause):
        bell.wait(min(left_s, 20.0))


@pytest.mark.parametrize('pauses', [1, 2])
def test_a_clock_shows_no_time_in_which_anybody_paused_it(pauses):
    clock = FakeClock()
    time_ = PausableClock(clock)
    clock.advance(1.0)
    with time_.paused():
        clock.advance(3.0)
        if pauses == 2:
            with standing_still([Scope(clock=clock, time=time_)]):
                clock.advance(2.0)
        clock.advance(5.0)
        assert time_.now() == 1.0
        assert 0.0 < time_.left_s(1.0) < 0.1, 'it still stands, and is looked at again soon'
    clock.advance(0.5)
    assert time_.now() == 1.5
    assert (time_.left_s(2.0), time_.left_s(1.0)) == (0.5, 0.0)


def test_who_waits_on_the_real_clock_looks_at_it_a_few_times():
    class Counted(Clock):
        looks = 0

        def now(self):
            self.looks += 1
            return super().now()

    clock = Counted()
    assert Scope(clock=clock).wait(BRIEF_S)
    assert clock.looks < 10


def test_a_clock_begins_again_while_it_is_paused():
    clock = FakeClock()
    time_ = PausableClock(clock)
    with time_.paused():
        clock.advance(3.0)
        time_.begin(60.0)
        clock.advance(3.0)
        assert time_.now() == 60.0
    clock.advance(2.0)
    assert time_.now() == 62.0


def test_a_pause_of_a_fake_clock_is_over_at_once_and_its_time_has_passed():
    scope = Scope(clock=FakeClock(5.0))
    assert scope.wait(300.0)
    assert scope.clock.now() == 305.0


def test_a_wait_for_something_lasts_on_a_fake_clock_until_a_test_has_the_time_pass():
    clock, flag = FakeClock(), Flag()
    wait = in_thread(lambda: Scope(clock=clock).wait(300.0, flag))
    time.sleep(0.02)  # for the wait to begin: whenever it does, it is not over
    clock.advance(299.0)
    assert wait._thread.is_alive()
    clock.advance(2.0)
    assert wait.result() is False


def test_a_pause_takes_no_moment_less_than_its_seconds():
    begin = time.monotonic()
    assert Scope().wait(BRIEF_S)
    assert time.monotonic() - begin >= BRIEF_S
    begin = time.monotonic()
    assert Scope().wait(BRIEF_S, Flag()) is False
    assert time.monotonic() - begin >= BRIEF_S


def test_a_flag_ends_a_wait_at_once_however_long_it_is():
    flag = Flag()
    wait = in_thread(lambda: Scope(clock=SlowPoll()).wait(10.0 * threading.TIMEOUT_MAX, flag))
    flag.set()
    assert wait.result(10.0) is True


@pytest.mark.parametrize('level', [0, 1, 2])
@pytest.mark.parametrize('waits_for', [(300.0,), (None, Flag()), (300.0, Flag())])
def test_a_cancel_on_any_level_around_ends_a_wait_at_once(level, waits_for):
    top = Scope(clock=SlowPoll())
    middle = Scope(top)
    scopes = [top, middle, Scope(middle, look=lambda: None)]
    wait = in_thread(lambda: scopes[2].wait(*waits_for))
    scopes[level].cancel(Reason.PREEMPTED)
    assert wait.result(10.0) is False
    assert [each.reason for each in scopes] == [None] * level + [Reason.PREEMPTED] * (3 - level)


class Bell:
    """Counts how often it is rung."""

    rung = 0

    def ring(self):
        self.rung += 1


@pytest.mark.parametrize('is_early', [False, True])
def test_what_is_to_be_told_of_a_cancel_is_told_at_once_also_where_it_came_before(is_early):
    scope, bell = Scope(), Bell()
    if is_early:
        scope.cancel(Reason.LEFT_BEHIND)
    scope.tell(bell)
    assert bell.rung == is_early
    scope.cancel(Reason.LEFT_BEHIND)
    assert bell.rung == 1 + is_early


def test_a_reason_of_which_nobody_tells_is_looked_for_and_a_wake_has_it_seen_at_once():
    seen = []
    look = Scope(look=lambda: seen[0] if seen else None, clock=SlowPoll())
    wait = in_thread(lambda: Scope(look).wait(300.0))
    time.sleep(0.02)  # for the wait to begin: whenever it does, it ends
    seen.append(Reason.SHUTDOWN)
    look.wake()
    assert wait.result(10.0) is False
    seen.clear()
    scope = Scope(look=lambda: seen[0] if seen else None)
    begin = time.monotonic()
    later = threading.Timer(0.02, seen.append, (Reason.SHUTDOWN,))  # once the wait has begun
    later.start()
    assert scope.wait(20.0) is False
    assert time.monotonic() - begin < 10.0 + LOOK_S


@pytest.mark.parametrize('first', Reason)
@pytest.mark.parametrize('second', Reason)
@pytest.mark.parametrize('told', [True, False])
def test_of_two_reasons_that_counts_which_comes_first_in_the_one_order(first, second, told):
    around = Scope()
    if told or first <= Reason.LEFT_BEHIND:  # which is always told
        around.cancel(first)
    else:
        around = Scope(look=lambda: first)
    scope = Scope(Scope(), around, look=lambda: None)
    scope.cancel(second)
    assert scope.reason is min(first, second)
    scope.cancel(Reason.ENDED)
    assert scope.reason is min(first, second), 'one that counts less takes the place of none'
    scope.renew()
    assert scope.reason is first


def test_nobody_is_asked_for_a_reason_once_nobody_waits_for_an_outcome():
    def look():
        raise AssertionError('it is the code of a user')

    scope = Scope(look=look)
    scope.cancel(Reason.LEFT_BEHIND)
    assert scope.reason is Reason.LEFT_BEHIND
    assert scope.wait(300.0) is False


def test_no_wait_is_missed_however_the_threads_run():
    """Each wait is woken by a cancel that comes at its very beginning, at any moment of it."""
    for turn in range(300):
        scope = Scope(Scope(clock=SlowPoll()))
        wait = in_thread(lambda scope=scope: scope.wait(300.0))
        for _ in range(turn % 30):
            threading.Event().is_set()  # so that the cancel comes at another moment
        scope.cancel(Reason.PREEMPTED)
        assert wait.result(10.0) is False


# -- calls


def run(work, limit_s=None, grace_s=0.0, scope=None):
    """Run a call; return how it ended, whether it was left, and the call."""
    stopped = threading.Event()
    call = BackgroundCall(lambda: work(stopped), 'a test')
    end = Scope(scope or Scope(), limit_s=limit_s).run(call, grace_s, stopped.set)
    return end, call.was_left_behind, call


def test_a_call_that_ends_by_itself_has_its_result_and_is_not_stopped():
    end, left, call = run(lambda stopped: stopped.is_set(), limit_s=20.0)
    assert (end, left, call.result) == (CallEnd.BY_ITSELF, False, False)


def test_a_call_beyond_its_limit_is_stopped_and_has_its_grace():
    end, left, _ = run(lambda stopped: stopped.wait(20.0), limit_s=0.01, grace_s=20.0)
    assert (end, left) == (CallEnd.OVERRUN, False)


def test_a_call_that_does_not_heed_its_stop_is_left_behind():
    go = threading.Event()
    end, left, call = run(lambda stopped: go.wait(20.0), limit_s=0.01, grace_s=0.01)
    assert (end, left) == (CallEnd.OVERRUN, True) and call.is_alive()
    go.set()


def test_a_cancel_stops_a_call_at_once():
    scope = Scope(clock=SlowPoll())
    later = threading.Timer(0.02, scope.cancel, (Reason.PREEMPTED,))  # once the call has begun
    later.start()
    end, left, _ = run(lambda stopped: stopped.wait(20.0), limit_s=300.0, grace_s=20.0, scope=scope)
    assert (end, left) == (CallEnd.STOPPED, False)


def test_ctrl_c_in_the_thread_that_waits_leaves_the_call_behind_without_a_grace():
    class Interrupted(Clock):
        def wait(self, bell, left_s, longest_s, is_pause):
            raise KeyboardInterrupt

    go, stopped = threading.Event(), threading.Event()
    call = BackgroundCall(lambda: go.wait(20.0), 'a test')
    with pytest.raises(KeyboardInterrupt):
        Scope(clock=Interrupted(), limit_s=300.0).run(call, 300.0, stopped.set)
    assert call.was_left_behind and stopped.is_set()
    go.set()


def test_the_time_of_a_limit_that_others_pause_is_given_back():
    clock, go = FakeClock(), threading.Event()
    limit = PausableClock(clock)
    scope = Scope(clock=clock, limit_s=30.0, time=limit)

    def work():
        with limit.paused():
            clock.advance(100.0)
        go.wait(20.0)

    call = BackgroundCall(work, 'a test')
    ended = in_thread(lambda: scope.run(call, 20.0, go.set))
    time.sleep(0.05)  # as long as it takes to look
    assert not go.is_set()
    clock.advance(31.0)
    assert ended.result() is CallEnd.OVERRUN and not call.was_left_behind


def test_an_alarm_rings_at_its_time():
    alarms, rung = AlarmClock(FakeClock()), threading.Event()
    alarms.ring_in(0.0, rung.set)
    assert rung.wait(20.0)
    alarms.rest()


@pytest.mark.parametrize('first, then', itertools.permutations((Reason.PREEMPTED, Reason.SHUTDOWN)))
def test_of_two_reasons_the_one_that_counts_more_stays(first, then):
    scope = Scope()
    scope.cancel(first)
    scope.cancel(then)
    assert scope.reason is Reason.PREEMPTED


def test_an_alarm_that_comes_before_those_that_wait_rings_at_its_time():
    waits = threading.Event()

    class Told(Clock):
        def wait(self, *given):
            waits.set()
            super().wait(*given)

    alarms, late, rung = AlarmClock(Told()), threading.Event(), threading.Event()
    alarms.ring_in(3600.0, late.set)
    assert waits.wait(20.0)
    alarms.ring_in(0.0, rung.set)
    assert rung.wait(20.0)
    alarms.forget(late.set)
    alarms.rest()
