"""A robot that is well at every other moment is not well, however quickly it changes."""

import random
import threading

import pytest
from fake_clock import FakeClock
from machines import in_thread

from smach_oracle.oracle.machine.health_watch import HealthWatch
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.scope.scope import Reason, Scope

SETTLE_S = 0.5
FLAPS_FOR_S = 20.0


def tell_nobody(kind, **fields):
    """Have no observers."""


@pytest.fixture
def clock(monkeypatch):
    """The clock of the waits, in which only pauses take time, and the same ones in each run."""
    monkeypatch.setattr(random, 'uniform', random.Random(5).uniform)
    return FakeClock(100.0003)


def flapping(clock, hertz, share, until_s):
    """A health function: well for `share` of each period until then, and for good from then on."""

    def is_well():
        return clock.now() > until_s or clock.now() * hertz % 1.0 < share

    return is_well


def watch_of(function):
    watch = HealthWatch(function)
    watch.use((), SETTLE_S)
    return watch


@pytest.mark.parametrize('share', [0.5, 0.7])
@pytest.mark.parametrize('hertz', [2.5, 5, 9.9, 10, 20, 50, 100, 1000])
def test_a_function_that_flaps_is_waited_for_until_it_holds(clock, hertz, share):
    until_s = clock.now() + FLAPS_FOR_S
    watch = watch_of(flapping(clock, hertz, share, until_s))
    assert watch.wait_until_well(tell_nobody, 'SM_ROOT/A', 'failed', 'off', Scope(clock=clock))
    # up to one settle time before the end of the flapping it may be well by chance
    assert until_s + SETTLE_S - 1.0 / hertz <= clock.now() <= until_s + SETTLE_S + 0.3


@pytest.mark.parametrize('hertz', [5, 10, 20, 100])
def test_a_failure_while_a_function_flaps_is_one_of_a_robot_that_is_not_well(clock, hertz):
    function = flapping(clock, hertz, 0.7, clock.now() + FLAPS_FOR_S)
    assert watch_of(function).unwell_after(Scope(clock=clock)) == 'is_well'


@pytest.mark.parametrize('settle_s, most', [(0.05, 60), (0.5, 60), (60.0, 700)])
def test_a_robot_that_is_well_is_asked_no_more_often_than_it_takes(clock, settle_s, most):
    asked = []
    watch = HealthWatch(lambda: asked.append(clock.now()) is None)
    watch.use((), settle_s)
    began_s = clock.now()
    assert watch.wait_until_well(tell_nobody, 'SM_ROOT/A', 'failed', 'off', Scope(clock=clock))
    assert settle_s <= clock.now() - began_s < settle_s + 0.2
    assert 20 <= len(asked) <= most


@pytest.mark.parametrize('settle_s, step_s', [(0.05, 0.004), (0.5, 0.02), (60.0, 0.2)])
def test_it_looks_ten_times_a_second_until_it_is_well_and_then_as_often_as_it_takes(
    monkeypatch, clock, settle_s, step_s
):
    def is_well():
        asked.append(clock.now())
        return len(asked) > 2

    monkeypatch.setattr(random, 'uniform', lambda least, most: least + most)  # twice the mean
    asked, watch = [], HealthWatch(is_well)
    watch.use((), settle_s)
    assert watch.wait_until_well(tell_nobody, 'SM_ROOT/A', 'failed', 'off', Scope(clock=clock))
    steps = [later - earlier for earlier, later in zip(asked, asked[1:4])]
    assert steps == pytest.approx([0.1, 0.1, step_s])


def test_without_a_settle_time_the_first_look_that_is_well_ends_the_wait(clock, log):
    def is_well():
        clock.advance(0.07654)
        asked.append(clock.now())
        return len(asked) > 2

    asked, told, watch = [], [], HealthWatch(is_well)
    watch.use((), 0.0)
    assert watch.wait_until_well(
        lambda *kind, **fields: told.append(kind + tuple(fields.values())),
        'SM_ROOT/A',
        'failed',
        'off',
        Scope(clock=clock),
    )
    text = 'the robot is well again after 0.4 s'
    data = {'waited_s': 0.43, 'states': ['SM_ROOT/A']}
    assert told == [
        (EventKind.HEALTH_WAIT_START, 'off'),
        (EventKind.HEALTH_WAIT_END, 'well', text, data),
    ]
    assert log[-1] == ('info', 'SM_ROOT/A: ' + text)
    assert len(asked) == 3 and clock.now() == asked[-1]


def test_after_a_failure_it_looks_until_the_settle_time_is_over_and_then_no_more(
    monkeypatch, clock
):
    monkeypatch.setattr(random, 'uniform', lambda least, most: 0.7)
    asked, began_s = [], clock.now()
    watch = watch_of(lambda: asked.append(clock.now()) is None)
    assert watch.unwell_after(Scope(clock=clock)) == ''
    assert clock.now() - began_s == pytest.approx(SETTLE_S)
    assert len(asked) == 73 and asked[-1] == clock.now()


def test_what_fails_while_others_wait_is_of_a_robot_that_is_not_well(clock):
    def is_well():
        said.append(watch.unwell_after(Scope(clock=clock, look=lambda: Reason.PREEMPTED)))
        return True

    said = []
    watch = watch_of(is_well)
    assert watch.wait_until_well(tell_nobody, 'SM_ROOT/A', 'failed', 'off', Scope(clock=clock))
    assert set(said) == {'off'}


def test_what_one_has_seen_as_its_wait_was_stopped_counts_for_all_who_wait(clock):
    class Held(Scope):
        def wait(self, seconds=None, until=None):
            if until is None:
                waits.set()
                assert go.wait(20)
            return Scope.wait(self, seconds, until)

    def is_well():
        asked.append(clock.now())
        if len(asked) == 2:
            stopped.cancel(Reason.PREEMPTED)
        return len(asked) != 2

    asked, waits, go, stopped = [], threading.Event(), threading.Event(), Scope(clock=clock)
    watch = watch_of(is_well)
    call = in_thread(
        lambda: watch.wait_until_well(tell_nobody, 'SM_ROOT/A', 'failed', 'off', Held(clock=clock))
    )
    assert waits.wait(20)
    assert not watch.wait_until_well(tell_nobody, 'SM_ROOT/B', 'failed', 'off', stopped)
    clock.advance(SETTLE_S)
    go.set()
    assert call.result()
    assert clock.now() - asked[2] >= SETTLE_S
