"""A lab that goes on from trial to trial, as the world's node keeps it."""

import json
import math
from pathlib import Path
from typing import Any, Dict, Mapping, Optional

from ..physics.judge import TrialVerdict
from ..physics.leaving import left_by
from ..physics.world import World
from ..scenes.lab import SECONDS, LabRun, LabState, begins_at, lab_scene, state_from
from ..scenes.scene import Scene
from .settings import WorldSettings


class Lab:
    """The run, the hour, and how the last trial has left the lab."""

    def __init__(self, run: LabRun, state: Optional[LabState], settings: WorldSettings) -> None:
        self._run = run
        self._state = state
        self._settings = settings

    def scene(self, seed: int) -> Scene:
        """Return what a trial finds.

        :raises ValueError: for a seed before the run's first.
        """
        if seed < self._run.seed:
            raise ValueError(
                'seed is {}; allowed: {} or more, where the run begins'.format(seed, self._run.seed)
            )
        return lab_scene(
            self._settings.task,
            self._run,
            seed,
            self._state,
            self._settings.benign,
            self._settings.lasting,
        )

    def leave(self, world: World, verdict: TrialVerdict, took_s: float) -> Dict[str, Any]:
        """Have a trial end, and return what its line of truth says of it.

        :param took_s: s of the world's time.
        """
        began = begins_at(self._run, world.scene.seed, self._state)
        self._state = left_by(world, verdict.success, began, began + took_s / SECONDS)
        return {'hour': began, 'left': self._state.as_data()}


def read_lab(settings: WorldSettings) -> Lab:
    """Return the lab that the settings name.

    :raises ValueError: where its file cannot be read, or is not a lab file.
    """
    try:
        data = json.loads(Path(settings.lab).read_text(encoding='utf-8'))
        seed, slot_h, left = data['seed'], data['slot_h'], data['left']
        if not isinstance(seed, int) or seed < 0 or not 0 < slot_h < math.inf:
            raise ValueError(
                'seed is {}, slot_h is {}; allowed: a whole number from 0, and a '
                'number of hours above 0'.format(seed, slot_h)
            )
        state = state_from(left) if isinstance(left, Mapping) else None
    except (OSError, ValueError, KeyError, TypeError) as err:
        raise ValueError('~lab: {}: {!r}'.format(settings.lab, err)) from err
    return Lab(LabRun(seed, float(slot_h)), state, settings)
