"""Simulated time, which only goes forward."""
from typing import Callable

MIN_STEP_NS = 1_000_000  # between two stamps that were asked for


class SimClock:
    """Counts simulated time and tells it at even intervals.

    Not for several threads: the world's own thread keeps it.

    :param tell: gets the time (ns) each time it is to be told.
    :param period_s: simulated s between two times told, while it goes on in smaller steps.
    """

    def __init__(self, tell: Callable[[int], None], period_s: float = 0.05) -> None:
        self._tell = tell
        self._period_ns = int(period_s * 1e9)
        self._told_ns = 0
        self._stamped_ns = 0
        # ROS takes a time of 0 for none
        self.now_ns = int(1e9)

    def advance(self, seconds: float) -> None:
        """Go on, and tell it where it is time to."""
        self.now_ns += int(round(seconds * 1e9))
        if self.now_ns - self._told_ns >= self._period_ns:
            self.tell()

    def skip(self, seconds: float) -> None:
        """Go on at once, and tell it, be it that no time has passed: nodes that came late hear of it."""
        self.now_ns += int(round(seconds * 1e9))
        self.tell()

    def tell(self) -> None:
        """Tell the time now."""
        self._told_ns = self.now_ns
        self._tell(self.now_ns)

    def stamp(self) -> int:
        """A time (ns) that no stamp has had, told to all."""
        self.now_ns = max(self.now_ns, self._stamped_ns + MIN_STEP_NS)
        self._stamped_ns = self.now_ns
        self.tell()
        return self.now_ns
