"""The open questions of all robots as one section."""

import time
from collections import OrderedDict
from typing import Dict, List, NamedTuple, Optional

from ...followed_server import ListedQuestion
from ...front_end import FrontEnd
from ..shapes.questions import QueryServerView, QuestionView
from ..trials.trial_log import TrialLog
from ..web.sections import PageSections
from .question_view import question_view
from .session_claims import SessionClaims

# each list has ages of its own. Smaller differences come from the link, not from the question
_JITTER_S = 1.0
MOST_REMEMBERED = 1000


class _QuestionTimes(NamedTuple):
    """The times of a question as written last, s since the epoch."""

    asked: float
    deadline: Optional[float]


def _same(before: Optional[float], now: Optional[float]) -> bool:
    return before is not None and now is not None and abs(before - now) < _JITTER_S


class QuestionSections:
    """Draws the queue. One thread calls it."""

    def __init__(
        self,
        front_end: FrontEnd,
        log: TrialLog,
        sessions: Optional[SessionClaims] = None,
    ) -> None:
        """`sessions`: the browsers that hold questions, None where there are none."""
        self._sessions = sessions or SessionClaims()
        self._front_end = front_end
        self._log = log
        self._epoch_s = time.time() - time.monotonic()
        self._times: Dict[str, _QuestionTimes] = {}
        self._first_asked: 'OrderedDict[str, float]' = OrderedDict()  # by key, open or not

    def write_sections(self, sections: PageSections) -> None:
        """Bring the section up to date."""
        listed = self._front_end.questions()
        views = sorted(
            (self._view(each) for each in listed), key=lambda view: (view['asked'], view['key'])
        )
        self._times = {
            view['key']: _QuestionTimes(view['asked'], view['deadline']) for view in views
        }
        # first: where a question goes with its server, that is told of it
        sections.put('servers', self._servers())
        sections.put('questions', views)

    def _servers(self) -> List[QueryServerView]:
        return [
            {'name': name, 'connected': self._front_end.connected(name)}
            for name in self._front_end.servers
        ]

    def _view(self, listed: ListedQuestion) -> QuestionView:
        place = (listed.goal.robot, listed.goal.container_path, listed.goal.failed_state)
        view = question_view(
            listed,
            self._epoch_s,
            lambda target: self._log.recovery_counts(place, target),
            self._log.rule(listed.goal.trial_id),
            self._log.way_above(listed.goal.trial_id, listed.goal.container_path),
        )
        before = self._times.get(listed.key)
        if before is not None:
            if _same(before.asked, view['asked']):
                view['asked'] = before.asked
            if _same(before.deadline, view['deadline']):
                view['deadline'] = before.deadline
        view['session'] = self._sessions.session_of(listed)
        view['idle'] = self._sessions.idle_periods(listed)
        view['asked'] = self._since(listed.key, view['asked'])
        return view

    def _since(self, key: str, asked: float) -> float:
        """Return when it was asked first.

        While an interface runs for it, its server counts again.
        """
        since = self._first_asked[key] = min(asked, self._first_asked.get(key, asked))
        self._first_asked.move_to_end(key)
        while len(self._first_asked) > MOST_REMEMBERED:
            self._first_asked.popitem(last=False)
        return since
