"""Random numbers of a trial: each use has a name, and so draws of its own."""

import zlib

import numpy as np


def generator_for(seed: int, what: str) -> np.random.Generator:
    """The generator of one use in one trial. A use that is added leaves the others as they were.

    :param seed: of the trial, 0 or more.
    :param what: the use's name.
    """
    return np.random.default_rng([seed, zlib.crc32(what.encode())])
