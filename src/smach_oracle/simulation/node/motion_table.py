"""The motions under way: at most one for each part of the robot."""

from typing import Callable, Dict, List, NamedTuple, Optional

from ..physics.trajectory import Motion, MotionResult
from ..physics.world import World

PARTS = ('base', 'head', 'left_arm', 'left_gripper', 'right_arm', 'right_gripper', 'torso')


class MotionEnd(NamedTuple):
    """The end of a motion: its result, or None where it was stopped."""

    result: Optional[MotionResult]
    text: str = ''  # why it was stopped, or failed
    aborted: bool = False  # stopped by the world, not by who commanded it or by a newer command


class _Running(NamedTuple):
    motion: Motion
    ended: Callable[[MotionEnd], object]
    # done, but what its end set off in the world has not come to rest yet
    result: Optional[MotionResult] = None


class MotionTable:
    """Advances the motions of all parts together, in the order of the parts' names."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._running: Dict[str, _Running] = {}

    def __bool__(self) -> bool:
        return bool(self._running)

    def motion(self, part: str) -> Optional[Motion]:
        """Return the motion of this part, or None."""
        running = self._running.get(part)
        return running.motion if running else None

    def start(
        self, part: str, motion: Motion, ended: Callable[[MotionEnd], object], newer: str = ''
    ) -> None:
        """Begin a motion. An older one of the same part ends with the text `newer`.

        :param ended: called once, when it has ended.
        """
        self.stop(part, newer)
        self._running[part] = _Running(motion, ended)

    def stop(self, part: str, text: str, aborted: bool = False) -> None:
        """End the motion of a part, if there is one, where it is."""
        running = self._running.pop(part, None)
        if running is None:
            return
        if running.result is not None:
            running.ended(MotionEnd(running.result, running.result.text))
            return
        running.motion.stop(self._world)
        running.ended(MotionEnd(None, text, aborted))

    def stop_all(self, text: str) -> None:
        """End every motion where it is, as the world's own doing."""
        for part in sorted(self._running):
            self.stop(part, text, aborted=True)

    def tick(self) -> bool:
        """Advance or end every motion. Then let a control period pass, unless all have ended.

        :returns: whether it passed.
        """
        for part in sorted(self._running):
            running = self._running[part]
            if running.result is None:
                result = running.motion.tick(self._world)
                if result is not None:
                    self._world.happened(*running.motion.events())
                    self._running[part] = running._replace(result=result)
        over: List[str] = []
        if not self._world.disturbed:
            over = [
                part
                for part, running in sorted(self._running.items())
                if running.result is not None
            ]
        ended = [self._running.pop(part) for part in over]
        passes = bool(self._running) or not over
        if passes:
            self._world.step()
        for running in ended:
            running.ended(MotionEnd(running.result, running.result.text if running.result else ''))
        return passes
