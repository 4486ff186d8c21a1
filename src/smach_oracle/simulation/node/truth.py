"""The record of a trial's truth: one line of JSON for each trial that has ended."""

import time
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

from ..physics.cause_log import CauseSpan
from ..physics.harm import Harm, harm_record
from ..physics.judge import TrialVerdict
from ..scenes.scene import Scene


class TrialTruth:
    """The record of a trial that is under way.

    :param sim_s: simulated s that have passed in the world when it begins.
    :param began_s: wall s at which its reset was asked for, of time.monotonic(). None means now.
    """

    def __init__(self, scene: Scene, sim_s: float, began_s: Optional[float] = None) -> None:
        self._scene = scene
        self._sim_s = sim_s
        self._began = time.monotonic() if began_s is None else began_s
        self._causes: List[Dict[str, Any]] = []
        self.happened(
            [CauseSpan(each.kind, each.text, each.lasting, None, None) for each in scene.causes]
        )
        self._passed: Dict[str, float] = {}  # s of the world's time, by what took it
        self._charged: Dict[str, float] = {}  # simulated s at which work began that goes on

    def passed(self, seconds: float, what: str) -> None:
        """Add up the world's time (s) that passed for some work.

        Work that has begun counts by its begin and end alone.
        """
        if what not in self._charged:
            self._add(seconds, what)

    def charge(self, what: str, on: bool, sim_s: float) -> None:
        """Some work begins (on) or ends at a time, simulated s. All time between is its own."""
        if on:
            self._charged.setdefault(what, sim_s)
        elif what in self._charged:
            self._add(sim_s - self._charged.pop(what), what)

    def _add(self, seconds: float, what: str) -> None:
        self._passed[what] = self._passed.get(what, 0.0) + seconds

    def happened(self, spans: Sequence[CauseSpan]) -> None:
        """Take the world's log of the causes, as it is at the trial's end."""
        self._causes = [each._asdict() for each in spans]

    def record(
        self,
        verdict: TrialVerdict,
        harm: Tuple[Harm, ...],
        sim_s: float,
        spent: Mapping[str, float],
        used: Mapping[str, float],
    ) -> Dict[str, Any]:
        """Return the record that is to be written at its end.

        :param harm: all that came to harm in it.
        :param spent: wall s by what the world's process did in them.
        :param used: processor s of the world's thread, likewise.
        """
        wall = time.monotonic() - self._began
        for what in tuple(self._charged):
            self.charge(what, False, sim_s)
        return {
            'seed': self._scene.seed,
            'task': self._scene.task,
            'success': verdict.success,
            'why': verdict.why,
            'wrong_object': verdict.wrong_object,
            'damage': harm_record(harm),
            'causes': self._causes,
            'sim_s': round(sim_s - self._sim_s, 3),
            'passed_s': {what: round(seconds, 3) for what, seconds in sorted(self._passed.items())},
            'wall_s': round(wall, 3),
            'share': {
                what: round(seconds / max(wall, 1e-9), 4) for what, seconds in sorted(spent.items())
            },
            'cpu_s': {what: round(seconds, 4) for what, seconds in sorted(used.items())},
        }
