"""A dead-man's switch with a watchdog: who drives, and whether they still do.

Pure. Times are monotonic, in s.
"""

import math

# silence that counts as letting go, where the handle was taken from a hand that pressed it
_LET_GO_S = 0.3


class DeadManSwitch:
    """Held by one operator at a time, by commands that keep coming."""

    def __init__(self, watchdog_s: float, lease_s: float = 0.0) -> None:
        """
        :param watchdog_s: it is held for so long after each command.
        :param lease_s: others may take it after so long where that is sooner. The holder goes on
            where nobody has.
        """
        self._watchdog_s = watchdog_s
        self._lease_s = lease_s or watchdog_s
        self._until_s = self._leased_until_s = -math.inf
        self._operator = ''
        self._dropped = ''  # who pressed it when it was dropped, and has not let go since
        self._silent_until_s = -math.inf

    def holder(self, now_s: float) -> str:
        """Return who holds it, '' for nobody."""
        return self._operator if now_s < self._until_s else ''

    def lapsed(self, now_s: float) -> bool:
        """Whether nobody has been heard for so long that anybody may take it."""
        return now_s >= self._leased_until_s

    def press(self, operator: str, now_s: float) -> str:
        """Hold it, or keep holding it. Return why not, or ''."""
        holder = self.holder(now_s)
        if holder and holder != operator and not self.lapsed(now_s):
            return '{} drives; one at a time'.format(holder)
        if operator == self._dropped and now_s < self._silent_until_s:
            self._silent_until_s = now_s + _LET_GO_S
            return (
                'let go of the dead-man first: it was pressed before this goal began, or '
                'somebody has stopped the hand'
            )
        self._operator, self._until_s = operator, now_s + self._watchdog_s
        self._leased_until_s = now_s + self._lease_s
        return ''

    def release(self, operator: str) -> None:
        """The operator has let go. Others keep hold."""
        self.refuse(operator)
        if operator == self._dropped:
            self._dropped = ''

    def refuse(self, operator: str) -> None:
        """End the operator's hold until the next press, because their command is impossible."""
        if operator == self._operator:
            self._until_s = -math.inf

    def press_for_nothing(self, operator: str, now_s: float) -> None:
        """Pressed while there is nothing to hold it for. The next goal is not held by it either."""
        self.refuse(operator)
        if math.isfinite(self._watchdog_s):  # without one, silence means nothing
            self._dropped, self._silent_until_s = operator, now_s + _LET_GO_S

    def drop(self, now_s: float) -> None:
        """End the hold: what it was for has ended, or somebody else stops it."""
        holder = self.holder(now_s)
        if holder:
            self.press_for_nothing(holder, now_s)
