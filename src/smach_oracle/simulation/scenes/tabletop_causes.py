"""The causes of failures at the table: physical ones, drawn from the trial's seed.

Neither the executive nor the subsystems learn of them.
"""

import functools
from typing import Callable, Collection, Dict, List, NamedTuple, Optional, Sequence, Tuple, cast

import numpy as np

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.robot import ARM_JOINTS, BASE_FRAME, TOOL_FRAME

from .cause_draws import (
    LASTING,
    LASTING_SHARE,
    PASSING,
    drawn_kinds,
    extra_kind,
)
from .drafts import caused, declared
from .light_causes import LightCauses, View
from .scene import Body, Disturbance, SceneCause

TABLE_TOP = 0.72  # m
GOAL = (0.60, -0.35)  # m, where the task puts the object
TORSO = 0.22  # m
EYE = np.array([-0.05, 0.0, 1.42])  # m, about where the head camera is
ROOM = 0.12  # m, around where the nearest thing is moved to, that is enough
WAYS = 30  # that are drawn, until there is room for what is moved
TARGET = 0  # the thing that stands nearest

EYE_LOOKING = np.array([0.09, 0.02, 1.44])  # m, where it is when it looks at the table
LOOKS_AT = np.array([0.65, 0.0, 0.80])  # m, the middle of its image then

# why, and why so often: doc/protocol.md
AMOUNT = 0.40  # chance that a trial has a cause
KINDS_OF = {
    LASTING: {
        'crowded': 0.25,
        'glare': 0.25,
        'goal_occupied': 0.20,
        'dim_light': 0.10,
        'slippery_object': 0.10,
        'edge_of_reach': 0.10,
    },
    PASSING: {'arm_in_view': 0.45, 'object_moved': 0.25, 'reflex': 0.20, 'shadow': 0.10},
}
EXTRA_KINDS_OF = {LASTING: {'sticky_ring': 1.0}, PASSING: {'gripper_halts': 1.0}}
STICKS: Tuple[float, float] = (30.0, 75.0)  # N, least and most, that a dried ring of a drink holds
# s, median and spread of its logarithm, that the motor of a gripper is off until it has cooled
HALTS_S, HALTS_SPREAD = 12.0, 0.8


class TabletopDraft(NamedTuple):
    """A scene at the table to which causes are being added."""

    things: Tuple[Body, ...]
    disturbances: Tuple[Disturbance, ...] = ()
    causes: Tuple[SceneCause, ...] = ()


def with_causes(
    draft: TabletopDraft, seed: int, lasting: float = LASTING_SHARE, without: Collection[str] = ()
) -> TabletopDraft:
    """A scene with the causes that its seed has for it: mostly none, seldom two.

    :param lasting: the share of the causes that last, 0 to 1.
    :param without: kinds that are left out where they are drawn.
    """
    drawn = drawn_kinds(seed, 62, AMOUNT, KINDS_OF, lasting)
    # the one that takes things away comes first, so that no other loses what it needs
    for kind, generator in sorted(drawn, key=lambda each: each[0] != 'edge_of_reach'):
        if kind not in without:
            draft = MAKERS[kind](draft, generator) or draft
    return declared(draft, KINDS_OF[LASTING])


def with_extra_cause(draft: TabletopDraft, seed: int, task: str) -> TabletopDraft:
    """A scene with the one extra cause that its seed has for it."""
    kind, generator = extra_kind(seed, task, EXTRA_KINDS_OF)
    return declared(EXTRA_MAKERS[kind](draft, generator), EXTRA_KINDS_OF[LASTING])


def _arm_in_view(draft: TabletopDraft, generator: np.random.Generator) -> Optional[TabletopDraft]:
    """Somebody pushes the left arm between the camera and the nearest thing.

    That happens after the head has turned there.
    """
    thing = draft.things[TARGET]
    chain = _left_arm()
    for _ in range(60):
        top = np.array(thing.position) + [0.0, 0.0, thing.size[2] / 2]
        point = (
            top
            + generator.uniform(0.2, 0.45) * (EYE - top)
            + [0.0, generator.uniform(-0.06, 0.02), 0.0]
        )
        # an array, which numpy's types may take for one number
        angles = cast('np.ndarray', generator.uniform((-1.5, -0.2, -1.6), (1.5, 0.6, -0.2)))
        pose = from_rpy(point, *angles)
        q = chain.inverse(pose, np.array([0.6, 0.2, 1.2, -1.6, 0.0, -0.8, 0.0]), generator)
        if q is not None and point[2] > TABLE_TOP + 0.22:
            turned = chain.nearest_turn(q, np.zeros(len(q)))
            values = tuple(zip(ARM_JOINTS['left'], (float(each) for each in turned)))
            return caused(
                draft,
                'arm_in_view',
                'the left arm is pushed over the table, its hand {:.0f} cm above it'.format(
                    100 * (point[2] - TABLE_TOP)
                ),
                Disturbance('arm', 'look_at', values),
                until=tuple('arm:' + name for name in ARM_JOINTS['left'][:4]),
            )
    return None


