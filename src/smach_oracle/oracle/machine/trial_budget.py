"""Counts what is left of a trial's budget, for all containers of a tree."""

import contextlib
import threading
from collections import deque
from statistics import median
from typing import Deque, Iterator, List, Optional, Sequence, Set, Tuple

from ..scope.clock import Clock, PausableClock
from ..settings.checks import Budget

_LEAST_S = 0.001  # 0 s would be without end
_TRIALS = 20  # of which the median is taken


class TrialBudget:
    """Counts what a trial has spent. Safe to use from several threads.

    Each answer is '' where there is something left, else a clause that says what is spent. `time`
    is what has passed of the minutes.
    """

    def __init__(self, clock: Clock) -> None:
        self._lock = threading.Lock()
        self.time = PausableClock(clock)
        # without the time in which a person is asked, and in which the robot is not well
        self.work_time = PausableClock(clock)
        self._usual_s: Deque[float] = deque(maxlen=_TRIALS)  # of earlier trials
        self.begin(Budget())

    def begin(self, limits: Budget) -> None:
        """Begin a trial: nothing is spent, and its minutes begin now."""
        with self._lock:
            self._limits = limits
            self._recoveries = self._questions = 0
            self._takers: Set[object] = set()  # each has one recovery set aside
            self.time.begin()
            self.work_time.begin()

    def count_work_by(self, clock: Clock) -> None:
        """Have the time of work go by another clock, from the next trial on."""
        self.work_time = PausableClock(clock)

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """Let all its time stand still."""
        with self.time.paused(), self.work_time.paused():
            yield

    def end(self) -> None:
        """Note how long a trial took that has ended by itself."""
        self._usual_s.append(self.work_time.now())

    @property
    def usual_minutes(self) -> Optional[float]:
        """The median of the latest trials of this program. None means there was none."""
        times = list(self._usual_s)
        return median(times) / 60.0 if times else None

    @property
    def recoveries(self) -> int:
        """The recoveries that are spent or set aside."""
        return self._recoveries

    @property
    def is_spent_from(self) -> bool:
        """Whether a recovery was made, or a question asked."""
        return bool(self._recoveries or self._questions)

    def spent(self) -> List[float]:
        """Return the recoveries, the questions, the seconds spent, and those of work."""
        with self._lock:
            return [
                self._recoveries - len(self._takers),
                self._questions,
                self.time.now(),
                self.work_time.now(),
            ]

    def go_on(self, spent: Optional[Sequence[float]]) -> None:
        """Go on after `begin` with what was spent before. None means nothing."""
        if spent:
            with self._lock:
                self._recoveries, self._questions = int(spent[0]), int(spent[1])
                self.time.begin(self.time.now() + spent[2])
                # a store of an earlier version has no time of work
                self.work_time.begin(spent[3] if len(spent) > 3 else self.time.now())

    def why_over(self) -> str:
        """Say that the minutes are over."""
        minutes = self._limits.minutes
        if minutes is None or self.left_s():
            return ''
        told = '{:g}'.format(minutes)
        return "the trial's {} over".format('1 minute is' if told == '1' else told + ' minutes are')

    def left_s(self) -> Optional[float]:
        """Return how many seconds are left, 0.0 where none are. None means they are not limited."""
        minutes = self._limits.minutes
        if minutes is None:
            return None
        return max(0.0, 60.0 * minutes - self.time.now())

    def within(self, deadline_s: float) -> Tuple[float, bool]:
        """Return a deadline that is not beyond the minutes, and whether they cut it.

        :param deadline_s: s from now. 0 means none.
        """
        left_s = self.left_s()
        if left_s is None or 0 < deadline_s <= left_s:
            return deadline_s, False
        return max(left_s, _LEAST_S), True

    def why_no_recovery(self) -> str:
        """Say that the recoveries are spent."""
        return _spent(self._limits.recoveries, self._recoveries, 'recovery', 'recoveries')

    def take_recovery(self, taker: object, most: Optional[int] = None) -> str:
        """Set a recovery aside, one for each taker, or say that all are spent.

        :param most: of which a policy makes do.
        """
        with self._lock:
            if taker in self._takers:
                return ''
            why_not = self.why_no_recovery()
            if most is not None and self._recoveries >= most:
                why_not = why_not or "the trial's {} attempts are spent".format(most)
            if not why_not:
                self._recoveries += 1
                self._takers.add(taker)
            return why_not

    def settle_recovery(self, taker: object, is_made: bool) -> None:
        """Spend what is set aside for a taker, or have it back, as it was not made.

        One that was left behind may be of an earlier trial. Nothing is set aside for it.
        """
        with self._lock:
            if taker in self._takers:
                self._takers.remove(taker)
                self._recoveries -= not is_made

    def why_no_question(self) -> str:
        """Say that the questions are spent."""
        return _spent(self._limits.questions, self._questions, 'question', 'questions')

    def take_question(self) -> str:
        """Spend one question, or say that all are spent."""
        with self._lock:
            why_not = self.why_no_question()
            self._questions += not why_not
            return why_not


def _spent(limit: Optional[int], used: int, one: str, many: str) -> str:
    if limit is None or used < limit:
        return ''
    if limit == 0:
        return 'this trial is allowed no {}'.format(many)
    return "the trial's {} spent".format(
        '1 {} is'.format(one) if limit == 1 else '{} {} are'.format(limit, many)
    )
