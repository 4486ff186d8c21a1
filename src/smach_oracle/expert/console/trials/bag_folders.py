"""The folders of bags: which files in them may be read, and how one is opened.

Only plain files inside the folders may be read. Opening a pipe may wait forever, and a link may
lead to any file of this machine.
"""

import os
import stat
from typing import Dict, List, NamedTuple, Sequence

from smach_oracle.analysis.bag_events import walk_bags
from smach_oracle.analysis.bag_worker import BagReadError

_KINDS = (
    (stat.S_ISFIFO, 'a named pipe'),
    (stat.S_ISSOCK, 'a socket'),
    (stat.S_ISDIR, 'a folder'),
    (stat.S_ISCHR, 'a device'),
    (stat.S_ISBLK, 'a device'),
)


class FileState(NamedTuple):
    """A file as it was when it was looked at."""

    size: int  # bytes
    changed_ns: int  # since the epoch


class FoundBags(NamedTuple):
    """The bags that were found at one moment."""

    states: Dict[str, FileState]  # by path, without links
    refused: Dict[str, str]  # why, by path
    missing: List[str]  # sentences on folders that are not there


class BagFolders:
    """The folders that the console was given. Any thread."""

    def __init__(self, places: Sequence[str]) -> None:
        """`places`: folders with bags in them or below, or single bags."""
        self._places = list(places)

    def __bool__(self) -> bool:
        return bool(self._places)

    def find(self) -> FoundBags:
        """Look for bags. Each is found once."""
        found = FoundBags({}, {}, [])
        for place in self._real():
            if os.path.isdir(place):
                for path in walk_bags(place):
                    self._look_at(path, found)
            elif os.path.lexists(place):
                self._look_at(place, found)
            else:
                found.missing.append('{}: no such folder.'.format(place))
        return found

    def open(self, path: str) -> int:
        """Return a descriptor for reading.

        Never waits, whatever is there by now.

        :raises BagReadError: where it is no plain file inside the folders, or cannot be opened.
        :raises FileNotFoundError: where it is gone.
        """
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
        except FileNotFoundError:
            raise
        except OSError as err:
            raise BagReadError('it cannot be opened: {}'.format(err.strerror)) from err
        problem = self._problem(
            os.readlink('/proc/self/fd/{}'.format(descriptor)), os.fstat(descriptor).st_mode
        )
        if problem:
            os.close(descriptor)
            raise BagReadError(problem)
        return descriptor

    def name_of(self, path: str) -> str:
        """Return a path below the folder that it was found in."""
        for place in self._real():
            if path.startswith(_within(place)):
                return path[len(_within(place)) :]
        return os.path.basename(path)

    def _look_at(self, path: str, found: FoundBags) -> None:
        try:
            status, real = os.stat(path), os.path.realpath(path)
        except OSError:
            return  # it is gone, or a link that leads nowhere
        problem = self._problem(real, status.st_mode)
        if problem:
            found.refused[path] = problem
        else:
            found.states[real] = FileState(status.st_size, status.st_mtime_ns)

    def _problem(self, real: str, mode: int) -> str:
        """Return why a file is not read, or '' where it may be. `real`: its path without links."""
        if not any(real == place or real.startswith(_within(place)) for place in self._real()):
            return 'a link that leads out of the folder'
        if not stat.S_ISREG(mode):
            return 'no plain file, but {}'.format(
                next((name for fits, name in _KINDS if fits(mode)), 'something else')
            )
        return ''

    def _real(self) -> List[str]:
        return [os.path.realpath(place) for place in self._places]


def _within(place: str) -> str:
    return place.rstrip(os.sep) + os.sep
