"""The tasks that the world has scenes for."""

from typing import Callable, Dict

from . import kitchen_scene, tabletop_scene
from .cause_draws import LASTING_SHARE
from .scene import Scene

SCENES: Dict[str, Callable[[int, bool, float, bool], Scene]] = {
    tabletop_scene.TASK: tabletop_scene.draw,
    kitchen_scene.TASK: kitchen_scene.draw,
}
TASKS = tuple(SCENES)


def draw(
    task: str,
    seed: int,
    benign: bool,
    lasting: float = LASTING_SHARE,
    extra: bool = False,
) -> Scene:
    """The scene of a trial.

    :param benign: without any reason to fail.
    :param lasting: the share of the causes that last, 0 to 1.
    :param extra: with one of the extra causes, in place of the usual ones.
    :raises KeyError: for a task that is not in TASKS.
    :raises ValueError: for a negative seed.
    """
    return SCENES[task](seed, benign, lasting, extra)
