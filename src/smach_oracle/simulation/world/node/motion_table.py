"""What moves now: at most one motion for each part of the robot."""
from typing import Any, Callable, Dict, List, NamedTuple, Optional

from smach_oracle.simulation.robot.interface import RobotError

PARTS = ('base', 'head', 'left_arm', 'left_gripper', 'right_arm', 'right_gripper', 'torso')


class Ending(NamedTuple):
    """How a motion ended: with its result, by an error, or because it was stopped (neither)."""

    result: Any = None
    error: Optional[RobotError] = None
    text: str = ''


class _Running(NamedTuple):
    motion: Any
    ended: Callable[[Ending], None]


class MotionTable:
    """Advances the motions of all parts together, in the order of the parts' names.

    A motion has ``tick(world)``, called before each control period, which returns None until it has ended and then its
    result, and may raise RobotError; and ``stop(world)``, which has the part rest where it is.
    """

    def __init__(self, world: Any) -> None:
        self._world = world
        self._running: Dict[str, _Running] = {}

    def __bool__(self) -> bool:
        return bool(self._running)

    def motion(self, part: str) -> Any:
        """What moves this part, or None."""
        running = self._running.get(part)
        return running.motion if running else None

    def start(self, part: str, motion: Any, ended: Callable[[Ending], None], newer: str) -> None:
        """Begin a motion; `ended` is called once. An older one of the same part ends with the text `newer`."""
        self.stop(part, newer)
        self._running[part] = _Running(motion, ended)

    def stop(self, part: str, text: str) -> None:
        """End the motion of a part, if there is one, where it is."""
        running = self._running.pop(part, None)
        if running:
            running.motion.stop(self._world)
            running.ended(Ending(text=text))

    def stop_all(self, text: str) -> None:
        """End every motion where it is."""
        for part in sorted(self._running):
            self.stop(part, text)

    def tick(self) -> None:
        """Have every motion set its targets, the world advance by a control period, and those that are done end."""
        over: List[str] = []
        endings: List[Ending] = []
        for part in sorted(self._running):
            ending = self._advance(part)
            if ending:
                over.append(part)
                endings.append(ending)
        running = [self._running.pop(part) for part in over]
        if self._running or not over:
            self._world.step()
        for each, ending in zip(running, endings):
            each.ended(ending)

    def _advance(self, part: str) -> Optional[Ending]:
        motion = self._running[part].motion
        try:
            result = motion.tick(self._world)
        except RobotError as err:
            motion.stop(self._world)
            return Ending(error=err, text=str(err))
        return None if result is None else Ending(result=result)
