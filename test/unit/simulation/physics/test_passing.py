"""Time that passes in a world which nobody commands."""

import pytest

from smach_oracle.simulation.physics.passing import pass_time, stands_still
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.scene import Body, Disturbance, Goal, Scene

CAN = Body('can', 'cylinder', (0.03, 0.03, 0.12), (1.0, 0.0, 0.061), mass=0.3)


@pytest.fixture
def make():
    worlds = []

    def build(*disturbances, position=CAN.position):
        worlds.append(
            World(
                Scene(
                    'none',
                    1,
                    (CAN._replace(position=position),),
                    Goal('stands_at', ''),
                    disturbances=disturbances,
                )
            )
        )
        return worlds[-1]

    yield build
    for world in worlds:
        world.close()


def counted(world):
    """The periods of physics that the world goes through from now on, one by one."""
    steps, step = [], world.step

    def stepped(count=1):
        steps.append(count)
        step(count)

    world.step = stepped
    return steps


def test_a_world_at_rest_goes_on_in_one_leap(make):
    world = make()
    world.step(30)  # the can was set down a millimetre above the floor
    steps, leaps, pose, time = counted(world), [], world.body_pose('can'), world.time
    pass_time(world, 36000, leaped=leaps.append)
    assert leaps == [36000] and not steps
    assert world.time - time == pytest.approx(600.0)
    assert (world.body_pose('can') == pose).all()


def test_what_falls_comes_to_rest_before_the_leap(make):
    world = make(position=(1.0, 0.0, 8.0))
    assert not stands_still(world)
    steps = counted(world)
    pass_time(world, 6000)
    assert 0 < len(steps) < 400
    assert world.body_pose('can')[2, 3] < 0.1 and stands_still(world)


def test_a_short_time_passes_though_something_moves(make):
    world = make(position=(1.0, 0.0, 8.0))
    periods = world.periods
    pass_time(world, 10)
    assert world.periods == periods + 10 and world.body_pose('can')[2, 3] > 1.0


def test_what_is_due_happens_at_its_time_and_not_after_the_leap(make):
    nudge = Disturbance('nudge:can', 'see', (('dx', 0.1), ('duration', 0.8)))
    world = make(nudge)
    world.happened('see')
    pass_time(world, 6000)
    assert world.body_pose('can')[0, 3] == pytest.approx(1.1, abs=0.01)


def test_what_never_rests_is_leapt_over_after_some_seconds(make):
    world = make()
    world.fastest = lambda name: 1.0
    steps, periods = counted(world), world.periods
    pass_time(world, 6000)
    assert len(steps) == 240 and world.periods == periods + 6000


def test_no_leap_while_the_robot_is_moved(make):
    world = make()
    steps, left = counted(world), [100]

    def tick():
        left[0] -= 1
        world.step()

    pass_time(world, 6000, tick, moving=lambda: left[0] > 0)
    assert len(steps) in range(100, 110)
