"""The clock of work under simulated time, in a world whose time the test lets pass."""

import pytest
import rospy
from rosgraph_msgs.msg import Clock

from smach_oracle.oracle.scope.scope import Scope, Waiting
from smach_oracle.ros.waiting import work_clock
from smach_oracle.ros.waiting.work_clock import MachineTimeWaiting, WorkClock, clock_of_work


class FakeTimes:
    """A fake of the world's time and of the machine's."""

    def __init__(self, monkeypatch, world_s):
        self.world_s, self.machine_s = world_s, 1000.0
        monkeypatch.setattr(rospy, 'get_time', lambda: self.world_s)
        monkeypatch.setattr(work_clock.time, 'monotonic', lambda: self.machine_s)

    def passes(self, world_s, machine_s):
        self.world_s += world_s
        self.machine_s += machine_s


@pytest.fixture
def times(monkeypatch):
    return FakeTimes(monkeypatch, 50.0)


def test_it_shows_what_passes_in_the_world(times):
    clock = WorkClock()
    times.passes(world_s=30.0, machine_s=0.1)
    assert clock.now() == 30.0


def test_it_stands_still_with_the_world(times):
    clock = WorkClock()
    times.passes(world_s=0.0, machine_s=600.0)
    assert clock.now() == 0.0


def test_in_a_world_that_jumps_back_it_goes_on_from_what_it_shows(times):
    clock = WorkClock()
    shown = []
    for world_s in (60.0, 10.0, 25.0, 0.0, 3.0, 4.0):  # a reset, and a bag that begins again
        times.world_s = world_s
        shown.append(clock.now())
    assert shown == [10.0, 10.0, 25.0, 25.0, 25.0, 26.0]


def test_the_first_time_of_a_world_is_none_that_has_passed(monkeypatch):
    times = FakeTimes(monkeypatch, 0.0)  # as rospy has it before the first message of /clock
    clock = WorkClock()
    times.passes(world_s=1.6e9, machine_s=1.0)
    assert clock.now() == 0.0
    times.passes(world_s=2.0, machine_s=1.0)
    assert clock.now() == 2.0


@pytest.mark.parametrize('pace', [0.0, 0.5, 5.0])
def test_a_wait_in_the_machines_time_takes_that_at_any_pace_of_the_world(times, monkeypatch, pace):
    monkeypatch.setattr(
        Waiting, 'wait', lambda waiting, seconds, *_: times.passes(pace * seconds, seconds)
    )
    clock = WorkClock()
    times.passes(world_s=3.0, machine_s=1.0)
    MachineTimeWaiting(clock).wait(10.0, 'waiting', Scope())
    assert clock.now() == 13.0
    times.passes(world_s=4.0, machine_s=1.0)
    assert clock.now() == 17.0


def test_it_goes_by_the_time_that_the_world_tells_once_it_tells_it(times, monkeypatch):
    heard = []
    monkeypatch.setattr(work_clock, '_FIRST_S', 0.0)
    monkeypatch.setattr(rospy, 'Subscriber', lambda topic, kind, hear, **_: heard.append(hear))
    clock = WorkClock('/world/time')
    times.passes(world_s=3.0, machine_s=1.0)
    for world_s in (700.0, 702.0):  # of 20 s of /clock
        times.passes(world_s=10.0, machine_s=1.0)
        heard[0](Clock(rospy.Time.from_sec(world_s)))
    assert clock.now() == 13.0 + 2.0
    times.passes(world_s=10.0, machine_s=1.0)
    assert clock.now() == 15.0
    for world_s in (0.0, 1.0):  # it is reset
        heard[0](Clock(rospy.Time.from_sec(world_s)))
    heard[0](Clock(rospy.Time.from_sec(4.0)))
    assert clock.now() == 18.0


def test_a_trial_that_is_replayed_takes_what_it_took(times):
    clock = WorkClock()
    clock.pass_by(40.0)
    assert clock.now() == 40.0


def test_without_simulated_time_there_is_no_clock_of_the_world():
    assert clock_of_work('world/pass_time') is None
