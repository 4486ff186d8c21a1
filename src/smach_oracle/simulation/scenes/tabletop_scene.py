"""The world of the first use case (paper, VI-B): a table and things, drawn from the seed."""

from typing import List, Sequence, Tuple

import numpy as np

from .calibration import camera_error, encoder_errors
from .cause_draws import LASTING_SHARE
from .chance import generator_for
from .clutter import another
from .kitchen_causes import STEADY
from .scene import Body, CameraQuality, Goal, RobotStart, Scene
from .tabletop_causes import (
    GOAL,
    TABLE_TOP,
    TORSO,
    TabletopDraft,
    radius_of,
    with_causes,
    with_extra_cause,
)
from .unlike_the_map import TrueTable, true_table

TASK = 'pick_and_place'
TABLE_X = 0.82  # m, of its middle
TABLE_SIZE = (0.70, 1.40, 0.04)
TOLERANCE = 0.06
NEAREST_X, NEAREST_Y = (0.53, 0.62), (-0.12, 0.22)  # m, where the object to be picked stands
OTHERS_X, OTHERS_Y = (0.62, 0.86), (-0.45, 0.40)
CLEAR = 0.13  # m between the middles of a thing that is put out later and the others
GAP = 0.033  # m between the outlines of things. Nearer to the one to be picked it is crowded
FREE_GOAL = 0.085  # m around the goal, without any outline
OTHERS = (4, 7)  # so many, where there is room
SPOTS = 60  # that are tried for them
DENSITY = (100.0, 1100.0)  # kg/m^3: from nearly empty to full of soup
# coefficient, median and spread of its logarithm, and its limits: what is greased, and rubber
FRICTION, FRICTION_SPREAD, FRICTIONS = 0.3, 0.6, (0.08, 1.0)
COLOURS = (
    (0.80, 0.16, 0.14),
    (0.14, 0.35, 0.75),
    (0.16, 0.55, 0.25),
    (0.90, 0.75, 0.15),
    (0.55, 0.20, 0.60),
    (0.92, 0.92, 0.90),
    (0.10, 0.55, 0.60),
    (0.92, 0.48, 0.12),
)
WOOD = (0.58, 0.42, 0.27)


def draw(
    seed: int, benign: bool = False, lasting: float = LASTING_SHARE, extra: bool = False
) -> Scene:
    """The trial's world.

    :param seed: 0 or more.
    :param benign: without any reason to fail.
    :param lasting: the share of the causes that last, 0 to 1.
    :param extra: with one of the extra causes, in place of the usual ones.
    """
    draft = TabletopDraft(fresh_things(seed))
    if extra:
        draft = with_extra_cause(draft, seed, TASK)
    elif not benign:
        draft = with_causes(draft, seed, lasting)
    robot = RobotStart(
        (('torso_lift_joint', TORSO),),
        encoder_errors=encoder_errors(seed),
        camera_error=camera_error(seed),
        drive_error=STEADY,
    )
    return composed(seed, draft, true_table(seed, TABLE_TOP, TABLE_X, TABLE_SIZE), robot)


def fresh_things(seed: int) -> Tuple[Body, ...]:
    """Return what stands on a table of TABLE_TOP that is set out afresh.

    The nearest thing, which is to be picked, comes first. The others stand beyond it.
    """
    generator = np.random.default_rng([seed, 61])
    colours = [COLOURS[number] for number in generator.permutation(len(COLOURS))]
    wanted = 1 + int(generator.integers(OTHERS[0], OTHERS[1] + 1))
    things = [_thing(generator, 'object_0', NEAREST_X, NEAREST_Y, colours[0])]
    for number in range(1, SPOTS + 1):
        if len(things) == wanted:
            break
        drawn = another(
            generator_for(seed, 'clutter:{}'.format(number)),
            _thing(
                generator, 'object_{}'.format(len(things)), OTHERS_X, OTHERS_Y, colours[len(things)]
            ),
            TABLE_TOP,
        )
        if _has_room(drawn, things):
            things.append(drawn)
    return tuple(things)


def composed(seed: int, draft: TabletopDraft, table: TrueTable, robot: RobotStart) -> Scene:
    """Return the scene of a draft. Its things stand on the table as it is."""
    target = min(draft.things, key=lambda thing: float(np.hypot(*thing.position[:2])))
    goal = Goal('stands_at', target.name, (*GOAL, table.height + target.size[2] / 2), TOLERANCE)
    return Scene(
        TASK,
        seed,
        tuple(_table(table) + _standing_on(table, draft.things)),
        goal,
        robot,
        CameraQuality(),
        draft.disturbances,
        draft.causes,
    )


def _standing_on(table: TrueTable, things: Sequence[Body]) -> List[Body]:
    """Things that stand on a table of TABLE_TOP, on another."""
    lift = table.height - TABLE_TOP
    return [
        each._replace(position=(*each.position[:2], each.position[2] + lift)) for each in things
    ]


def _table(table: TrueTable) -> List[Body]:
    deep, wide, thick = table.size
    top = Body('table', 'box', table.size, (table.x, 0.0, table.height - thick / 2), colour=WOOD)
    tall = table.height - thick
    legs = [
        Body(
            'leg_{}'.format(2 * i + j),
            'box',
            (0.06, 0.06, tall),
            (table.x + x * (deep / 2 - 0.06), y * (wide / 2 - 0.06), tall / 2),
            colour=(0.35, 0.25, 0.17),
        )
        for i, x in enumerate((-1, 1))
        for j, y in enumerate((-1, 1))
    ]
    return [top] + legs


def _has_room(thing: Body, things: Sequence[Body]) -> bool:
    """Whether it stands beyond the first of things, apart from all, and not at the goal."""
    place, target = np.array(thing.position[:2]), np.array(things[0].position[:2])
    apart = min(
        np.hypot(*(place - each.position[:2])) - radius_of(thing) - radius_of(each)
        for each in things
    )
    return bool(
        np.hypot(*place) > np.hypot(*target) + 0.05
        and apart > GAP
        and np.hypot(*(place - GOAL)) - radius_of(thing) > FREE_GOAL
    )


def _thing(
    generator: np.random.Generator,
    name: str,
    deep: Tuple[float, float],
    wide: Tuple[float, float],
    colour: Tuple[float, float, float],
) -> Body:
    """Draw a can or a carton at x and y (m) between limits."""
    x, y = float(generator.uniform(*deep)), float(generator.uniform(*wide))
    tall = float(generator.uniform(0.10, 0.16))
    half = float(generator.uniform(0.024, 0.036))
    density = float(generator.uniform(*DENSITY))
    friction = float(np.clip(generator.lognormal(np.log(FRICTION), FRICTION_SPREAD), *FRICTIONS))
    thing = Body(
        name,
        'cylinder',
        (half, half, tall),
        (x, y, TABLE_TOP + tall / 2 + 0.001),
        mass=density * np.pi * half**2 * tall,
        friction=friction,
        colour=colour,
    )
    if generator.random() < 0.55:
        return thing
    thick = float(generator.uniform(0.6, 1.0)) * half
    return thing._replace(
        shape='box',
        size=(2 * half, 2 * thick, tall),
        mass=density * 4 * half * thick * tall,
        yaw=float(generator.uniform(-1.5, 1.5)),
    )
