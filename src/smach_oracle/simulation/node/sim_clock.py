"""Simulated time, which only goes forward."""
from typing import Callable

MIN_STEP_NS = 1_000_000  # between two stamps that were asked for


class SimClock:
    """Counts simulated time and publishes it at even intervals.

    Not for several threads: the world's own thread keeps it.

    :param publish: gets the time (ns) each time it is to be published.
    :param period_s: simulated s from one time published to the next, while it goes on in smaller
        steps.
    """

    def __init__(self, publish: Callable[[int], None], period_s: float = 0.05) -> None:
        self._publish = publish
        self._period_ns = int(period_s * 1e9)
        self._published_ns = 0
        self._stamped_ns = 0
        # ROS takes a time of 0 for none
        self.now_ns = int(1e9)

    def advance(self, seconds: float) -> None:
        """Go on, and publish the time where that is due."""
        self.now_ns += int(round(seconds * 1e9))
        if self.now_ns - self._published_ns >= self._period_ns:
            self.publish()

    def skip(self, seconds: float) -> None:
        """Go on at once and publish the time, even where none has passed.

        Nodes that came late learn the time from it.
        """
        self.now_ns += int(round(seconds * 1e9))
        self.publish()

    def publish(self) -> None:
        """Publish the time now."""
        self._published_ns = self.now_ns
        self._publish(self.now_ns)

    def stamp(self) -> int:
        """Publish and return a time (ns) that no stamp has had."""
        self.now_ns = max(self.now_ns, self._stamped_ns + MIN_STEP_NS)
        self._stamped_ns = self.now_ns
        self.publish()
        return self.now_ns