@functools.lru_cache(maxsize=1)
def _left_arm() -> JointChain:
    return JointChain.from_urdf(
        pr2_urdf().read_text(), BASE_FRAME, TOOL_FRAME['left'], {'torso_lift_joint': TORSO}
    )


def _crowded(draft: TabletopDraft, generator: np.random.Generator) -> Optional[TabletopDraft]:
    """A further thing stands close behind the nearest one, or next to it."""
    spare = _spare_things(draft)
    if not spare:
        return None
    thing, other = draft.things[TARGET], spare[-1]
    gap = float(generator.uniform(0.014, 0.032))
    far = radius_of(thing) + radius_of(other) + gap
    behind = np.arctan2(thing.position[1], thing.position[0])
    ways = [float(behind + generator.uniform(-1.5, 1.5)) for _ in range(WAYS)]
    moved = max(
        (
            _moved_to(
                other, thing.position[0] + far * np.cos(way), thing.position[1] + far * np.sin(way)
            )
            for way in ways
        ),
        key=lambda each: min(0.0, _room_of(each, draft.things[1:])),
    )
    return caused(
        _with_moved(draft, moved),
        'crowded',
        'another thing stands {:.1f} cm beside the nearest one'.format(100 * gap),
        until=(thing.name, other.name),
    )


