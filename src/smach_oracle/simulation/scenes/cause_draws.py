"""The causes of a trial, how long they last, and where light falls: drawn from its seed.

Every draw has a generator of its own, so that another kind of cause leaves the others as they were.
"""

from typing import Iterator, List, Mapping, Tuple

import numpy as np

from smach_oracle.geometry.transforms import rotation_about

LASTING, PASSING = 'lasting', 'passing'
LASTING_SHARE = 0.6  # of the causes. A parameter of the world may say otherwise
ANOTHER = 0.10  # chance of a second cause, where there is one
WEIGHTS = Mapping[str, float]


def drawn_kinds(
    seed: int, stream: int, amount: float, kinds: Mapping[str, WEIGHTS], lasting: float
) -> Iterator[Tuple[str, np.random.Generator]]:
    """The kinds of causes of a trial, each with the generator for its values.

    With another `lasting` the same trials have causes, and a kind has the same values. The second
    cause is of another kind than the first.

    :param stream: of random numbers, one for each task.
    :param amount: chance of a cause, 0 to 1.
    :param kinds: weights of the kinds that last, and of those that pass.
    :param lasting: chance of a kind that lasts.
    """
    found: List[str] = []
    for number in range(2):
        generator = np.random.default_rng([seed, stream, 100 + number])
        there, lasts, which = generator.random(3)
        if there >= (ANOTHER if number else amount):
            return
        weights = {
            name: weight
            for name, weight in kinds[LASTING if lasts < lasting else PASSING].items()
            if name not in found
        }
        if not weights:
            return
        found.append(_chosen(weights, which))
        yield found[-1], np.random.default_rng([seed, stream, *found[-1].encode('ascii')])


def _chosen(weights: WEIGHTS, share: float) -> str:
    """The kind at a share, 0 to 1, of all weights together, in the order of their names."""
    names = sorted(weights)
    ends = np.cumsum([weights[name] for name in names])
    return names[min(int(np.searchsorted(ends, share * ends[-1], side='right')), len(names) - 1)]


def passing_seconds(generator: np.random.Generator) -> float:
    """Draw how long, s, somebody stands in the light, or something that moves reflects it."""
    return float(min(60.0, generator.lognormal(np.log(4.0), 0.8)))


def cloud_minutes(generator: np.random.Generator) -> float:
    """Draw how long, min, a cloud hides the sun."""
    return float(min(60.0, generator.lognormal(np.log(8.0), 0.6)))


def dazzling(
    eye: np.ndarray, looks_at: np.ndarray, thing: np.ndarray, generator: np.random.Generator
) -> Tuple[Tuple[str, float], ...]:
    """Values of a glare that hides a thing from a camera.

    What reflects the light stands where the thing would be if it were mirrored at the middle of the
    image: its own mirror image in the lens then lies on the thing, or a few degrees next to it.

    :param eye: (3,) m, where the camera is.
    :param looks_at: (3,) m, the middle of its image.
    :param thing: (3,) m.
    """
    axis = (looks_at - eye) / np.linalg.norm(looks_at - eye)
    way = thing - eye
    mirrored = 2 * (way @ axis) * axis - way
    aside = np.cross(axis, generator.normal(size=3))
    turn = rotation_about(aside / np.linalg.norm(aside), float(generator.normal(0.0, 0.05)))
    place = eye + turn @ mirrored
    values = dict(
        zip(('x', 'y', 'z'), place),
        **dict(zip(('eye_x', 'eye_y', 'eye_z'), eye)),
        radius=generator.uniform(0.10, 0.22),
        lobe=generator.uniform(0.15, 0.25),
    )
    return tuple((name, float(value)) for name, value in values.items())
