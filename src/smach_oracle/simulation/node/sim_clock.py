"""Simulated time, which only goes forward."""

from typing import Any, Callable, Dict, List, Tuple

MIN_STEP_NS = 1_000_000  # between two stamps that were asked for
TOUCHING_NS = 10_000_000  # two pauses that are nearer have no step of the world between them


class SimClock:
    """Counts simulated time and publishes it at even intervals.

    Not for several threads: the world's own thread keeps it.

    :param publish: gets the time (ns) each time it is to be published, and how much of it is the
        world's: without the pauses.
    :param period_s: simulated s from one time published to the next, while it goes on in smaller
        steps.
    """

    def __init__(self, publish: Callable[[int, int], None], period_s: float = 0.05) -> None:
        self._publish = publish
        self._period_ns = int(period_s * 1e9)
        self._published_ns = 0
        self._stamped_ns = 0
        self._paused_ns = 0  # in all
        # ROS takes a time of 0 for none
        self.now_ns = int(1e9)
        self._trial_ns = self.now_ns  # at which the trial began
        self._pauses: List[Tuple[int, int]] = []  # of the trial: begin, length

    def advance(self, seconds: float, moved: bool = True) -> None:
        """Go on, and publish the time where that is due.

        :param moved: whether the world went on, too.
        """
        if not moved:
            self._note_pause(seconds)
        self.now_ns += int(round(seconds * 1e9))
        if self.now_ns - self._published_ns >= self._period_ns:
            self.publish()

    def skip(self, seconds: float) -> None:
        """Go on at once and publish the time, even where none has passed.

        Nodes that came late learn the time from it.
        """
        self.now_ns += int(round(seconds * 1e9))
        self.publish()

    def pause(self, seconds: float) -> None:
        """Go on at once while the world stands still, and publish the time."""
        self._note_pause(seconds)
        self.skip(seconds)

    def _note_pause(self, seconds: float) -> None:
        begin, length = self.now_ns, int(round(seconds * 1e9))
        self._paused_ns += length
        if self._pauses and begin - sum(self._pauses[-1]) <= TOUCHING_NS:
            first = self._pauses.pop()[0]
            begin, length = first, begin + length - first
        if length:
            self._pauses.append((begin, length))

    def begin_trial(self) -> None:
        """Take the time now for that at which a trial begins."""
        self._trial_ns, self._pauses = self.now_ns, []

    def trial_record(self) -> Dict[str, Any]:
        """Return the time (s) at which the trial began, and its pauses, as plain data.

        A pause is a time in which the world stood still, as [begin, length], s. So a time of this
        clock can be told in the world's time.
        """
        return {
            'clock_s': round(self._trial_ns / 1e9, 3),
            'pauses': [
                [round(begin / 1e9, 3), round(length / 1e9, 3)] for begin, length in self._pauses
            ],
        }

    def publish(self) -> None:
        """Publish the time now."""
        self._published_ns = self.now_ns
        self._publish(self.now_ns, self.now_ns - self._paused_ns)

    def stamp(self) -> int:
        """Publish and return a time (ns) that no stamp has had."""
        self.now_ns = max(self.now_ns, self._stamped_ns + MIN_STEP_NS)
        self._stamped_ns = self.now_ns
        self.publish()
        return self.now_ns
