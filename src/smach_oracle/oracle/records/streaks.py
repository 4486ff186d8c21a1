"""What was done about the failures of a state, one after the other. Pure, and without smach.

A streak belongs to one state in one execution of its container. It lasts from the first failure to
the next success, to a question, or to the end of the execution, unless one of its own ways has
ended that.
"""

from typing import Any, Dict, Iterable, List, Mapping, Optional

from ..decision.ways import StreakSoFar

Told = Mapping[str, List[Any]]  # plain data by label


class OpenStreak:
    """A streak that goes on.

    `successes`: of the state in all. `began_s`: on the trial's clock of work. `visited`: the states
    before the first failure, by name, the latest first. `leaves`: whether the way that is gone now
    leaves the container. `moved`: the way that has come before its turn in the menu's own
    order, '' for none.
    """

    def __init__(self, successes: int, began_s: float, visited: Iterable[str]) -> None:
        self.successes = successes
        self.began_s = began_s
        self.visited = tuple(visited)
        self.tried: List[str] = []
        self.attempts = 0
        self.leaves = False
        self.moved = ''

    def note(self, way: str, moved: bool = False) -> None:
        """Note that a way was gone. `moved`: before its turn in the menu's own order."""
        self.tried.append(way)
        self.attempts += 1
        self.moved = way if moved else self.moved

    def so_far(self, now_s: float) -> StreakSoFar:
        """Return what was done. `now_s`: on the same clock."""
        minutes = (now_s - self.began_s) / 60.0
        return StreakSoFar(tuple(self.tried), self.attempts, minutes, self.moved)


class Streaks:
    """The streaks of the states of one container."""

    def __init__(self) -> None:
        self._open: Dict[str, OpenStreak] = {}

    def of(self, label: str, successes: int) -> Optional[OpenStreak]:
        """Return that of a state, None where it is over. `successes`: of the state, in all."""
        streak = self._open.get(label)
        return streak if streak is not None and streak.successes == successes else None

    def begin(self, label: str, streak: OpenStreak) -> None:
        """Have this as that of a state."""
        self._open[label] = streak

    def end(self, label: str) -> None:
        """End that of a state."""
        self._open.pop(label, None)

    def end_execution(self) -> None:
        """End all, but where a way has ended the execution."""
        if self._open:
            self._open = {label: each for label, each in self._open.items() if each.leaves}

    def begin_trial(self) -> None:
        """Forget everything."""
        self._open = {}

    def told(self) -> Told:
        """Return them as plain data, for `take_over`."""
        return {
            label: [
                each.successes,
                each.began_s,
                list(each.visited),
                each.tried,
                each.attempts,
                each.moved,
            ]
            for label, each in self._open.items()
        }

    def take_over(self, told: Told) -> None:
        """Go on from those of an execution that was stopped.

        :raises ValueError: where they cannot be read.
        """
        taken = {}
        try:
            # earlier versions did not move ways
            for label, (successes, began_s, visited, tried, attempts, *moved) in told.items():
                streak = OpenStreak(int(successes), float(began_s), map(str, visited))
                streak.tried, streak.attempts = list(map(str, tried)), int(attempts)
                streak.moved = str(moved[0]) if moved else ''
                taken[label] = streak
        except (AttributeError, TypeError, ValueError) as err:
            raise ValueError('cannot be read as streaks: {}'.format(err)) from err
        self._open = taken
