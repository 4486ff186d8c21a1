"""The hall's own log of a trial's causes: what each is, when it came, and when it was gone."""

import math
from typing import Any, Dict, List, Mapping, Set

from .causes import LASTING, TrialScene
from .extra_causes import SLACK_TYRE, STEAM


class HallLog:
    """When the causes of one trial began and ended."""

    def __init__(self, scene: TrialScene) -> None:
        self._texts = {kind: in_words(kind, scene) for kind in scene.causes}
        self._began: Dict[str, float] = {}
        self._ended: Dict[str, float] = {}

    def look(self, second: float, there: Set[str]) -> None:
        """Take in which kinds of causes are there at a moment, s since the trial began.

        A cause that comes again has not ended.
        """
        for kind in self._texts:
            if kind in there:
                self._began.setdefault(kind, second)
                self._ended.pop(kind, None)
            elif kind in self._began:
                self._ended.setdefault(kind, second)

    def record(self) -> List[Dict[str, Any]]:
        """Return the causes as a line of truth has them. Times are null where they never came."""
        return [
            {
                'kind': kind,
                'text': text,
                'lasting': kind in LASTING,
                'began_s': _rounded(self._began, kind),
                'ended_s': _rounded(self._ended, kind),
            }
            for kind, text in self._texts.items()
        ]


def _rounded(moments: Mapping[str, float], kind: str) -> Any:
    return round(moments[kind], 2) if kind in moments else None


def in_words(kind: str, scene: TrialScene) -> str:
    """Return a cause of a scene in words, with figures."""
    wet, glare, sag = scene.wet, scene.glare, scene.sag
    if kind == 'wet_floor' and wet is not None:
        return 'a puddle, {:.2f} m around ({:.1f}, {:.1f}), turns it by {:+.2f} rad a m'.format(
            wet.radius, wet.x, wet.y, wet.drift
        )
    if kind == 'glare' and glare is not None:
        return 'panel {} throws sunlight at {:+.0f} degrees from {:.0f} to {:.0f} s'.format(
            glare.panel, math.degrees(glare.angle), glare.begins_s, glare.ends_s
        )
    if kind == 'low_battery' and sag is not None:
        return 'the voltage breaks down from {:.0f} to {:.0f} s'.format(*sag)
    if kind == SLACK_TYRE:
        return 'a slack tyre turns it by {:+.3f} rad a m'.format(scene.veer)
    if kind == STEAM and scene.plume is not None:
        x, y, _, begins_s, ends_s = scene.plume
        return 'a trap at ({:.1f}, {:.1f}) lets off steam from {:.0f} to {:.0f} s'.format(
            x, y, begins_s, ends_s
        )
    for errand in scene.errands:
        if errand.cause == kind:
            (x, y), stands_s = errand.places[1], errand.stands_s[1]
            return 'somebody comes to ({:.1f}, {:.1f}) and stands there for {:.0f} s'.format(
                x, y, stands_s
            )
    raise ValueError('cause {!r}: no words for it'.format(kind))
