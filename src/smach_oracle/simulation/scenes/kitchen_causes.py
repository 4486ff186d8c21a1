"""Why a trial in the kitchen may fail: physical causes, drawn from the trial's seed.

Neither the executive nor the subsystems learn of them.
"""
from typing import Callable, Dict, List, NamedTuple, Tuple

import numpy as np

from .drafts import caused
from .scene import Body, Disturbance, SceneCause, Vector

CHANCE = {
    'base_misplaced': 0.14, 'door_swings_back': 0.16, 'crowded': 0.02, 'glare': 0.16,
    'slippery_drink': 0.04, 'drink_moved': 0.10
}
TARGET = 0  # the drink that stands nearest to the front
LONG_GLARE = 0.1  # share of glares that last for two images
ROOM = 0.11  # m between the middles of two drinks, or from that of one to a wall, that is enough
# sigma of x, y (m) and yaw (rad) that a drive misses its goal by
STEADY: Vector = (0.008, 0.008, 0.006)


class KitchenDraft(NamedTuple):
    """A kitchen to which causes are being added."""

    drinks: Tuple[Body, ...]
    front: Tuple[float, float]  # x, y of the middle of the fridge's opening, m
    half_width: float  # m from there to the inner side of a wall
    drive_error: Vector = STEADY
    disturbances: Tuple[Disturbance, ...] = ()
    causes: Tuple[SceneCause, ...] = ()


def with_causes(draft: KitchenDraft, seed: int) -> KitchenDraft:
    """A kitchen with the causes that its seed has for it."""
    for number, kind in enumerate(sorted(CHANCE)):
        generator = np.random.default_rng([seed, 72, number])
        if generator.random() < CHANCE[kind]:
            draft = MAKERS[kind](draft, generator)
    return draft


def _base_misplaced(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """Every drive ends centimetres off: the base is in the door's way, or too far for the arm."""
    sigma = float(generator.uniform(0.05, 0.075))
    return caused(draft._replace(drive_error=(sigma, 0.3 * sigma, 0.25 * sigma)), 'base_misplaced',
                  'drives end {:.1f} cm too near or too far (sigma)'.format(100 * sigma))


def _door_swings_back(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """The opened door falls back, half shut, while the robot drives in."""
    angle = float(generator.uniform(0.5, 0.9))
    return caused(draft, 'door_swings_back',
                  'the open door swings back to {:.0f} degrees'.format(np.degrees(angle)),
                  Disturbance('swing:fridge', 'drive:9', (('angle', angle), ('duration', 1.5))))


def _crowded(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """A further drink stands right beside the nearest one."""
    gap = float(generator.uniform(0.0, 0.012))
    heading = float(
        generator.uniform(-0.5, 0.5) + (np.pi / 2 if generator.random() < 0.5 else -np.pi / 2))
    target, other = draft.drinks[TARGET], draft.drinks[-1]
    far = target.size[0] + other.size[0] + gap
    moved = other._replace(position=(target.position[0] + far * float(np.cos(heading)),
                                     target.position[1] + far * float(np.sin(heading)),
                                     other.position[2]))
    return caused(draft._replace(drinks=draft.drinks[:-1] + (moved,)), 'crowded',
                  'two drinks stand {:.1f} cm beside each other'.format(100 * gap))


def _glare(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """The camera is dazzled when it turns to the drinks, after it has looked at the door."""
    dropout = float(generator.uniform(0.93, 0.99))
    frames = 2 if generator.random() < LONG_GLARE else 1
    return caused(
        draft, 'glare',
        'the sun shines into the camera for {} frames: {:.0f}% of the depth is lost'.format(
            frames, 100 * dropout),
        Disturbance('glare', 'look_at:4', (('dropout', dropout), ('frames', frames))))


def _slippery_drink(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    friction, mass = float(generator.uniform(0.045, 0.08)), float(generator.uniform(0.6, 0.75))
    drinks = tuple(drink._replace(friction=friction, mass=mass)
                   for drink in draft.drinks[:1]) + draft.drinks[1:]
    return caused(
        draft._replace(drinks=drinks), 'slippery_drink',
        'the nearest drink is wet and full: friction {:.2f}, {:.2f} kg'.format(friction, mass))


def _drink_moved(draft: KitchenDraft, generator: np.random.Generator) -> KitchenDraft:
    """Somebody moves the nearest drink to where there is room, after it has been detected."""
    ways = [(float(generator.uniform(0.0, 0.06)), side * float(generator.uniform(0.05, 0.09)))
            for _ in range(30) for side in (1.0, -1.0)]
    x, y = draft.drinks[TARGET].position[:2]
    dx, dy = max(ways, key=lambda way: min(ROOM, _room_at(draft, x + way[0], y + way[1])))
    values = (('dx', dx), ('dy', dy), ('duration', 0.8))
    return caused(
        draft, 'drink_moved',
        'somebody moves the nearest drink by {:.0f} cm, once it has been seen'.format(
            100 * float(np.hypot(dx, dy))),
        Disturbance('nudge:' + draft.drinks[TARGET].name, 'see:4', values))


def _room_at(draft: KitchenDraft, x: float, y: float) -> float:
    """m from a place for the nearest drink to the next drink's middle or, if nearer, to a wall."""
    gaps = [float(np.hypot(other.position[0] - x, other.position[1] - y))
            for number, other in enumerate(draft.drinks) if number != TARGET]
    return min(gaps + [draft.half_width - abs(y - draft.front[1])])


Maker = Callable[[KitchenDraft, np.random.Generator], KitchenDraft]
MAKERS: Dict[str, Maker] = {
    'base_misplaced': _base_misplaced, 'door_swings_back': _door_swings_back, 'crowded': _crowded,
    'glare': _glare, 'slippery_drink': _slippery_drink, 'drink_moved': _drink_moved
}
KINDS: List[str] = sorted(CHANCE)
