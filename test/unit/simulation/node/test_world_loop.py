"""The thread that owns the physics: it moves in lock-step, keeps the time, and answers."""

import threading
import time
from typing import NamedTuple

import pytest
from waiting import wait_for

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.simulation.node.loop import WorldLoop, WorldStopped
from smach_oracle.simulation.node.motion_table import MotionTable
from smach_oracle.simulation.node.settings import WorldSettings, read_settings
from smach_oracle.simulation.node.sim_clock import SimClock

LIMIT_S = 20.0


class Done(NamedTuple):
    ok: bool = True
    text: str = 'done'


class FakeWorld:
    """Counts its control periods, and can be in unrest for some of them after a motion."""

    def __init__(self):
        self.periods = 0
        self.events = []
        self.unrest_until = 0

    def step(self, count=1):
        self.periods += count

    def happened(self, *events):
        self.events += events

    @property
    def disturbed(self):
        return self.periods < self.unrest_until


class Moves:
    """A motion that takes so many periods."""

    def __init__(self, periods, name='motion', log=None):
        self.left, self.name, self.log = periods, name, [] if log is None else log

    def tick(self, world):
        self.log.append((self.name, world.periods))
        self.left -= 1
        return Done() if self.left < 0 else None

    def events(self):
        return [self.name]

    def stop(self, world):
        self.log.append((self.name, 'stopped'))


@pytest.fixture
def world():
    return FakeWorld()


@pytest.fixture
def table(world):
    return MotionTable(world)


def test_motions_of_several_parts_go_on_together_and_end_each_in_its_time(world, table):
    log, ends = [], []
    for part, periods in (('torso', 2), ('base', 1)):
        table.start(
            part,
            Moves(periods, part, log),
            lambda ending, part=part: ends.append((part, world.periods)),
        )
    while table:
        table.tick()
    assert log == [('base', 0), ('torso', 0), ('base', 1), ('torso', 1), ('torso', 2)]
    assert ends == [('base', 2), ('torso', 2)] and world.periods == 2
    assert world.events == ['base', 'torso']


def test_a_newer_motion_of_the_same_part_stops_the_older(world, table):
    ends, older = [], Moves(5)
    table.start('head', older, lambda ending: ends.append(('older', ending)))
    table.tick()
    table.start('head', Moves(0), lambda ending: ends.append(('newer', ending)), 'a newer one')
    table.tick()
    assert older.log[-1] == ('motion', 'stopped')
    assert ends == [('older', (None, 'a newer one', False)), ('newer', (Done(), 'done', False))]


def test_a_motion_has_not_ended_before_what_it_set_off_has_come_to_rest(world, table):
    ends = []
    table.start('head', Moves(0), ends.append)
    world.unrest_until = 3
    while table:
        table.tick()
    assert ends == [(Done(), 'done', False)] and world.periods == 3


def test_a_reset_aborts_what_moves(table):
    ends = []
    table.start('head', Moves(5), ends.append)
    table.stop_all('reset')
    assert ends == [(None, 'reset', True)] and not table


class Running:
    """A loop in a thread of its own."""

    def __init__(self, world, **settings):
        self.times, self.world, self.table = [], world, MotionTable(world)
        self.clock = SimClock(lambda now, worlds: self.times.append(now))
        self.loop = WorldLoop(self.table, self.clock, WorldSettings(**settings), lambda: None)
        self.closed = threading.Event()
        self.thread = threading.Thread(target=self.loop.run, args=(self.closed.set,), daemon=True)
        self.thread.start()

    def move(self, periods):
        ended = threading.Event()
        self.loop.post(lambda: self.table.start('head', Moves(periods), lambda ending: ended.set()))
        assert ended.wait(LIMIT_S)

    def wait(self, condition):
        assert wait_for(condition, LIMIT_S)

    def stop(self):
        self.loop.stop(LIMIT_S)
        assert self.closed.is_set()


@pytest.fixture
def running(request, world):
    one = Running(world, **request.param)
    yield one
    one.stop()


LOCK_STEP = {'idle_grace': 0.05, 'idle_speed': 10.0}
PACED = {'real_time_factor': 4.0}


@pytest.mark.parametrize('running', [LOCK_STEP], indirect=True)
def test_in_lock_step_physics_goes_on_only_while_something_moves(running):
    running.move(30)
    at_rest, told = running.world.periods, len(running.times)
    running.wait(lambda: len(running.times) > told + 3)
    assert running.world.periods == at_rest == 30
    # 0.05 s of the wall's, ten times as fast
    assert running.times[-1] - running.times[-2] == 500_000_000


