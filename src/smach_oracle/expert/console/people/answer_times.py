"""The times that people took for questions, from the events of the robots. Pure.

All three times are differences of one robot's clock, in s.
"""

import math
from collections import OrderedDict
from typing import Dict, NamedTuple, Optional

from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.short_text import shortened

MOST_OPEN = 500  # questions that are followed
_MOST_CLAIMS = 20  # of one question
_LONGEST = 100


class AnsweredQuestion(NamedTuple):
    """A question that a person has answered.

    `claim_s`: from the question to that person's first claim, None without one. `answer_s`: from
    the question to the answer. `resume_s`: from the answer to the next state that runs, None where
    the trial ended first.
    """

    at: float  # s since the epoch, of the answer
    who: str
    claim_s: Optional[float]
    answer_s: float
    resume_s: Optional[float]


class _FollowedQuestion:
    """A question that is open, or answered while the robot does not go on yet."""

    def __init__(self, asked: float) -> None:
        self.asked = asked
        self.claims: Dict[str, float] = {}  # by person
        self.answered: Optional[AnsweredQuestion] = None


class AnswerTimes:
    """Follows the questions of all trials."""

    def __init__(self) -> None:
        self._open: 'OrderedDict[str, OrderedDict[str, _FollowedQuestion]]' = OrderedDict()

    def add(self, event: Event) -> Optional[AnsweredQuestion]:
        """Take in one event. Return a question whose times are known by now, None else."""
        trial = event.trial_id
        if event.kind == EventKind.QUERY_OPENED:
            asked = self._open.setdefault(trial, OrderedDict())
            self._open.move_to_end(trial)
            asked.setdefault(event.query_id, _FollowedQuestion(event.wall_time))
            self._forget()
            return None
        known = self._open.get(trial)
        question = known.get(event.query_id) if known else None
        if event.kind == EventKind.QUERY_CLAIMED and question is not None:
            if len(question.claims) < _MOST_CLAIMS:
                question.claims.setdefault(event.by, event.wall_time)
        elif event.kind == EventKind.QUERY_ANSWERED and question is not None:
            _answer(question, event)
        elif event.kind in (EventKind.QUERY_EXPIRED, EventKind.QUERY_CANCELLED):
            self._drop(trial, event.query_id)
        elif event.kind in (EventKind.STATE_START, EventKind.TRIAL_END) and trial in self._open:
            return self._went_on(event)
        return None

    def _went_on(self, event: Event) -> Optional[AnsweredQuestion]:
        """Return the oldest answered question of the trial, which has gone on."""
        for query, question in self._open[event.trial_id].items():
            if question.answered is not None:
                self._drop(event.trial_id, query)
                ended = event.kind == EventKind.TRIAL_END
                resume_s = None if ended else _span(question.answered.at, event.wall_time)
                return question.answered._replace(resume_s=resume_s)
        if event.kind == EventKind.TRIAL_END:
            del self._open[event.trial_id]
        return None

    def _drop(self, trial: str, query: str) -> None:
        asked = self._open.get(trial, OrderedDict())
        asked.pop(query, None)
        if not asked:
            self._open.pop(trial, None)

    def _forget(self) -> None:
        while sum(map(len, self._open.values())) > MOST_OPEN:
            oldest = next(iter(self._open))
            self._open[oldest].popitem(last=False)
            if not self._open[oldest]:
                del self._open[oldest]


def _answer(question: _FollowedQuestion, event: Event) -> None:
    claimed = question.claims.get(event.by)
    question.answered = AnsweredQuestion(
        event.wall_time,
        shortened(event.by, _LONGEST),
        None if claimed is None else _span(question.asked, claimed),
        _span(question.asked, event.wall_time),
        None,
    )


def _span(begin: float, end: float) -> float:
    span = end - begin
    return round(span, 1) if math.isfinite(span) and span > 0 else 0.0