def _slippery_object(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    friction = float(generator.uniform(0.04, 0.07))
    mass = float(generator.uniform(0.4, 0.7))
    thing = draft.things[TARGET]._replace(friction=friction, mass=mass)
    return caused(
        draft._replace(things=(thing,) + draft.things[1:]),
        'slippery_object',
        'the nearest thing is slippery and heavy: friction {:.2f}, {:.2f} kg'.format(
            friction, mass
        ),
    )


def _object_moved(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    """Somebody moves the nearest thing after it has been detected, to where there is most room."""
    thing = draft.things[TARGET]

    def room(way: Tuple[float, float]) -> float:
        return min(
            [ROOM]
            + [
                float(
                    np.hypot(
                        other.position[0] - thing.position[0] - way[0],
                        other.position[1] - thing.position[1] - way[1],
                    )
                )
                for other in draft.things[1:]
            ]
        )

    ways = []
    for _ in range(WAYS):
        far = float(generator.uniform(0.05, 0.08))
        heading = float(generator.uniform(-0.9, 0.9))  # away from the robot
        ways.append((far * float(np.cos(heading)), far * float(np.sin(heading))))
    dx, dy = max(ways, key=room)
    return caused(
        draft,
        'object_moved',
        'somebody moves the nearest thing by {:.0f} cm, once it has been seen'.format(
            100 * float(np.hypot(dx, dy))
        ),
        Disturbance('nudge:' + thing.name, 'see', (('dx', dx), ('dy', dy), ('duration', 0.8))),
    )


def _goal_occupied(draft: TabletopDraft, generator: np.random.Generator) -> Optional[TabletopDraft]:
    """Things stand on both sides of the place where the object should go."""
    spare = _spare_things(draft)
    if len(spare) < 2:
        return None
    headings = [float(generator.uniform(-np.pi, np.pi)) for _ in range(WAYS)]
    distances = [float(generator.uniform(0.07, 0.11)) for _ in range(2)]
    pairs = [
        [
            _moved_to(other, GOAL[0] + away * np.cos(side), GOAL[1] + away * np.sin(side))
            for other, away, side in zip(spare[-2:], distances, (heading, heading + np.pi))
        ]
        for heading in headings
    ]
    staying = [each for each in draft.things if each not in spare[-2:]]
    moved = next(
        (
            pair
            for pair in pairs
            if all(
                _room_of(each, staying) > 0 and _away(each) > _away(draft.things[TARGET])
                for each in pair
            )
        ),
        None,
    )
    if moved is None:
        return None
    return caused(
        _with_moved(draft, *moved),
        'goal_occupied',
        'things stand {:.0f} and {:.0f} cm beside the place for the object'.format(
            *(100 * away for away in distances)
        ),
        until=tuple(each.name for each in moved),
    )


def _edge_of_reach(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    """The nearest thing stands at the edge of the right arm's reach. The others are beyond it."""
    thing = draft.things[TARGET]
    spot = (float(generator.uniform(0.50, 0.60)), float(generator.uniform(0.34, 0.50)))
    moved = thing._replace(position=(spot[0], spot[1], thing.position[2]))
    others = tuple(
        other
        for other in draft.things[1:]
        if np.hypot(other.position[0] - spot[0], other.position[1] - spot[1]) > 0.12
        and np.hypot(*other.position[:2]) > np.hypot(*spot) + 0.04
    )
    return caused(
        draft._replace(things=(moved,) + others),
        'edge_of_reach',
        'the nearest thing stands {:.0f} cm to the left'.format(100 * spot[1]),
        until=(thing.name,),
    )


def _sticky_ring(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    """The nearest thing stands in a drink that was spilled and has dried, and sticks to the table.

    Once it has come off, it does not stick again.
    """
    force = float(generator.uniform(*STICKS))
    thing = draft.things[TARGET].name
    return caused(
        draft,
        'sticky_ring',
        'the nearest thing sticks to the table until it is pulled with {:.0f} N'.format(force),
        Disturbance('stick:' + thing, 'start', (('force', force),)),
    )


def _gripper_halts(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    """The motor of the right gripper is too hot. Its board keeps it off until it has cooled."""
    seconds = float(generator.lognormal(np.log(HALTS_S), HALTS_SPREAD))
    return caused(
        draft,
        'gripper_halts',
        'the motor of the right gripper is off for {:.0f} s'.format(seconds),
        Disturbance('halt:right', 'look_at', (('duration', seconds),)),
    )


def _spare_things(draft: TabletopDraft) -> Tuple[Body, ...]:
    """Return the things that no cause needs in place, without the nearest one."""
    needed = {name for cause in draft.causes for name in cause.until}
    return tuple(each for each in draft.things[TARGET + 1 :] if each.name not in needed)


def _moved_to(thing: Body, x: float, y: float) -> Body:
    return thing._replace(position=(float(x), float(y), thing.position[2]))


def _away(thing: Body) -> float:
    """m from the robot, by which the nearest thing is known."""
    return float(np.hypot(*thing.position[:2]))


def _room_of(thing: Body, others: Sequence[Body]) -> float:
    """m from the outline of a thing to the next one of others. Below 0 they overlap."""
    return min(
        [np.inf]
        + [
            float(
                np.hypot(
                    thing.position[0] - other.position[0], thing.position[1] - other.position[1]
                )
            )
            - radius_of(thing)
            - radius_of(other)
            for other in others
            if other.name != thing.name
        ]
    )


def _with_moved(draft: TabletopDraft, *moved: Body) -> TabletopDraft:
    """The draft with things elsewhere."""
    places = {each.name: each for each in moved}
    return draft._replace(things=tuple(places.get(each.name, each) for each in draft.things))


def radius_of(thing: Body) -> float:
    """Return the radius, m, of the circle around a thing that stands, seen from above."""
    if thing.shape == 'box':
        return float(np.hypot(*thing.size[:2])) / 2
    return thing.size[0] if thing.shape == 'cylinder' else thing.size[0] / 2


Maker = Callable[[TabletopDraft, np.random.Generator], Optional[TabletopDraft]]
_IN_THE_LIGHT: LightCauses[TabletopDraft] = LightCauses(
    View(EYE_LOOKING, LOOKS_AT), lambda draft: draft.things[TARGET].position
)
MAKERS: Dict[str, Maker] = {
    'arm_in_view': _arm_in_view,
    **_IN_THE_LIGHT.makers(),
    'crowded': _crowded,
    'slippery_object': _slippery_object,
    'object_moved': _object_moved,
    'goal_occupied': _goal_occupied,
    'edge_of_reach': _edge_of_reach,
}
EXTRA_MAKERS: Dict[str, Callable[[TabletopDraft, np.random.Generator], TabletopDraft]] = {
    'sticky_ring': _sticky_ring,
    'gripper_halts': _gripper_halts,
}
KINDS: List[str] = sorted(MAKERS)
