"""A robot that is well at every other moment is not well, however quickly it changes."""

import pytest
from fake_clock import FakeClock

from smach_oracle.oracle.machine.health_watch import HealthWatch
from smach_oracle.oracle.scope.scope import Scope

SETTLE_S = 0.5
FLAPS_FOR_S = 20.0


def tell_nobody(kind, **fields):
    """Have no observers."""


@pytest.fixture
def clock():
    """The clock of the waits, in which only pauses take time."""
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
