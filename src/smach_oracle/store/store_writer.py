"""Writes moments in a thread of its own, so that no disk holds the machine up for long."""

import threading
import time
import weakref
from typing import Callable, List, MutableSet, NamedTuple, Optional, Union

from .rows import NewMoment
from .store_file import NewTrial, StoreFile
from .thinning import EVERY, LAST, thin

Warn = Callable[[str], None]
RETRY_S = 1.0  # between two tries at a disk that fails
CLOSE_S = 5.0
MOST_BEHIND = 1000  # moments kept apart. More are merged into one


def no_stop() -> bool:
    """Return False: nobody wants to stop."""
    return False


class Ending(NamedTuple):
    """The end of a trial, for good."""

    at: float  # s since the epoch
    outcome: str


_writers: 'MutableSet[StoreWriter]' = weakref.WeakSet()


def running_writers() -> 'List[StoreWriter]':
    """Return the writers of this process whose trials go on."""
    return [each for each in list(_writers) if each.is_running]


class StoreWriter:
    """Commits the moments of one trial, in their order.

    A moment that is not on the disk within `wait_s` s is said to be late, once. Until the disk has
    caught up nobody waits for it. All is written then, and that is said, too.
    """

    def __init__(
        self, store: StoreFile, trial: Union[NewTrial, int], wait_s: float, warn: Warn
    ) -> None:
        """`trial`: one that begins, or the number of one that goes on."""
        self._store, self._trial = store, trial
        self._end: Optional[Ending] = None
        self._wait_s, self._warn = wait_s, warn
        self._ready = threading.Condition(threading.Lock())
        self._waiting: List[NewMoment] = []
        self._given = self._done = 0  # numbers of moments
        self._is_behind = False
        self._error = ''
        self._is_closing = False
        self._until_thinned = LAST + EVERY  # moments
        self._thread = threading.Thread(target=self._work, name='store', daemon=True)
        self._thread.start()
        _writers.add(self)

    @property
    def path(self) -> str:
        """Return the path of the store."""
        return str(self._store.path)

    @property
    def error(self) -> str:
        """Return why moments are missing on the disk, or '' where it is just slow."""
        return self._error

    @property
    def is_running(self) -> bool:
        """Whether its trial goes on, or its last moments are still being written."""
        return self._thread.is_alive()

    @property
    def is_behind(self) -> bool:
        """Whether moments are missing on the disk for which somebody has waited in vain."""
        return self._is_behind

    def commit(self, moment: NewMoment, must_stop: Callable[[], bool] = no_stop) -> bool:
        """Commit a moment, and return whether it is on the disk now.

        `must_stop`: asked while it waits, and at once. Where it is true nobody waits any longer.
        """
        with self._ready:
            self._given += 1
            number = self._given
            self._waiting.append(moment)
            if len(self._waiting) > MOST_BEHIND:
                self._waiting = [merged(self._waiting)]
            self._ready.notify_all()
            if self._is_behind:
                return False
            until = time.monotonic() + self._wait_s
            while self._done < number and not self._error:
                left = until - time.monotonic()
                if left <= 0:
                    break
                self._ready.wait(min(left, 0.05))
                if self._done < number and must_stop():
                    return False
            if self._done >= number:
                return True
            self._is_behind = True
            why = self._error or 'took more than {:g} s'.format(self._wait_s)
        self._warn(
            '{}: {}. The machine goes on, and what is not stored yet is stored as soon as '
            'that can be done'.format(self._store.path, why)
        )
        return False

    def close(self, ending: Optional[Ending] = None, timeout_s: float = CLOSE_S) -> bool:
        """Write what waits, and end. Return whether all is written.

        `ending`: of the trial. None means it has not ended and can be resumed.
        """
        with self._ready:
            self._end = ending
            self._is_closing = True
            self._ready.notify_all()
        self._thread.join(timeout_s)
        is_written = not self._thread.is_alive() and not self._waiting
        if not is_written:
            self._warn(
                '{}: the end of the trial is not stored: {}'.format(
                    self._store.path, self._error or 'the disk takes too long'
                )
            )
        return is_written

    def _work(self) -> None:
        while True:
            with self._ready:
                while not self._waiting and not self._is_closing:
                    self._ready.wait()
                if not self._waiting and self._end is None:
                    return
                batch, self._waiting = self._waiting, []
                until = self._given
            error = self._write(batch)
            with self._ready:
                if error:
                    self._waiting = batch + self._waiting
                    self._error = error
                    self._ready.notify_all()
                    if self._is_closing:
                        return
                    self._ready.wait(RETRY_S)
                    continue
                if self._is_closing and not self._waiting:
                    self._done = until
                    return
                self._done, self._error = until, ''
                caught_up = self._is_behind and not self._waiting
                self._is_behind = self._is_behind and not caught_up
                self._ready.notify_all()
            self._until_thinned -= len(batch)
            if self._until_thinned <= 0 and not self._is_closing and not self._waiting:
                self._thin()
            if caught_up:
                self._warn('{}: all is stored again'.format(self._store.path))

    def _thin(self) -> None:
        """Take out old moments. Where that fails it is tried again later: nothing is lost."""
        self._until_thinned = EVERY
        try:
            if isinstance(self._trial, int):
                thin(self._store, self._trial)
        except Exception:  # this thread lives as long as the trial
            pass

    def _write(self, batch: List[NewMoment]) -> str:
        """Write moments, and the end once it has come. Return what went wrong, '' for nothing."""
        try:
            if isinstance(self._trial, NewTrial):
                self._trial = self._store.begin_trial(self._trial)
            if batch:
                self._store.add(self._trial, batch)
            if self._end is not None and not self._waiting:
                self._store.end_trial(self._trial, *self._end)
            return ''
        except Exception as err:  # this thread lives as long as the trial
            return str(err) or type(err).__name__


def merged(moments: List[NewMoment]) -> NewMoment:
    """Return one moment that leaves the store as all of these do. Those between are lost."""
    latest = {(fact.path, fact.name): fact for moment in moments for fact in moment.facts}
    return moments[-1]._replace(facts=tuple(latest.values()), after=moments[0].after)
