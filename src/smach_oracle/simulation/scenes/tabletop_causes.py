"""Why a trial at the table may fail: physical causes, drawn from the trial's seed.

Neither the executive nor the subsystems learn of them.
"""
import functools
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.robot import ARM_JOINTS, BASE_FRAME, TOOL_FRAME

from .drafts import caused
from .scene import Body, Disturbance, SceneCause

TABLE_TOP = 0.72  # m
GOAL = (0.60, -0.35)  # m, where the task puts the object
TORSO = 0.22  # m
EYE = np.array([-0.05, 0.0, 1.42])  # m, about where the head camera is
ROOM = 0.12  # m, around where the nearest thing is moved to
TARGET = 0  # the thing that stands nearest

CHANCE = {
    'arm_in_view': 0.085, 'glare': 0.075, 'dim_light': 0.05, 'crowded': 0.03,
    'slippery_object': 0.02, 'object_moved': 0.075, 'goal_occupied': 0.012, 'edge_of_reach': 0.01
}


class TabletopDraft(NamedTuple):
    """A scene at the table to which causes are being added."""

    things: Tuple[Body, ...]
    disturbances: Tuple[Disturbance, ...] = ()
    causes: Tuple[SceneCause, ...] = ()


def with_causes(draft: TabletopDraft, seed: int) -> TabletopDraft:
    """A scene with the causes that its seed has for it: mostly none, seldom two."""
    for number, kind in enumerate(sorted(CHANCE)):
        generator = np.random.default_rng([seed, 62, number])
        if generator.random() < CHANCE[kind]:
            draft = MAKERS[kind](draft, generator) or draft
    return draft


def _arm_in_view(draft: TabletopDraft, generator: np.random.Generator) -> Optional[TabletopDraft]:
    """Somebody pushes the left arm between the camera and the nearest thing.

    That happens after the head has turned there.
    """
    thing = draft.things[TARGET]
    chain = _left_arm()
    for _ in range(60):
        top = np.array(thing.position) + [0.0, 0.0, thing.size[2] / 2]
        point = top + generator.uniform(0.2, 0.45) * (EYE - top) + [
            0.0, generator.uniform(-0.06, 0.02), 0.0
        ]
        angles = generator.uniform((-1.5, -0.2, -1.6), (1.5, 0.6, -0.2))
        pose = from_rpy(point, *angles)
        q = chain.inverse(pose, np.array([0.6, 0.2, 1.2, -1.6, 0.0, -0.8, 0.0]), generator)
        if q is not None and point[2] > TABLE_TOP + 0.22:
            turned = chain.nearest_turn(q, np.zeros(len(q)))
            values = tuple(zip(ARM_JOINTS['left'], (float(each) for each in turned)))
            return caused(
                draft, 'arm_in_view',
                'the left arm is pushed over the table, its hand {:.0f} cm above it'.format(
                    100 * (point[2] - TABLE_TOP)), Disturbance('arm', 'look_at', values))
    return None


@functools.lru_cache(maxsize=1)
def _left_arm() -> JointChain:
    return JointChain.from_urdf(pr2_urdf().read_text(), BASE_FRAME, TOOL_FRAME['left'],
                                {'torso_lift_joint': TORSO})


