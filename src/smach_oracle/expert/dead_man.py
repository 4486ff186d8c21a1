"""Who drives, and whether they still do: a dead-man's handle with a watchdog. Pure; times are monotonic, in s."""
import math


class DeadMan:
    """Held by one operator at a time, by commands that keep coming."""

    def __init__(self, watchdog_s: float) -> None:
        """Held for `watchdog_s` after each command."""
        self._watchdog_s = watchdog_s
        self._until_s = -math.inf
        self._operator = ''

    def holder(self, now_s: float) -> str:
        """Who holds it, '' for nobody."""
        return self._operator if now_s < self._until_s else ''

    def press(self, operator: str, now_s: float) -> str:
        """Hold it, or keep holding it; why not, or ''."""
        holder = self.holder(now_s)
        if holder and holder != operator:
            return '{} drives; one at a time'.format(holder)
        self._operator, self._until_s = operator, now_s + self._watchdog_s
        return ''

    def release(self, operator: str) -> None:
        """Let go; what others hold they keep."""
        if operator == self._operator:
            self._until_s = -math.inf

    def drop(self) -> None:
        """Let go whoever holds it."""
        self._until_s = -math.inf
