"""The causes of failures in the kitchen: physical ones, drawn from the trial's seed.

Neither the executive nor the subsystems learn of them.
"""

from typing import Callable, Collection, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from .cause_draws import (
    LASTING,
    LASTING_SHARE,
    PASSING,
    drawn_kinds,
    extra_kind,
)
from .drafts import caused, declared
from .fridge import closing_hinge
from .light_causes import LightCauses, View
from .scene import LOCALISATION, Body, ClosingHinge, Disturbance, Near, SceneCause, Vector

# why, and why so often: doc/protocol.md
AMOUNT = 0.70  # chance that a trial has a cause
KINDS_OF = {
    LASTING: {
        'base_misplaced': 0.25,
        'glare': 0.20,
        'crowded': 0.15,
        'slippery_drink': 0.15,
        'door_falls_shut': 0.15,
        'dim_light': 0.10,
    },
    PASSING: {'door_swings_back': 0.45, 'drink_moved': 0.25, 'reflex': 0.20, 'shadow': 0.10},
}
EXTRA_KINDS_OF = {LASTING: {'worn_caster': 1.0}, PASSING: {'door_sucked_shut': 1.0}}
# m, m, rad, least and most, by which each long drive ends beside its goal, to one side of x
WORN_FROM: Vector = (0.0, 0.06, 0.02)
WORN_TO: Vector = (0.04, 0.11, 0.06)
SUCTION: Tuple[float, float] = (120.0, 240.0)  # N m about the hinge, right after the door was shut
SUCTION_S: Tuple[float, float] = (40.0, 150.0)  # in which air comes in
EYE = np.array([1.08, -0.14, 1.48])  # m, of the camera that looks into the fridge
LOOKS_AT = np.array([1.75, 0.0, 0.85])  # m, the middle of its image then
BEFORE_SHELF = Near((1.08, -0.14, 1.48), 0.25)  # the camera there looks at the drinks
GOES_IN = Near((1.00, -0.20, 0.0), 0.22)  # where the base then stands. It comes there to look
HEADINGS = 30  # that are drawn, until there is room beside the drink
TARGET = 0  # the drink that is ordered
FOREMOST = 0.05  # m behind the front of the shelf, where a drink may stand
ROOM = 0.11  # m between the middles of two drinks, or from that of one to a wall, that is enough
# sigma of x, y (m) and yaw (rad) that a drive misses its goal by
STEADY: Vector = (0.008, 0.008, 0.006)
# m, m, rad, least and most, by which a localisation is wrong after somebody has pushed the robot,
# or that has mistaken one thing for another
LOST_FROM: Vector = (0.06, 0.0, 0.0)
LOST_TO: Vector = (0.12, 0.05, 0.03)


class KitchenDraft(NamedTuple):
    """A kitchen to which causes are being added."""

    drinks: Tuple[Body, ...]
    front: Tuple[float, float]  # x, y of the middle of the fridge's opening, m
    half_width: float  # m from there to the inner side of a wall
    drive_error: Vector = STEADY
    localisation_error: Vector = (0.0, 0.0, 0.0)  # see RobotStart
    closing: Optional[ClosingHinge] = None  # of the fridge's door
    drive_bias: Vector = (0.0, 0.0, 0.0)  # see RobotStart
    disturbances: Tuple[Disturbance, ...] = ()
    causes: Tuple[SceneCause, ...] = ()


def with_causes(
    draft: KitchenDraft, seed: int, lasting: float = LASTING_SHARE, without: Collection[str] = ()
) -> KitchenDraft:
    """A kitchen with the causes that its seed has for it: mostly one, seldom two.

    :param lasting: the share of the causes that last, 0 to 1.
    :param without: kinds that are left out where they are drawn.
    """
    # a drink is moved to where there is room, with all others in their places
    drawn = sorted(
        drawn_kinds(seed, 72, AMOUNT, KINDS_OF, lasting), key=lambda each: each[0] == 'drink_moved'
    )
    for kind, generator in drawn:
        if kind not in without:
            draft = MAKERS[kind](draft, generator)
    return declared(draft, KINDS_OF[LASTING])


def with_extra_cause(draft: KitchenDraft, seed: int, task: str) -> KitchenDraft:
    """A kitchen with the one extra cause that its seed has for it."""
    kind, generator = extra_kind(seed, task, EXTRA_KINDS_OF)
    return declared(EXTRA_MAKERS[kind](draft, generator), EXTRA_KINDS_OF[LASTING])


