"""The world's own log of a trial's causes: when each began, and when it ended."""

from typing import Dict, List, NamedTuple, Optional, Protocol, Tuple, Union

import numpy as np

from ..scenes.scene import LOCALISATION, SceneCause
from .pr2_body import PERIOD

MOVED = 0.03  # m by which a thing, or a localisation, is moved, where that ends a cause
ARM_MOVED = 0.1  # rad by which a joint of an arm is moved, likewise
ARM_PREFIX = 'arm:'  # of what a cause ends by, before the name of a joint
Start = Union[np.ndarray, float]


class LoggedWorld(Protocol):
    """The parts of World that the log reads."""

    periods: int
    map_error: np.ndarray  # 4x4, odom_combined from the world

    def body_pose(self, name: str) -> np.ndarray:
        """See World."""

    def joints(self) -> Dict[str, float]:
        """See World."""


class CauseSpan(NamedTuple):
    """The time during which a cause was there, s since the trial began."""

    kind: str
    text: str
    lasting: bool  # whether it is meant to be there at a second try, and after a restart
    began_s: Optional[float]  # None: it never came
    ended_s: Optional[float]  # None: it was there at the end of the trial

    def there_at(self, second: float) -> bool:
        """Whether it was there at a moment, s since the trial began."""
        if self.began_s is None or second < self.began_s:
            return False
        return self.ended_s is None or second < self.ended_s


class CauseLog:
    """A log of when the causes of one trial began and ended."""

    def __init__(self, causes: Tuple[SceneCause, ...], awaited: List[str]) -> None:
        """
        :param awaited: kinds that begin with an event. The others are there from the start.
        """
        self._causes = causes
        self._began: Dict[str, int] = {each.kind: 0 for each in causes if each.kind not in awaited}
        self._ended: Dict[str, int] = {}
        self._starts: Dict[str, Dict[str, Start]] = {}

    def began(self, kind: str, period: int) -> None:
        """A cause begins at a control period."""
        self._began.setdefault(kind, period)

    def ended(self, kind: str, period: int) -> None:
        """A cause ends at a control period, if nothing has to be done for that."""
        if all(cause.kind != kind or not cause.until for cause in self._causes):
            self._ended[kind] = period

    def look(self, world: LoggedWorld, busy: bool) -> None:
        """See whether something has been done about those that last until then.

        :param busy: whether a disturbance is still moving something.
        """
        for cause in self._causes:
            if (
                not cause.until
                or cause.kind in self._ended
                or busy
                or self._began.get(cause.kind, world.periods + 1) > world.periods
            ):
                continue
            now = {name: _place(world, name) for name in cause.until}
            start = self._starts.setdefault(cause.kind, now)
            if any(_moved(name, start[name], now[name]) for name in cause.until):
                self._ended[cause.kind] = world.periods

    def spans(self, since: int, period: int) -> List[CauseSpan]:
        """All causes of the trial.

        :param since: the control period at which the trial began.
        :param period: that at which it ended.
        """

        def second(moments: Dict[str, int], kind: str) -> Optional[float]:
            moment = moments.get(kind)
            if moment is None or moment > period:
                return None
            return round(max(0, moment - since) * PERIOD, 2)

        return [
            CauseSpan(
                each.kind,
                each.text,
                each.lasting,
                second(self._began, each.kind),
                second(self._ended, each.kind),
            )
            for each in self._causes
        ]


def _place(world: LoggedWorld, name: str) -> Start:
    if name.startswith(ARM_PREFIX):
        return world.joints()[name[len(ARM_PREFIX) :]]
    if name == LOCALISATION:
        return world.map_error[:3, 3]
    return world.body_pose(name)[:3, 3]


def _moved(name: str, start: Start, now: Start) -> bool:
    far = ARM_MOVED if name.startswith(ARM_PREFIX) else MOVED
    return bool(np.linalg.norm(np.subtract(now, start)) > far)
