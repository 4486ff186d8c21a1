"""The world of the first use case (paper, VI-B): a table and things, drawn from the seed."""
from typing import List, Sequence, Tuple

import numpy as np

from .calibration import camera_error, encoder_errors
from .cause_draws import LASTING_SHARE
from .chance import generator_for
from .clutter import another
from .kitchen_causes import STEADY
from .scene import Body, CameraQuality, Goal, RobotStart, Scene
from .tabletop_causes import GOAL, TABLE_TOP, TORSO, TabletopDraft, with_causes
from .unlike_the_map import TrueTable, true_table

TASK = 'pick_and_place'
TABLE_X = 0.82  # m, of its middle
TABLE_SIZE = (0.70, 1.40, 0.04)
TOLERANCE = 0.06
NEAREST_X, NEAREST_Y = (0.53, 0.62), (-0.12, 0.22)  # m, where the object to be picked stands
OTHERS_X, OTHERS_Y = (0.62, 0.86), (-0.45, 0.40)
CLEAR = 0.13  # m between the middles of things, where nothing is crowded
FREE_GOAL = 0.17  # m around the goal
MASS = (0.15, 0.40)  # kg
COLOURS = ((0.80, 0.16, 0.14), (0.14, 0.35, 0.75), (0.16, 0.55, 0.25), (0.90, 0.75, 0.15),
           (0.55, 0.20, 0.60), (0.92, 0.92, 0.90), (0.10, 0.55, 0.60), (0.92, 0.48, 0.12))
WOOD = (0.58, 0.42, 0.27)


def draw(seed: int, benign: bool = False, lasting: float = LASTING_SHARE) -> Scene:
    """The trial's world.

    :param seed: 0 or more.
    :param benign: without any reason to fail.
    :param lasting: the share of the causes that last, 0 to 1.
    """
    draft = TabletopDraft(fresh_things(seed))
    if not benign:
        draft = with_causes(draft, seed, lasting)
    robot = RobotStart((('torso_lift_joint', TORSO),), encoder_errors=encoder_errors(seed),
                       camera_error=camera_error(seed), drive_error=STEADY)
    return composed(seed, draft, true_table(seed, TABLE_TOP, TABLE_X, TABLE_SIZE), robot)


def fresh_things(seed: int) -> Tuple[Body, ...]:
    """Return what stands on a table of TABLE_TOP that is set out afresh, the nearest first."""
    target, *others = _things(np.random.default_rng([seed, 61]))
    return (target, *(another(generator_for(seed, 'clutter:' + each.name), each, TABLE_TOP)
                      for each in others))


def composed(seed: int, draft: TabletopDraft, table: TrueTable, robot: RobotStart) -> Scene:
    """Return the scene of a draft. Its things stand on the table as it is."""
    target = min(draft.things, key=lambda thing: float(np.hypot(*thing.position[:2])))
    goal = Goal('stands_at', target.name, (*GOAL, table.height + target.size[2] / 2), TOLERANCE)
    return Scene(TASK, seed, tuple(_table(table) + _standing_on(table, draft.things)), goal, robot,
                 CameraQuality(), draft.disturbances, draft.causes)


def _standing_on(table: TrueTable, things: Sequence[Body]) -> List[Body]:
    """Things that stand on a table of TABLE_TOP, on another."""
    lift = table.height - TABLE_TOP
    return [each._replace(position=(*each.position[:2], each.position[2] + lift))
            for each in things]


def _table(table: TrueTable) -> List[Body]:
    deep, wide, thick = table.size
    top = Body('table', 'box', table.size, (table.x, 0.0, table.height - thick / 2), colour=WOOD)
    tall = table.height - thick
    legs = [
        Body('leg_{}'.format(2 * i + j), 'box', (0.06, 0.06, tall),
             (table.x + x * (deep / 2 - 0.06), y * (wide / 2 - 0.06), tall / 2),
             colour=(0.35, 0.25, 0.17)) for i, x in enumerate((-1, 1))
        for j, y in enumerate((-1, 1))
    ]
    return [top] + legs


def _things(generator: np.random.Generator) -> Tuple[Body, ...]:
    """The object to be picked, which stands nearest, and two to four others beyond it."""
    colours = generator.permutation(len(COLOURS))
    spots = [(generator.uniform(*NEAREST_X), generator.uniform(*NEAREST_Y))]
    wanted = 1 + int(generator.integers(2, 5))
    for _ in range(300):
        x, y = generator.uniform(*OTHERS_X), generator.uniform(*OTHERS_Y)
        beyond = np.hypot(x, y) > np.hypot(*spots[0]) + 0.05
        if len(spots) < wanted and beyond and _clear((x, y), spots):
            spots.append((x, y))
    return tuple(
        _thing(generator, 'object_{}'.format(k), spot, COLOURS[colours[k]])
        for k, spot in enumerate(spots))


def _clear(spot: Tuple[float, float], spots: List[Tuple[float, float]]) -> bool:
    away = [np.hypot(spot[0] - x, spot[1] - y) for x, y in spots]
    return min(away) > CLEAR and np.hypot(spot[0] - GOAL[0], spot[1] - GOAL[1]) > FREE_GOAL


def _thing(generator: np.random.Generator, name: str, spot: Tuple[float, float],
           colour: Tuple[float, float, float]) -> Body:
    """A can or a carton."""
    tall = float(generator.uniform(0.10, 0.16))
    wide = float(generator.uniform(0.024, 0.036))
    mass = float(generator.uniform(*MASS))
    position = (float(spot[0]), float(spot[1]), TABLE_TOP + tall / 2 + 0.001)
    if generator.random() < 0.55:
        return Body(name, 'cylinder', (wide, wide, tall), position, mass=mass, colour=colour)
    deep = float(generator.uniform(0.6, 1.0)) * wide
    return Body(name, 'box', (2 * wide, 2 * deep, tall), position,
                yaw=float(generator.uniform(-1.5, 1.5)), mass=mass, colour=colour)