def _base_misplaced(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """The localisation is wrong: the base is in the door's way, or too far for the arm.

    It stays wrong until the robot has looked at something that it knows.
    """
    x, y, yaw = (
        side * float(generator.uniform(least, most))
        for side, least, most in zip(generator.choice([-1.0, 1.0], 3), LOST_FROM, LOST_TO)
    )
    return caused(
        draft._replace(localisation_error=(x, y, yaw)),
        'base_misplaced',
        'the robot believes to be {:+.1f} cm further on, {:+.1f} cm further left and '
        '{:+.1f} degrees turned'.format(100 * x, 100 * y, np.degrees(yaw)),
        until=(LOCALISATION,),
    )


def _door_swings_back(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """The opened door falls back, half shut, while the robot drives in."""
    angle = float(generator.uniform(0.5, 0.9))
    return caused(
        draft,
        'door_swings_back',
        'the open door swings back to {:.0f} degrees'.format(np.degrees(angle)),
        Disturbance('swing:fridge', 'depart', (('angle', angle), ('duration', 1.5)), near=GOES_IN),
    )


def _door_falls_shut(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """The hinge pulls the door shut, unless it stands open past its stop."""
    hinge = closing_hinge(generator)
    return caused(
        draft._replace(closing=hinge),
        'door_falls_shut',
        'the door falls shut where it is open by less than {:.0f} degrees'.format(
            np.degrees(hinge.stop)
        ),
    )


def _crowded(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """A further drink stands right beside the one that is ordered."""
    gap = float(generator.uniform(0.0, 0.012))
    target, other = draft.drinks[TARGET], draft.drinks[-1]
    far = target.size[0] + other.size[0] + gap
    places = []
    for _ in range(HEADINGS):
        heading = float(
            generator.uniform(-0.5, 0.5) + (np.pi / 2 if generator.random() < 0.5 else -np.pi / 2)
        )
        places.append(
            (
                target.position[0] + far * float(np.cos(heading)),
                target.position[1] + far * float(np.sin(heading)),
                other.position[2],
            )
        )
    between = draft.drinks[1:-1]  # no other is to stand in what is moved
    moved = other._replace(
        position=max(
            places,
            key=lambda place: min(
                [0.0]
                + [
                    float(np.hypot(each.position[0] - place[0], each.position[1] - place[1]))
                    - each.size[0]
                    - other.size[0]
                    for each in between
                ]
            ),
        )
    )
    return caused(
        draft._replace(drinks=draft.drinks[:-1] + (moved,)),
        'crowded',
        'two drinks stand {:.1f} cm beside each other'.format(100 * gap),
        until=(target.name, other.name),
    )


def _slippery_drink(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    friction, mass = float(generator.uniform(0.045, 0.08)), float(generator.uniform(0.6, 0.75))
    drinks = (
        tuple(drink._replace(friction=friction, mass=mass) for drink in draft.drinks[:1])
        + draft.drinks[1:]
    )
    return caused(
        draft._replace(drinks=drinks),
        'slippery_drink',
        'the ordered drink is wet and full: friction {:.2f}, {:.2f} kg'.format(friction, mass),
    )


def _drink_moved(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """Somebody moves the ordered drink to where there is room, after it has been detected."""
    ways = [
        (float(generator.uniform(0.0, 0.06)), side * float(generator.uniform(0.05, 0.09)))
        for _ in range(30)
        for side in (1.0, -1.0)
    ]
    x, y = draft.drinks[TARGET].position[:2]
    # what stands behind others may be moved towards the front, but not off the shelf
    ways += [(-dx, dy) for dx, dy in ways if x - dx > draft.front[0] + FOREMOST]
    dx, dy = max(ways, key=lambda way: min(ROOM, _room_at(draft, x + way[0], y + way[1])))
    values = (('dx', dx), ('dy', dy), ('duration', 0.8))
    return caused(
        draft,
        'drink_moved',
        'somebody moves the ordered drink by {:.0f} cm, once it has been seen'.format(
            100 * float(np.hypot(dx, dy))
        ),
        Disturbance('nudge:' + draft.drinks[TARGET].name, 'see', values, near=BEFORE_SHELF),
    )


def _room_at(draft: KitchenDraft, x: float, y: float) -> float:
    """m from a place for the ordered drink to the next drink's middle or, if nearer, to a wall."""
    gaps = [
        float(np.hypot(other.position[0] - x, other.position[1] - y))
        for number, other in enumerate(draft.drinks)
        if number != TARGET
    ]
    return min(gaps + [draft.half_width - abs(y - draft.front[1])])


def _worn_caster(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """Hair and dust have wound themselves about a caster: each drive goes off to the same side."""
    x, y, yaw = (float(generator.uniform(*limits)) for limits in zip(WORN_FROM, WORN_TO))
    x_way, side = (float(each) for each in generator.choice([-1.0, 1.0], 2))
    bias = (x_way * x, side * y, side * yaw)
    return caused(
        draft._replace(drive_bias=bias),
        'worn_caster',
        'a caster drags: a long drive ends {:+.1f} cm further on, {:+.1f} cm further left and '
        '{:+.1f} degrees turned'.format(100 * bias[0], 100 * bias[1], np.degrees(bias[2])),
    )


def _door_sucked_shut(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """Somebody has just shut the door. The air inside cools down, and holds it for a while."""
    torque, seconds = float(generator.uniform(*SUCTION)), float(generator.uniform(*SUCTION_S))
    return caused(
        draft,
        'door_sucked_shut',
        'the door was just shut: suction holds it with {:.0f} N m at first, for {:.0f} s'.format(
            torque, seconds
        ),
        Disturbance('suck:fridge', 'drive', (('torque', torque), ('duration', seconds))),
    )


Maker = Callable[[KitchenDraft, np.random.Generator], KitchenDraft]
_IN_THE_LIGHT: LightCauses[KitchenDraft] = LightCauses(
    View(EYE, LOOKS_AT, near=BEFORE_SHELF), lambda draft: draft.drinks[TARGET].position
)
MAKERS: Dict[str, Maker] = {
    'base_misplaced': _base_misplaced,
    'door_falls_shut': _door_falls_shut,
    'door_swings_back': _door_swings_back,
    'crowded': _crowded,
    **_IN_THE_LIGHT.makers(),
    'slippery_drink': _slippery_drink,
    'drink_moved': _drink_moved,
}
EXTRA_MAKERS: Dict[str, Maker] = {
    'worn_caster': _worn_caster,
    'door_sucked_shut': _door_sucked_shut,
}
KINDS: List[str] = sorted(MAKERS)
