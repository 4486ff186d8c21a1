"""The page that drives a manipulation interface, and the age of its commands. Pure.

Times are monotonic, in s.
"""

import math
from typing import Any, Dict, NamedTuple, Optional, Sequence, Tuple

from ...followed_server import ListedQuestion
from ..web.audit import Person

LATE_S = 0.06  # more delay than the quickest message of this page: the link has held it back
SILENT_S = 3.0  # a page in control sends several commands a second
_DRIFT = 1e-3  # s/s by which two clocks may run apart, and more

Vector = Tuple[float, float, float]


class DelayCheck:
    """Distinguishes messages that arrive at once from those that a slow link has held back.

    The clocks of page and server have nothing in common. The least difference seen stands for a
    message without delay.
    """

    def __init__(self) -> None:
        self._least_s = math.inf
        self._seen_s = 0.0

    def is_in_time(self, sent_s: float, now_s: float) -> bool:
        """Whether a message that its page has sent at `sent_s`, by its own clock, came at once."""
        offset_s = now_s - sent_s
        drifted_s = self._least_s + _DRIFT * (now_s - self._seen_s)
        self._least_s, self._seen_s = min(offset_s, drifted_s), now_s
        return offset_s - self._least_s <= LATE_S


class DrivingSession(NamedTuple):
    """The time for which one page controls an interface."""

    key: str  # of the question
    page: int
    person: Person
    listed: ListedQuestion  # the question
    begun_s: float


class DrivingControl:
    """Control of one interface, held by one page at a time."""

    def __init__(self) -> None:
        self.session: Optional[DrivingSession] = None
        self._delay_check = DelayCheck()
        self._heard_s = -math.inf
        self._counts: Dict[str, int] = {}
        self.held = False

    def take(self, session: DrivingSession, now_s: float) -> str:
        """Take control, and return why not, or ''. A page that has fallen silent has lost it."""
        if (
            self.session is not None
            and self.session.page != session.page
            and not self.silent(now_s)
        ):
            return '{} drives; one at a time'.format(self.session.person.expert)
        self.session, self._heard_s, self.held = session, now_s, False
        self._delay_check, self._counts = DelayCheck(), {'relayed': 0, 'late': 0}
        return ''

    def silent(self, now_s: float) -> bool:
        """Whether the page in control has not sent anything for a while."""
        return now_s - self._heard_s > SILENT_S

    def accept(self, sent_s: float, held: bool, now_s: float) -> bool:
        """Take in a command of the page. Return whether to carry it out as one that is held."""
        self._heard_s = now_s
        in_time = self._delay_check.is_in_time(sent_s, now_s)
        if held:
            self._counts['relayed' if in_time else 'late'] += 1
        self.held = held and in_time
        return self.held

    def leave(self, now_s: float) -> Dict[str, Any]:
        """End the session, and return its summary for the audit."""
        summary: Dict[str, Any] = dict(self._counts)
        if self.session is not None:
            summary['seconds'] = round(now_s - self.session.begun_s, 1)
        self.session, self.held = None, False
        return summary


def along(frame: str, vector: Sequence[float], most: float) -> Vector:
    """Shares of `most` along the axes of a frame.

    :param vector: shares forward, left and up, each from -1 to 1.
    :returns: x, y, z. The axes of a camera are right, down and forward.
    """
    forward, left, up = (most * each for each in vector)
    return (-left, -up, forward) if frame == 'camera' else (forward, left, up)
