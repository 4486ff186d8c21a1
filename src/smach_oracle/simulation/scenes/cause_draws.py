"""The causes of a trial, and how long they last: drawn from its seed.

Every draw has a generator of its own, so that another kind of cause leaves the others as they were.
"""

from typing import Iterator, List, Mapping, Tuple

import numpy as np

from .chance import generator_for

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


def extra_kind(
    seed: int, task: str, kinds: Mapping[str, WEIGHTS]
) -> Tuple[str, np.random.Generator]:
    """The one kind of a trial with extra causes, and the generator for its values.

    Half of the trials have a kind that lasts.

    :param kinds: as in drawn_kinds().
    """
    which, lasts = generator_for(seed, 'extra_causes:' + task).random(2)
    kind = _chosen(kinds[LASTING if lasts < 0.5 else PASSING], which)
    return kind, generator_for(seed, 'extra_causes:{}:{}'.format(task, kind))


def _chosen(weights: WEIGHTS, share: float) -> str:
    """The kind at a share, 0 to 1, of all weights together, in the order of their names."""
    names = sorted(weights)
    ends = np.cumsum([weights[name] for name in names])
    return names[min(int(np.searchsorted(ends, share * ends[-1], side='right')), len(names) - 1)]
