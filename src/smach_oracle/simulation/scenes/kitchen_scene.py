"""The kitchen of the second use case (paper, VI-B): a refrigerator with drinks, and a person."""

from typing import List, Sequence, Tuple

import numpy as np

from smach_oracle.pr2.kitchen import Kitchen, odom_from_pose
from smach_oracle.pr2.planning.travel import TRAVEL
from smach_oracle.pr2.robot import ARM_JOINTS, ARMS, FINGER_JOINTS

from .calibration import camera_error, encoder_errors
from .cause_draws import LASTING_SHARE
from .chance import generator_for
from .fridge import fridge
from .kitchen_causes import KitchenDraft, with_causes, with_extra_cause
from .person import PALM_SIZE, person
from .scene import Body, Goal, RobotStart, Scene
from .unlike_the_map import drink_size, localisation_error, true_kitchen, true_palm

TASK = 'drink_retrieval'
DRINK_MASS = 0.33  # kg
ORDERED = 'drink_0'  # the red one, wherever it stands: red is what the task orders
COLOURS = (
    (0.80, 0.15, 0.12),
    (0.12, 0.45, 0.20),
    (0.90, 0.60, 0.10),
    (0.15, 0.30, 0.70),
    (0.60, 0.20, 0.55),
)
DEPTHS, SIDES = (0.05, 0.15), (-0.16, 0.10)  # m, in the fridge's frame, where drinks stand
CLEAR = 0.115  # m between the middles of drinks, where nothing is crowded
# m to each side of a drink's middle: no other's middle is there, before one that the arm can reach.
# An open hand is 0.07 to each side, a drink 0.03, and camera and arm err by 0.01
HAND = 0.11
START_TORSO = 0.15  # m


def draw(
    seed: int, benign: bool = False, lasting: float = LASTING_SHARE, extra: bool = False
) -> Scene:
    """The scene of a trial.

    :param benign: without any reason to fail that could be left out.
    :param lasting: the share of the causes that last, 0 to 1.
    :param extra: with one of the extra causes, in place of the usual ones.
    :raises ValueError: for a negative seed.
    """
    if seed < 0:
        raise ValueError('seed is {}; allowed: 0 or more'.format(seed))
    kitchen = true_kitchen(seed)
    draft = drafted(kitchen, fresh_drinks(seed, kitchen))._replace(
        localisation_error=localisation_error(seed)
    )
    if extra:
        draft = with_extra_cause(draft, seed, TASK)
    elif not benign:
        draft = with_causes(draft, seed, lasting)
    robot = RobotStart(
        posture(), encoder_errors=encoder_errors(seed), camera_error=camera_error(seed)
    )
    return composed(seed, draft, kitchen, robot)


def drafted(kitchen: Kitchen, drinks: Tuple[Body, ...]) -> KitchenDraft:
    """Return a kitchen with drinks and without a cause."""
    return KitchenDraft(drinks, kitchen.place[:2], kitchen.width / 2 - kitchen.wall)


def composed(seed: int, draft: KitchenDraft, kitchen: Kitchen, robot: RobotStart) -> Scene:
    """Return the scene of a draft.

    :param robot: it gets the errors of the draft.
    """
    palm = true_palm(seed)
    goal = Goal('in_hand', ORDERED, palm, PALM_SIZE[0] / 2)
    robot = robot._replace(
        drive_error=draft.drive_error,
        localisation_error=draft.localisation_error,
        drive_bias=draft.drive_bias,
    )
    return Scene(
        TASK,
        seed,
        (fridge(kitchen, draft.closing),) + draft.drinks + person(palm),
        goal,
        robot,
        disturbances=draft.disturbances,
        causes=draft.causes,
    )


def fresh_drinks(seed: int, kitchen: Kitchen) -> Tuple[Body, ...]:
    """Upright on the shelf, apart from each other, near the front.

    The ordered one comes first. It is any of those before which there is room for a hand. The
    others follow, the foremost of them first.
    """
    generator = np.random.default_rng([seed, 2])
    places: List[Tuple[float, float]] = []
    for _ in range(100):
        x, y = generator.uniform(*DEPTHS), generator.uniform(*SIDES)
        if len(places) < 3 and all(
            np.hypot(x - other[0], y - other[1]) > CLEAR for other in places
        ):
            places.append((float(x), float(y)))
    places.sort()
    in_reach = [place for place in places if is_in_reach(place, places)]
    places.insert(
        0,
        places.pop(
            places.index(in_reach[int(generator_for(seed, 'ordered').integers(len(in_reach)))])
        ),
    )
    return tuple(drink_at(seed, index, place, kitchen) for index, place in enumerate(places))


def is_in_reach(place: Tuple[float, float], places: Sequence[Tuple[float, float]]) -> bool:
    """Whether none of the places (m, in the fridge's frame) is in a hand's way from the front."""
    return not any(x < place[0] and abs(y - place[1]) < HAND for x, y in places)


def drink_at(seed: int, index: int, place: Tuple[float, float], kitchen: Kitchen) -> Body:
    """A can at a place (m) in the fridge's frame."""
    radius, height = drink_size(seed, index)
    spot = odom_from_pose(kitchen, place[0], place[1], 0.0)[:2, 3]
    floor = kitchen.shelves[kitchen.drinks_shelf]
    return Body(
        'drink_{}'.format(index),
        'cylinder',
        (radius, radius, height),
        (float(spot[0]), float(spot[1]), floor + height / 2 + 0.001),
        mass=DRINK_MASS,
        colour=COLOURS[index % len(COLOURS)],
    )


def posture() -> Tuple[Tuple[str, float], ...]:
    """Return where the joints are at the beginning: arms stowed, grippers closed."""
    arms = [pair for arm in ARMS for pair in zip(ARM_JOINTS[arm], TRAVEL[arm])]
    fingers = [(name, 0.0) for arm in ARMS for name in FINGER_JOINTS[arm]]
    return tuple(arms + fingers + [('torso_lift_joint', START_TORSO)])
