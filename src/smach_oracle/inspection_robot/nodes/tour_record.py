"""The record of one trial: the line of truth that the world's node writes at its end."""

import json
import os
import time
from pathlib import Path
from typing import Any, Dict

from ..world.inspection_world import InspectionWorld

CONTACT = 'driven_against'  # a kind of damage


class TimeUse:
    """Wall and processor time (s) of one thread, by what they went into."""

    def __init__(self) -> None:
        self.spent: Dict[str, float] = {}
        self.used: Dict[str, float] = {}
        self._since, self._used_since = time.monotonic(), time.thread_time()

    def add(self, what: str) -> None:
        """The time since the last call went into `what`. In that thread alone."""
        now, used = time.monotonic(), time.thread_time()
        self.spent[what] = self.spent.get(what, 0.0) + now - self._since
        self.used[what] = self.used.get(what, 0.0) + used - self._used_since
        self._since, self._used_since = now, used

    def restart(self) -> None:
        """Begin again. In any thread."""
        self.spent, self.used = {}, {}


class TourRecord:
    """The record of a trial that is under way."""

    def __init__(self, world: InspectionWorld, clock_s: float) -> None:
        """`clock_s`: ROS time at which it begins."""
        self._world = world
        self._clock_s = clock_s
        self._began_s = time.monotonic()
        self._passed: Dict[str, float] = {}  # s of the world's time, by what took it
        self._charged: Dict[str, float] = {}  # s of the trial at which work began that goes on
        self._at_end: Dict[str, Any] = {}

    def passed(self, seconds: float, what: str) -> None:
        """Add up the world's time (s) that passed for some work.

        Work that has begun counts by its begin and end alone.
        """
        if what not in self._charged:
            self._passed[what] = self._passed.get(what, 0.0) + seconds

    def charge(self, what: str, on: bool) -> None:
        """Some work begins (on) or ends now. All time between is its own."""
        if on:
            self._charged.setdefault(what, self._world.time_s)
        elif what in self._charged:
            begun_s = self._charged.pop(what)
            self.passed(self._world.time_s - begun_s, what)

    def end(self) -> None:
        """The script has come to its end. Only its last reports may still be on their way."""
        if self._at_end:
            return
        for what in tuple(self._charged):
            self.charge(what, False)
        touched = list(self._world.contacts.things)
        self._at_end = {
            'damage': {'count': len(touched), CONTACT: touched},
            'causes': self._world.log.record(),
            'sim_s': round(self._world.time_s, 3),
            'passed_s': {what: round(each, 3) for what, each in sorted(self._passed.items())},
        }

    def line(self, use: TimeUse) -> Dict[str, Any]:
        """Return the line of truth.

        :param use: the time of the world's thread since the trial began.
        """
        self.end()
        lacking, wall_s = self._world.shortcomings(), time.monotonic() - self._began_s
        return {
            'seed': self._world.scene.seed,
            'task': 'inspection',
            'success': not lacking,
            'why': '; '.join(lacking),
            'wrong_object': ', '.join(self._world.wrong_readings()),
            **self._at_end,
            'wall_s': round(wall_s, 3),
            'share': {
                what: round(each / max(wall_s, 1e-9), 4) for what, each in sorted(use.spent.items())
            },
            'cpu_s': {what: round(each, 4) for what, each in sorted(use.used.items())},
            'clock_s': round(self._clock_s, 3),
            'pauses': [],
        }


def append_record(path: str, line: Dict[str, Any]) -> None:
    """Append a line that is on the disk when this returns.

    :raises OSError: where it cannot be written.
    """
    with Path(path).expanduser().open('a', encoding='utf-8') as stream:
        stream.write(json.dumps(line, allow_nan=False) + '\n')
        stream.flush()
        os.fsync(stream.fileno())
