"""Scenes that many tests look at, each drawn once: hundreds of them take seconds."""

import functools

from smach_oracle.simulation.scenes import tasks


@functools.lru_cache(maxsize=None)
def drawn(task, seed, benign=False, **more):
    """What tasks.draw() gives, for tests that patch nothing of it. It cannot be changed."""
    return tasks.draw(task, seed, benign, **more)
