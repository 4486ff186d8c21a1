"""Prunes the folder of a recorder when a trial's bag is closed, in a thread of its own."""

import threading
import time
from typing import Optional

from ..log.said_once import SaidOnce
from .bag_folder import BagFolder, Say, remove
from .limits import DAY_S, GB, Limits, planned


class Pruner:
    """Removes bags over the limits. The robot never waits for it."""

    def __init__(self, folder: str, limits: Limits, say: Say, warn: Say) -> None:
        self._folder, self._limits = folder, limits
        self._bags = BagFolder(folder)
        self._say, self._warn = say, SaidOnce(warn)
        self._due = threading.Event()
        self._thread: Optional[threading.Thread] = None

    def bag_closed(self) -> None:
        """Look at the folder soon. Any thread may use it."""
        if not self._limits.are_set:
            return
        self._due.set()
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name='bag pruning', daemon=True)
            self._thread.start()

    def _work(self) -> None:
        while True:
            self._due.wait()
            self._due.clear()
            try:
                self.prune()
            except OSError as err:
                self._warn('{}: old bags are not removed: {}'.format(self._folder, err))

    def prune(self) -> None:
        """Remove what is over the limits, each bag after a line about it.

        :raises OSError: where the folder cannot be read.
        """
        size, oldest = self._bags.totals()
        limits, now = self._limits, time.time()
        if not (
            (limits.gb and size > limits.gb * GB)
            or (limits.days and now - oldest > limits.days * DAY_S)
        ):
            return
        remove(planned(self._bags.bags(), limits, now), self._say, self._warn)
