"""A bench whose time is stopped: limits, deadlines and waits of the oracle take no real time."""

import threading
import time

import pytest

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.scope.clock import Flag
from smach_oracle.oracle.scope.scope import Scope
from smach_oracle.testing import Bench, StoppedClock, expert, fail, hang, overrun, supersede

HOUR_S = 3600.0
ENDS = ['succeeded', 'aborted', 'preempted']


@pytest.fixture
def machine():
    sm = smach.StateMachine(ENDS)
    with sm:
        for label, following in (('LOOK', 'PICK'), ('PICK', 'succeeded')):
            state = smach.CBState(lambda userdata: 'succeeded', outcomes=ENDS)
            smach.StateMachine.add(label, state, {'succeeded': following})
    return sm


@pytest.fixture
def clock():
    return StoppedClock()


@pytest.mark.parametrize('fault', [hang('PICK', visit=1), overrun('PICK', 2 * HOUR_S, visit=1)])
def test_a_time_limit_of_an_hour_takes_no_hour(machine, clock, fault):
    with Bench(machine, [fault], settings={'time_limit_s': HOUR_S}, clock=clock) as bench:
        trial = bench.run().assert_recovered('PICK').assert_failed('PICK', times=1)
    assert HOUR_S <= clock.now() < 1.2 * HOUR_S
    trial.assert_took_less_than(30.0)


def test_what_ends_before_its_limit_does_its_work(machine, clock):
    faults = [overrun('PICK', HOUR_S / 2)]
    with Bench(machine, faults, settings={'time_limit_s': HOUR_S}, clock=clock) as bench:
        bench.run().assert_no_failures().assert_ended_with('succeeded')
    assert clock.now() == pytest.approx(HOUR_S / 2)


def test_a_state_that_heeds_no_preempt_is_left_behind_after_its_grace_period(machine, clock):
    settings = {'time_limit_s': 10.0, 'grace_period_s': HOUR_S}
    faults = [hang('PICK', visit=1, for_good=True)]
    with Bench(machine, faults, settings=settings, clock=clock) as bench:
        bench.run().assert_failed('PICK')
    assert clock.now() >= HOUR_S + 10.0


@pytest.mark.parametrize('policy, passes', [('prose', False), ('escalating', True)])
def test_a_policy_that_waits_before_it_tries_again_takes_no_time(machine, clock, policy, passes):
    faults = [fail('PICK', outcome='aborted', visit=(1, 2, 3))]
    with Bench(machine, faults, settings={'policy': policy}, clock=clock) as bench:
        bench.run().assert_recovered('PICK').assert_took_less_than(30.0)
    assert (clock.now() > 0.0) is passes


def test_a_state_that_does_not_end_is_asked_about_after_its_time(machine, clock):
    settings = {'still_running': {'after_s': HOUR_S}}
    faults = [fail('PICK', outcome='aborted', visit=1), hang('PICK', visit=2)]
    answers = expert(supersede('succeeded'))
    with Bench(machine, faults, expert=answers, settings=settings, clock=clock) as bench:
        bench.run().assert_asked_about('PICK', times=1).assert_ended_with('succeeded')
    assert clock.now() >= HOUR_S


def test_the_machine_has_its_own_clock_again(machine, clock):
    wrapped = OracleContainer.wrap(machine)
    own = oracle_of(wrapped).clock
    with Bench(wrapped, clock=clock) as bench:
        bench.run()
        assert oracle_of(wrapped).clock is own
    assert clock.now() == 0.0


def test_a_wait_is_over_once_the_test_has_its_time_pass(clock):
    over = threading.Event()

    def wait():
        assert not Scope(clock=clock).wait(HOUR_S, Flag())
        over.set()

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    ends_s = time.monotonic() + 30.0
    while not over.is_set() and time.monotonic() < ends_s:
        clock.advance(HOUR_S)
        over.wait(0.01)
    assert over.is_set()
    thread.join(10.0)
