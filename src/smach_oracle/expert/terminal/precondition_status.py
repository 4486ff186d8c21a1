"""The precondition status of a question's choices, as its robot publishes it, in words."""

import time
from typing import List, Optional, Tuple

from smach_oracle.msg import PreconditionCheck, PreconditionChecks

from ..robot_topics import RobotTopic
from ..wording import clean
from .text import duration

_WORDS = {
    PreconditionCheck.HOLDS: ('✓', 'holds', 'green'),
    PreconditionCheck.DOES_NOT_HOLD: ('✗', 'does not hold', 'bold red'),
}
_UNKNOWN = ('?', 'unknown', 'yellow')
Line = Tuple[str, str]  # text, style


class PreconditionStatusListener:
    """Listens for as long as the question is shown: the robot checks while somebody listens."""

    def __init__(self, robot: str, query_id: str) -> None:
        """`robot`: the node's name. It publishes <robot>/oracle/preconditions."""
        self._query_id = query_id
        self._newest: Optional[PreconditionChecks] = None
        self._heard_s = 0.0
        self._listener = RobotTopic(robot, '/oracle/preconditions', PreconditionChecks, self.take)

    def take(self, message: PreconditionChecks) -> None:
        """Note that the robot has checked them."""
        if message.query_id == self._query_id:
            self._heard_s, self._newest = time.monotonic(), message

    def lines(self) -> List[Line]:
        """Return one line for each precondition.

        The list is empty where the robot publishes nothing, or there are no preconditions.

        None means that the robot publishes nothing, or that there are no preconditions.
        """
        newest, since_s = self._newest, time.monotonic() - self._heard_s
        return [_line(check, since_s) for check in newest.checks] if newest is not None else []

    def stop(self) -> None:
        """Listen no longer."""
        self._listener.stop()


def _line(check: PreconditionCheck, since_s: float) -> Line:
    sign, word, style = _WORDS.get(check.result, _UNKNOWN)
    age = ' ({} ago)'.format(duration(check.age + since_s)) if check.age >= 0 else ''
    why = ': ' + clean(check.text) if check.text and check.result != PreconditionCheck.HOLDS else ''
    return '  {} {} of {} {}{}{}'.format(
        sign, clean(check.name), clean(check.state), word, age, why
    ), style
