"""The kitchen of the second use case (paper, VI-B): a refrigerator with drinks, and a person."""
from typing import List, Tuple

import numpy as np

from smach_oracle.pr2.kitchen import Kitchen
from smach_oracle.pr2.planning.travel import TRAVEL
from smach_oracle.pr2.robot import ARM_JOINTS, ARMS, FINGER_JOINTS

from .fridge import DOOR_JOINT, fridge_urdf
from .kitchen_causes import KitchenDraft, with_causes
from .person import PALM, PALM_SIZE, person
from .scene import Body, Goal, RobotStart, Scene

TASK = 'drink_retrieval'
DRINK_RADIUS, DRINK_HEIGHT, DRINK_MASS = 0.031, 0.12, 0.33
ORDERED = 'drink_0'  # the red one: red is what the task orders
COLOURS = ((0.80, 0.15, 0.12), (0.12, 0.45, 0.20), (0.90, 0.60, 0.10), (0.15, 0.30, 0.70),
           (0.60, 0.20, 0.55))
DEPTHS, SIDES = (0.05, 0.15), (-0.16, 0.10)  # m, in the fridge's frame, where drinks stand
CLEAR = 0.115  # m between the middles of drinks, where nothing is crowded
DOOR_FRICTION = 3.0  # N m, dry
START_TORSO = 0.15  # m


def draw(seed: int, benign: bool = False) -> Scene:
    """The scene of a trial.

    :param benign: without any reason to fail that could be left out.
    :raises ValueError: for a negative seed.
    """
    if seed < 0:
        raise ValueError('seed is {}; allowed: 0 or more'.format(seed))
    generator = np.random.default_rng([seed, 2])
    kitchen = Kitchen()
    draft = KitchenDraft(tuple(_drinks(generator, kitchen)), kitchen.place[:2],
                         kitchen.width / 2 - kitchen.wall)
    if not benign:
        draft = with_causes(draft, seed)
    goal = Goal('in_hand', ORDERED, PALM, PALM_SIZE[0] / 2)
    return Scene(TASK, seed, (_fridge(kitchen),) + draft.drinks + person(), goal,
                 RobotStart(_posture(), drive_error=draft.drive_error),
                 disturbances=draft.disturbances, causes=draft.causes)


def _fridge(kitchen: Kitchen) -> Body:
    x, y, yaw = kitchen.place
    return Body('fridge', 'urdf', (0.0, 0.0, 0.0), (x, y, 0.0), yaw, urdf=fridge_urdf(kitchen),
                joints=((DOOR_JOINT, 0.0),), joint_friction=((DOOR_JOINT, DOOR_FRICTION),))


def _drinks(generator: np.random.Generator, kitchen: Kitchen) -> List[Body]:
    """Upright on the shelf, apart from each other, near the front; the foremost comes first."""
    places: List[Tuple[float, float]] = []
    for _ in range(100):
        x, y = generator.uniform(*DEPTHS), generator.uniform(*SIDES)
        if len(places) < 3 and all(
                np.hypot(x - other[0], y - other[1]) > CLEAR for other in places):
            places.append((float(x), float(y)))
    places.sort()
    floor = kitchen.shelves[kitchen.drinks_shelf]
    return [
        Body('drink_{}'.format(index), 'cylinder', (DRINK_RADIUS, DRINK_RADIUS, DRINK_HEIGHT),
             (kitchen.place[0] + x, kitchen.place[1] + y, floor + DRINK_HEIGHT / 2 + 0.001),
             mass=DRINK_MASS, colour=COLOURS[index % len(COLOURS)])
        for index, (x, y) in enumerate(places)
    ]


def _posture() -> Tuple[Tuple[str, float], ...]:
    arms = [pair for arm in ARMS for pair in zip(ARM_JOINTS[arm], TRAVEL[arm])]
    fingers = [(name, 0.0) for arm in ARMS for name in FINGER_JOINTS[arm]]
    return tuple(arms + fingers + [('torso_lift_joint', START_TORSO)])
