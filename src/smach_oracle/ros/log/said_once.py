"""A warning that the same cause would repeat at each visit, trial or publication is said once."""
from typing import Any, Callable, Set, Tuple

import rospy


class SaidOnce:
    """Hands a text to a log, the first time."""

    def __init__(self, log: Callable[[str], None]) -> None:
        self._log = log
        self._said: Set[Tuple[Any, ...]] = set()

    def __call__(self, text: str, *about: object) -> None:
        """Log a text. `about`: what else is the same each time, where the text is not."""
        cause = about or (text,)
        if cause not in self._said:
            self._said.add(cause)
            self._log(text)


# for what a process has, not one of its machines
warn_once = SaidOnce(lambda text: rospy.logwarn('%s', text))