@pytest.mark.parametrize('running', [dict(LOCK_STEP, idle_speed=0.0)], indirect=True)
def test_while_nobody_commands_the_clock_goes_on_as_fast_as_it_is_set_to(running):
    running.move(1)
    told = len(running.times)
    running.wait(lambda: len(running.times) > told + 3)
    assert set(running.times[told + 1 :]) == {running.times[-1]}


@pytest.mark.parametrize('running', [PACED], indirect=True)
def test_a_paced_world_goes_on_by_itself_at_its_pace(running):
    begun, first = time.monotonic(), running.world.periods
    running.wait(lambda: running.world.periods - first >= 60)
    assert time.monotonic() - begun > 0.2  # 60 periods are 1 s at factor 1


@pytest.mark.parametrize('running', [LOCK_STEP, PACED], indirect=True)
def test_questions_are_answered_in_the_worlds_thread_and_errors_go_to_who_asked(running):
    assert running.loop.call(threading.current_thread) is running.thread

    def wrong():
        raise ValueError('wrong')

    with pytest.raises(ValueError, match='wrong'):
        running.loop.call(wrong)
    assert running.loop.call(lambda: 3) == 3


def test_who_asks_a_world_that_ends_is_not_left_waiting(world):
    running = Running(world)
    running.stop()
    with pytest.raises(WorldStopped):
        running.loop.call(lambda: 3)


def test_a_clock_never_gives_a_stamp_twice():
    told = []
    clock = SimClock(lambda now, worlds: told.append(now))
    stamps = [clock.stamp(), clock.stamp()]
    clock.advance(1 / 60)
    stamps.append(clock.stamp())
    assert stamps == sorted(set(stamps)) and told == stamps


def test_the_clock_tells_in_which_times_of_a_trial_the_world_stood_still():
    clock = SimClock(lambda now, worlds: None)
    clock.pause(3.0)
    clock.begin_trial()
    clock.advance(1.0)
    clock.pause(0.5)
    clock.stamp()
    clock.pause(0.5)  # a stamp between two makes one pause of them
    clock.skip(2.0)  # a leap is the world's time
    clock.pause(0.25)
    record = clock.trial_record()
    assert record['clock_s'] == 4.0
    assert record['pauses'] == [[5.0, 1.0], [8.0, 0.25]]


def test_the_worlds_own_time_stands_still_in_the_pauses_of_all_trials():
    told = []
    clock = SimClock(lambda now, worlds: told.append((now / 1e9, worlds / 1e9)))
    clock.pause(3.0)
    clock.begin_trial()
    clock.skip(2.0)
    clock.pause(0.5)
    clock.pause(0.5)
    assert told == [(4.0, 1.0), (6.0, 3.0), (6.5, 3.0), (7.0, 3.0)]


@pytest.mark.parametrize('running', [LOCK_STEP], indirect=True)
def test_an_idle_world_pauses_and_the_clock_without_pauses_is_its_time(running):
    running.wait(lambda: len(running.times) > 3)
    running.move(30)
    at_rest = len(running.times)
    running.wait(lambda: len(running.times) > at_rest + 3)
    record, now = running.loop.call(
        lambda: (running.clock.trial_record(), running.clock.now_ns / 1e9)
    )
    assert len(record['pauses']) == 2, 'the second begins with the tick in which the motion ends'
    passed = now - record['clock_s'] - sum(length for _, length in record['pauses'])
    assert passed == pytest.approx(30 / 60, abs=0.01)


def test_the_settings_of_a_world_without_limit_differ_from_those_of_a_paced_one():
    assert read_settings(lambda name, default: default).camera_rate == 0.0
    assert (
        read_settings(lambda name, default: 1 if 'factor' in name else default).camera_rate == 2.0
    )


@pytest.mark.parametrize(
    'name, value',
    [
        ('~task', 'dance'),
        ('~real_time_factor', -1),
        ('~real_time_factor', 'fast'),
        ('~seed', -1),
        ('~seed', 1.5),
        ('~benign', 'yes'),
        ('~truth_file', ''),
        ('~state_rate', 0),
        ('~idle_speed', float('nan')),
        ('~camera_rate', True),
        ('~camera_binning', 3),
        ('~camera_binning', True),
    ],
)
def test_a_bad_parameter_is_named(name, value):
    with pytest.raises(SettingsError, match=name):
        read_settings(lambda asked, default: value if asked == name else default)
