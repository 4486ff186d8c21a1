"""The preconditions of the choices of open questions, as the robots publish them now."""

import math
import threading
import time
from collections import OrderedDict
from typing import Callable, Iterable, List, Tuple

from smach_oracle.msg import PreconditionCheck, PreconditionChecks

from ...followed_server import ListedQuestion
from ...robot_topics import RobotTopics
from ..shapes.basics import ByState
from ..shapes.questions import PreconditionStatusView
from ..web.sections import PageSections

SECTION = 'preconditions'
MOST_QUESTIONS = 64
LONGEST_TEXT = 400
StatusByState = ByState[List[PreconditionStatusView]]
_HOLDS = {PreconditionCheck.HOLDS: True, PreconditionCheck.DOES_NOT_HOLD: False}


class PreconditionStatuses:
    """Follows `<robot>/oracle/preconditions` of robots that ask.

    It holds the newest by question.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._topics = RobotTopics(
            '/oracle/preconditions', PreconditionChecks, self.taker, queue_size=5
        )
        self._newest: 'OrderedDict[Tuple[str, str], StatusByState]' = OrderedDict()

    def write_sections(self, sections: PageSections, questions: Iterable[ListedQuestion]) -> None:
        """Bring the section up to date. New robots are listened to from now on."""
        questions = list(questions)
        self._topics.follow([listed.goal.robot for listed in questions])
        with self._lock:
            found = {
                listed.key: self._newest.get((listed.goal.robot, listed.goal.query_id))
                for listed in questions
            }
        sections.put(SECTION, {key: states for key, states in found.items() if states is not None})

    def taker(self, robot: str) -> Callable[[PreconditionChecks], None]:
        """Return the callback for a robot's messages."""

        def take(message: PreconditionChecks) -> None:
            view = status_view(message, time.time())
            with self._lock:
                self._newest[(robot, message.query_id)] = view
                self._newest.move_to_end((robot, message.query_id))
                while len(self._newest) > MOST_QUESTIONS:
                    self._newest.popitem(last=False)

        return take


def status_view(message: PreconditionChecks, now: float) -> StatusByState:
    """Return the status of each precondition, by state.

    Its name, whether it holds (None: unknown), why, and when that was checked, in s since the
    epoch.
    """
    found: StatusByState = {}
    for check in message.checks:
        checked = round(now - check.age, 1) if 0 <= check.age < math.inf else None
        found.setdefault(check.state, []).append(
            {
                'name': check.name,
                'holds': _HOLDS.get(check.result),
                'text': check.text[:LONGEST_TEXT],
                'checked': checked,
            }
        )
    return found
