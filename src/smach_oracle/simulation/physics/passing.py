"""Time that passes in a world while nobody commands it: in one leap, as long as nothing moves."""

from typing import Callable, Optional

from .world import World

# m/s or rad/s, of bodies, doors and the robot's joints: what is slower stands still
STILL = 2e-4
LOOK_PERIODS = 6  # control periods of physics from one look whether all stands still to the next
# control periods of physics, at most, from one leap to the next: what trembles for longer, as a
# thing between fingers may, stays where it is. A door takes up to 225 to fall shut
UNREST_PERIODS = 240


def pass_time(
    world: World,
    periods: int,
    tick: Optional[Callable[[], None]] = None,
    leaped: Optional[Callable[[int], None]] = None,
    moving: Callable[[], bool] = lambda: False,
) -> None:
    """Let time pass.

    What begins or ends meanwhile does so at its time.

    :param periods: control periods.
    :param tick: lets one control period of physics pass. None means the world's `step`.
    :param leaped: gets the control periods of each leap.
    :param moving: whether the robot is being moved: then there is no leap.
    """
    end, restless = world.periods + periods, 0
    while world.periods < end:
        length = min(end, world.disturbances.next_period(world.periods, end)) - world.periods
        if length > 0 and not moving() and (restless >= UNREST_PERIODS or stands_still(world)):
            world.leap(length)
            restless = 0
            if leaped:
                leaped(length)
            continue
        for _ in range(min(LOOK_PERIODS, end - world.periods)):
            restless += not moving()
            (tick or world.step)()


def stands_still(world: World) -> bool:
    """Whether nothing in the world moves by itself."""
    if world.disturbed or any(abs(each) > STILL for each in world.joint_velocities().values()):
        return False
    return all(world.fastest(name) <= STILL for name in world.body_names)
