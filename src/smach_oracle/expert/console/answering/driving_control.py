"""Who of the console's pages drives a hand, and whether what a page sends is fresh. Pure; times are monotonic, in s."""
import math
from typing import Any, Dict, NamedTuple, Optional, Sequence, Tuple

from .audit import Person

LATE_S = 0.06  # later than the quickest message of this page: it has waited somewhere on its way
SILENT_S = 3.0  # a page that holds the wheel says so several times a second
_DRIFT = 1e-3  # s/s by which two clocks may run apart, and more

Vector = Tuple[float, float, float]


class Freshness:
    """Tells messages that come at once from those that a slow link has held back.

    The clocks of page and server have nothing in common; the least difference seen stands for a message without delay.
    """

    def __init__(self) -> None:
        self._least_s = math.inf
        self._seen_s = 0.0

    def fresh(self, sent_s: float, now_s: float) -> bool:
        """Whether a message that its page has sent at `sent_s`, by its own clock, is fresh."""
        offset_s = now_s - sent_s
        drifted_s = self._least_s + _DRIFT * (now_s - self._seen_s)
        self._least_s, self._seen_s = min(offset_s, drifted_s), now_s
        return offset_s - self._least_s <= LATE_S


class Drive(NamedTuple):
    """One session at the wheel."""

    key: str  # of the question
    browser: int
    person: Person
    listed: Any  # the question
    begun_s: float


class Wheel:
    """Of one hand; held by one page at a time."""

    def __init__(self) -> None:
        self.drive: Optional[Drive] = None
        self._freshness = Freshness()
        self._heard_s = -math.inf
        self._counts: Dict[str, int] = {}
        self.held = False

    def take(self, drive: Drive, now_s: float) -> str:
        """Take it; why not, or ''. A page that has fallen silent has lost it."""
        if self.drive is not None and self.drive.browser != drive.browser and not self.silent(now_s):
            return '{} drives; one at a time'.format(self.drive.person.expert)
        self.drive, self._heard_s, self.held = drive, now_s, False
        self._freshness, self._counts = Freshness(), {'relayed': 0, 'late': 0}
        return ''

    def silent(self, now_s: float) -> bool:
        """Whether nothing has come from the page that has it."""
        return now_s - self._heard_s > SILENT_S

    def hear(self, sent_s: float, held: bool, now_s: float) -> bool:
        """A command of its page; whether it is to be carried out as one that is held."""
        self._heard_s = now_s
        fresh = self._freshness.fresh(sent_s, now_s)
        if held:
            self._counts['relayed' if fresh else 'late'] += 1
        self.held = held and fresh
        return self.held

    def leave(self, now_s: float) -> Dict[str, Any]:
        """Nobody has it; what is to be told of the session."""
        told: Dict[str, Any] = dict(self._counts)
        if self.drive is not None:
            told['seconds'] = round(now_s - self.drive.begun_s, 1)
        self.drive, self.held = None, False
        return told


def along(frame: str, vector: Sequence[float], most: float) -> Vector:
    """Shares of `most` forward, left and up, along the axes of a frame: those of a camera are right, down, forward."""
    forward, left, up = (most * each for each in vector)
    return (-left, -up, forward) if frame == 'camera' else (forward, left, up)
