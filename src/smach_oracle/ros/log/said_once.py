"""A warning that the same cause would repeat at each visit, trial or publication is said once.

A text may have what differs each time, such as the details of an error. So only so many texts are
kept. Once there are more, each may be said again.
"""

from typing import Any, Callable, Set, Tuple

import rospy

MOST = 1000  # texts that are kept


class SaidOnce:
    """Hands a text to a log, the first time. Safe to use from several threads."""

    def __init__(self, log: Callable[[str], None]) -> None:
        self._log = log
        self._said: Set[Tuple[Any, ...]] = set()

    def __call__(self, text: str, *about: object) -> None:
        """Log a text. `about`: what else is the same each time, where the text is not."""
        cause = about or (text,)
        if cause not in self._said:
            if len(self._said) >= MOST:
                self._said.clear()
            self._said.add(cause)
            self._log(text)


# for what a process has, not one of its machines
warn_once = SaidOnce(lambda text: rospy.logwarn('%s', text))
