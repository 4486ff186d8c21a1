"""The person who waits for the drink: a hand that holds a tray. Nothing of the person moves."""

from typing import Tuple

import numpy as np

from smach_oracle.geometry.transforms import VectorLike

from .scene import Body, Vector

PALM: Vector = (0.0, 0.62, 0.85)  # m, the middle of its upper face
PALM_SIZE: Vector = (0.20, 0.20, 0.03)
HAND_SIZE: Vector = (0.09, 0.17, 0.045)
SKIN, HAIR, SHIRT = (0.87, 0.68, 0.55), (0.22, 0.15, 0.10), (0.25, 0.42, 0.62)
TRAY, TROUSERS, SHOES = (0.62, 0.45, 0.28), (0.20, 0.22, 0.27), (0.12, 0.11, 0.11)
# centre and size in m from where the person stands, looking to -y
PARTS = (
    ('chest', (0.0, 0.0, 1.03), (0.37, 0.22, 0.52), SHIRT),
    ('hips', (0.0, 0.0, 0.77), (0.33, 0.21, 0.26), TROUSERS),
    ('neck', (0.0, 0.01, 1.29), (0.10, 0.10, 0.16), SKIN),
    ('head', (0.0, -0.01, 1.42), (0.155, 0.19, 0.24), SKIN),
    ('hair', (0.0, 0.015, 1.475), (0.17, 0.19, 0.16), HAIR),
    ('right_leg', (-0.085, 0.0, 0.42), (0.15, 0.16, 0.80), TROUSERS),
    ('left_leg', (0.085, 0.0, 0.42), (0.15, 0.16, 0.80), TROUSERS),
    ('right_shoe', (-0.09, -0.05, 0.045), (0.10, 0.27, 0.09), SHOES),
    ('left_shoe', (0.09, -0.05, 0.045), (0.10, 0.27, 0.09), SHOES),
    ('left_hand', (0.235, -0.07, 0.66), (0.07, 0.09, 0.16), SKIN),
)
# from and to, in m from there, and how thick
LIMBS = (
    ('right_sleeve', (-0.19, 0.0, 1.22), (-0.20, -0.09, 0.86), 0.10),
    ('left_sleeve', (0.19, 0.0, 1.22), (0.23, 0.02, 0.90), 0.10),
    ('left_forearm', (0.23, 0.03, 0.95), (0.235, -0.06, 0.68), 0.085),
)
STANDS: Vector = (0.20, 0.53, 0.0)  # m, from the palm
WRIST, ELBOW = (0.0, 0.07, 0.765), (0.0, 0.45, 0.885)  # x and y in m from the palm


def person(at: Vector = PALM) -> Tuple[Body, ...]:
    """The palm, which is the tray, and everything else that is seen of the person.

    :param at: m, the middle of the palm's upper face.
    """
    x, y, top = at
    palm = Body('palm', 'box', PALM_SIZE, (x, y, top - PALM_SIZE[2] / 2), colour=TRAY)
    arm = _limb('person_arm', (x, y, 0.0), WRIST, ELBOW, 0.08)
    hand = Body(
        'person_hand',
        'round',
        HAND_SIZE,
        (x, y + 0.02, top - PALM_SIZE[2] - HAND_SIZE[2] / 2),
        colour=SKIN,
    )
    stands = (x + STANDS[0], y + STANDS[1], 0.0)
    parts = [
        Body('person_' + name, 'round', size, _sum(stands, centre), colour=colour)
        for name, centre, size, colour in PARTS
    ]
    limbs = [
        _limb('person_' + name, stands, start, end, thick) for name, start, end, thick in LIMBS
    ]
    return (palm, hand, arm) + tuple(parts) + tuple(limbs)


def _limb(name: str, origin: Vector, start: Vector, end: Vector, thick: float) -> Body:
    """Something round in a sleeve, from start to end."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    roll = float(np.arctan2(-along[1], np.hypot(along[0], along[2])))
    pitch = float(np.arctan2(along[0], along[2]))
    return Body(
        name,
        'round',
        (thick, thick, length + thick / 2),
        _sum(origin, np.add(start, end) / 2),
        roll=roll,
        pitch=pitch,
        colour=SHIRT,
    )


def _sum(one: Vector, other: VectorLike) -> Vector:
    x, y, z = (float(a + b) for a, b in zip(one, other))
    return x, y, z
