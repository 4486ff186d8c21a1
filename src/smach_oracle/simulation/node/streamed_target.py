"""Joint targets that come in a stream, as from a person who drives an arm."""

from typing import Dict, Optional, Sequence

from ..physics.pr2_body import PERIOD
from ..physics.trajectory import MotionResult
from ..physics.world import World

FAST = 1.1  # times its limit that a joint may go at most


class StreamedTarget:
    """Goes straight to one target in a given time and holds it. No joint goes too fast.

    :param targets: rad, by joint.
    :param seconds: rounded to control periods, at least one.
    """

    def __init__(self, targets: Dict[str, float], seconds: float) -> None:
        self._targets = targets
        self._periods = max(1, round(seconds / PERIOD))
        self._left = self._periods
        self._here: Dict[str, float] = {}

    def tick(self, world: World) -> Optional[MotionResult]:
        """See Motion."""
        if not self._here:
            self._begin(world)
        if not self._left:
            return MotionResult(True)
        for name, target in self._targets.items():
            step = (target - self._here[name]) / self._left
            self._here[name] += step
            world.set_target(name, self._here[name], step / PERIOD)
        self._left -= 1
        return None

    def _begin(self, world: World) -> None:
        for name, target in self._targets.items():
            here = world.robot.target(name)
            most = FAST * world.robot.speeds[name] * self._periods * PERIOD
            self._here[name] = here
            self._targets[name] = here + min(max(target - here, -most), most)

    def events(self) -> Sequence[str]:
        """See Motion: a stream is no event."""
        return ()

    def stop(self, world: World) -> None:
        """See Motion."""
        for name in self._targets:
            world.set_target(name, world.robot.position(name))
