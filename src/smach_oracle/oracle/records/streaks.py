"""What was done about the failures of a state, one after the other. Pure, and without smach.

A streak belongs to one state in one execution of its container. It lasts from the first failure to
the next success, to a question, or to the end of the execution, unless one of its own ways has
ended that.
"""

from dataclasses import dataclass, field
from typing import Any, Dict, List, Mapping, Optional, Tuple

from ..decision.ways import StreakSoFar

Told = Mapping[str, List[Any]]  # plain data by label


@dataclass
class OpenStreak:
    """A streak that goes on.

    `successes`: of the state in all. `began_s`: on the trial's clock of work. `visited`: the states
    before the first failure, by name, the latest first. `leaves`: whether the way that is gone now
    leaves the container. `moved`: the way that has come before its turn in the menu's own
    order, '' for none.
    """

    successes: int
    began_s: float
    visited: Tuple[str, ...]
    tried: List[str] = field(default_factory=list)
    attempts: int = 0
    moved: str = ''
    leaves: bool = False

    def note(self, way: str, moved: bool = False) -> None:
        """Note that a way was gone. `moved`: before its turn in the menu's own order."""
        self.tried.append(way)
        self.attempts += 1
        self.moved = way if moved else self.moved

    def so_far(self, now_s: float) -> StreakSoFar:
        """Return what was done. `now_s`: on the same clock."""
        minutes = (now_s - self.began_s) / 60.0
        return StreakSoFar(tuple(self.tried), self.attempts, minutes, self.moved)


class Streaks(Dict[str, OpenStreak]):
    """The streaks of the states of one container."""

    def of(self, label: str, successes: int) -> Optional[OpenStreak]:
        """Return that of a state, None where it is over. `successes`: of the state, in all."""
        streak = self.get(label)
        return streak if streak is not None and streak.successes == successes else None

    def end_execution(self) -> None:
        """End all, but where a way has ended the execution."""
        if self:
            for label in [label for label, each in self.items() if not each.leaves]:
                del self[label]

    def told(self) -> Told:
        """Return them as plain data, for `take_over`."""
        names = ('successes', 'began_s', 'visited', 'tried', 'attempts', 'moved')
        return {label: [getattr(each, name) for name in names] for label, each in self.items()}

    def take_over(self, told: Told) -> None:
        """Go on from those of an execution that was stopped.

        :raises ValueError: where they cannot be read.
        """
        taken = {}
        try:
            # earlier versions did not move ways
            for label, (successes, began_s, visited, tried, attempts, *moved) in told.items():
                taken[label] = OpenStreak(
                    int(successes),
                    float(began_s),
                    tuple(map(str, visited)),
                    list(map(str, tried)),
                    int(attempts),
                    str(moved[0]) if moved else '',
                )
        except (AttributeError, TypeError, ValueError) as err:
            raise ValueError('cannot be read as streaks: {}'.format(err)) from err
        self.clear()
        self.update(taken)
