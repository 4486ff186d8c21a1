"""Small worlds of a PR2 before a table, as perception sees them and as they truly are."""

from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.transforms import inverse
from smach_oracle.simulation.physics.camera import see
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.scene import Body, CameraQuality, Goal, RobotStart, Scene

TOP = 0.72  # m, the table's
TABLE = Body('table', 'box', (0.7, 1.4, 0.04), (0.85, 0.0, TOP - 0.02), colour=(0.55, 0.38, 0.22))
LOOK = (0.75, 0.0, 0.75)


class Look(NamedTuple):
    """An image, what the robot feels, and the truth."""

    image: CameraImage
    joints: dict
    bodies: dict  # name: 4x4 in base_footprint, of the centre
    pixels: dict  # name: (h, w) bool, where it is seen


def thing(generator: np.random.Generator, name: str, x: float, y: float) -> Body:
    """A cylinder or a box of a graspable size that stands on the table."""
    colour = tuple(generator.uniform(0.15, 0.95, 3))
    height = generator.uniform(0.07, 0.17)
    if generator.random() < 0.5:
        radius = generator.uniform(0.022, 0.038)
        return Body(
            name,
            'cylinder',
            (radius, radius, height),
            (x, y, TOP + height / 2),
            mass=0.3,
            colour=colour,
        )
    size = (generator.uniform(0.035, 0.075), generator.uniform(0.035, 0.075), height)
    return Body(
        name,
        'box',
        size,
        (x, y, TOP + height / 2),
        yaw=generator.uniform(0, np.pi),
        mass=0.3,
        colour=colour,
    )


def places(generator: np.random.Generator, count: int, apart: float = 0.16) -> List[np.ndarray]:
    """Places on the table that lie at least so far from each other, m."""
    found: List[np.ndarray] = []
    while len(found) < count:
        place = generator.uniform((0.62, -0.32), (0.92, 0.32))
        if all(np.hypot(*(place - other)) > apart for other in found):
            found.append(place)
    return found


def extents(body: Body) -> np.ndarray:
    """(3,) m: full extents, the longer horizontal one first."""
    if body.shape == 'cylinder':
        return np.array([2 * body.size[0], 2 * body.size[0], body.size[2]])
    return np.array([max(body.size[:2]), min(body.size[:2]), body.size[2]])


def look(
    world: World,
    bodies: Sequence[Body],
    seed: int = 1,
    noise: float = 1.0,
    joints: Sequence[Tuple[str, float]] = (),
    at: Sequence[float] = LOOK,
) -> Look:
    """Reset the world to these bodies, point the head at the table, and see."""
    world.reset(
        Scene(
            'test',
            seed,
            tuple(bodies),
            Goal('stands_at', ''),
            RobotStart(joints=tuple(joints)),
            CameraQuality(noise=noise),
        )
    )
    DirectRobot(world).look_at(at)
    image = see(world)
    shown = world.labels
    names = np.array([world.seen_as(index) for index in range(shown.max() + 1)] + [''])
    base = inverse(world.true_base())
    return Look(
        image,
        world.joints(),
        {body.name: base @ world.body_pose(body.name) for body in bodies},
        {body.name: names[shown] == body.name for body in bodies},
    )
