"""What a machine leaves where it is killed, for each of its points, from one process."""

import os
import pathlib
import shutil
import sys
import tempfile

from killed_machines import KilledMachine

IN_MEMORY = '/dev/shm'
ROOM = 1 << 30  # bytes: a tree of everything leaves 30 million at all its points


def _in_memory():
    """A folder in memory, where a copy costs a tenth; None where there is little room, or none."""
    if not os.access(IN_MEMORY, os.W_OK) or shutil.disk_usage(IN_MEMORY).free < ROOM:
        return None
    return IN_MEMORY


class Left:
    """A machine that is stopped at each of its points, and what it would leave if killed there.

    A process that is stopped writes as little as one that was killed: its files are copied
    meanwhile. To kill it at each point takes a process for each.

    :ivar told: what it has told at its end, None where it was killed at the last point.
    """

    def __init__(self, build, begins=None, expert=None, points=None, **settings):
        """`begins`: a folder that another machine has left, with which it goes on.

        `points`: in this order, at which it stops. It is killed at the last one of them.
        """
        self._build, self._settings = build, settings
        self._kept = tempfile.TemporaryDirectory(dir=_in_memory())
        runs = self.folder('runs')
        if begins is None:
            runs.mkdir()
        else:
            shutil.copytree(str(begins), str(runs))
        numbers = iter(points or range(1, sys.maxsize))
        self.told = KilledMachine(runs, build, **settings).run(
            kill_at=points[-1] if points else 0,
            expert=expert,
            stop_at=points[:-1] if points else range(1, sys.maxsize),
            at_stop=lambda: shutil.copytree(str(runs), str(self.folder(next(numbers)))),
        )
        if points:
            runs.rename(str(self.folder(next(numbers))))

    def folder(self, point):
        """What is left at a point. To be read only."""
        return pathlib.Path(self._kept.name, str(point))

    def killed_at(self, point, folder):
        """The machine in a folder of its own, as if killed at a point."""
        shutil.rmtree(str(folder), ignore_errors=True)
        shutil.copytree(str(self.folder(point)), str(folder))
        return KilledMachine(folder, self._build, **self._settings)

    def points(self, first=1, step=1):
        """Those at which it has not ended."""
        return range(first, self.told['points'], step)

    def first_in(self, state, times=1):
        """The first point at which a state had begun so often, and had not ended again."""
        for point in self.points():
            diary = KilledMachine(self.folder(point), self._build).diary
            if diary.count('begins')[state] == times > diary.count('ends')[state]:
                return point
        raise AssertionError('{} did not run {} times'.format(state, times))