def _glare(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    frames = 2 if generator.random() < 0.15 else 1
    dropout = float(generator.uniform(0.92, 0.99))
    return caused(
        draft, 'glare',
        'light falls into the camera for {} frame(s): {:.0f}% of the depth is lost'.format(
            frames, 100 * dropout),
        Disturbance('glare', 'look_at', (('dropout', dropout), ('frames', frames))))


def _dim_light(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    brightness = float(generator.uniform(0.02, 0.12))
    return caused(draft, 'dim_light',
                  'the light fails for one frame, down to {:.0f}%'.format(100 * brightness),
                  Disturbance('dim', 'look_at', (('brightness', brightness), ('frames', 1))))


def _crowded(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    """A further thing stands close behind the nearest one, or beside it."""
    thing, other = draft.things[TARGET], draft.things[-1]
    gap = float(generator.uniform(0.014, 0.032))
    away = float(np.arctan2(thing.position[1], thing.position[0]) + generator.uniform(-1.5, 1.5))
    far = _radius(thing) + _radius(other) + gap
    spot = (thing.position[0] + far * np.cos(away), thing.position[1] + far * np.sin(away))
    moved = other._replace(position=(float(spot[0]), float(spot[1]), other.position[2]))
    return caused(draft._replace(things=draft.things[:-1] + (moved,)), 'crowded',
                  'another thing stands {:.1f} cm beside the nearest one'.format(100 * gap))


def _slippery_object(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    friction = float(generator.uniform(0.04, 0.07))
    mass = float(generator.uniform(0.4, 0.7))
    thing = draft.things[TARGET]._replace(friction=friction, mass=mass)
    return caused(
        draft._replace(things=(thing,) + draft.things[1:]), 'slippery_object',
        'the nearest thing is slippery and heavy: friction {:.2f}, {:.2f} kg'.format(
            friction, mass))


def _object_moved(draft: TabletopDraft, generator: np.random.Generator) -> Optional[TabletopDraft]:
    """Somebody moves the nearest thing after it has been detected, to where there is room."""
    thing = draft.things[TARGET]
    for _ in range(20):
        way = float(generator.uniform(0.05, 0.08))
        heading = float(generator.uniform(-0.9, 0.9))  # away from the robot
        spot = (thing.position[0] + way * np.cos(heading),
                thing.position[1] + way * np.sin(heading))
        if all(
                np.hypot(other.position[0] - spot[0], other.position[1] - spot[1]) > ROOM
                for other in draft.things[1:]):
            values = (('dx', way * np.cos(heading)), ('dy', way * np.sin(heading)), ('duration',
                                                                                     0.8))
            return caused(
                draft, 'object_moved',
                'somebody moves the nearest thing by {:.0f} cm, once it has been seen'.format(100 *
                                                                                              way),
                Disturbance('nudge:' + thing.name, 'see', values))
    return None


def _goal_occupied(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    """Things stand on both sides of the place where the object shall go."""
    heading = float(generator.uniform(-np.pi, np.pi))
    distances = [float(generator.uniform(0.07, 0.11)) for _ in range(2)]
    moved = []
    for other, away, side in zip(draft.things[-2:], distances, (heading, heading + np.pi)):
        spot = (float(GOAL[0] + away * np.cos(side)), float(GOAL[1] + away * np.sin(side)),
                other.position[2])
        moved.append(other._replace(position=spot))
    return caused(draft._replace(things=draft.things[:-2] + tuple(moved)), 'goal_occupied',
                  'things stand {:.0f} and {:.0f} cm beside the place for the object'.format(
                      *(100 * away for away in distances)))


def _edge_of_reach(draft: TabletopDraft, generator: np.random.Generator) -> TabletopDraft:
    """The nearest thing stands at the edge of the right arm's reach; the others are beyond it."""
    thing = draft.things[TARGET]
    spot = (float(generator.uniform(0.50, 0.60)), float(generator.uniform(0.34, 0.50)))
    moved = thing._replace(position=(spot[0], spot[1], thing.position[2]))
    others = tuple(other for other in draft.things[1:]
                   if np.hypot(other.position[0] - spot[0], other.position[1] - spot[1]) > 0.12
                   and np.hypot(*other.position[:2]) > np.hypot(*spot) + 0.04)
    return caused(draft._replace(things=(moved,) + others), 'edge_of_reach',
                  'the nearest thing stands {:.0f} cm to the left'.format(100 * spot[1]))


def _radius(thing: Body) -> float:
    if thing.shape == 'box':
        return float(np.hypot(*thing.size[:2])) / 2
    return thing.size[0] if thing.shape == 'cylinder' else thing.size[0] / 2


Maker = Callable[[TabletopDraft, np.random.Generator], Optional[TabletopDraft]]
MAKERS: Dict[str, Maker] = {
    'arm_in_view': _arm_in_view, 'glare': _glare, 'dim_light': _dim_light, 'crowded': _crowded,
    'slippery_object': _slippery_object, 'object_moved': _object_moved,
    'goal_occupied': _goal_occupied, 'edge_of_reach': _edge_of_reach
}
KINDS: List[str] = sorted(CHANCE)
