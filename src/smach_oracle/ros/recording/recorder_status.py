"""The recorder's state: what was lost, and whether the disk hangs."""

import threading
import time
from collections import OrderedDict
from enum import IntEnum
from typing import NamedTuple, Optional

REMEMBERED_TRIALS = 64  # whose losses are known one by one


class RecorderState(IntEnum):
    """The numbers are those of RecorderStatus.msg."""

    IDLE = 0
    RECORDING = 1
    DROPPING = 2
    CLOSED = 3


class RecordingStatus(NamedTuple):
    """The status that is published. The fields are those of RecorderStatus.msg."""

    state: RecorderState
    file: str = ''
    trial_id: str = ''
    events_written: int = 0
    events_lost: int = 0
    events_lost_in_total: int = 0
    messages_dropped: int = 0
    text: str = ''


class LossCounter:
    """Counts what was not recorded. Thread-safe."""

    def __init__(self) -> None:
        # a signal handler may close the recorder while this thread counts
        self._lock = threading.RLock()
        self._by_trial: 'OrderedDict[str, int]' = OrderedDict()
        self.events = 0
        self.messages = 0

    def add_events(self, trial_id: str, count: int) -> None:
        """Count lost events of a trial."""
        if count <= 0:
            return
        with self._lock:
            self.events += count
            self._by_trial[trial_id] = self._by_trial.get(trial_id, 0) + count
            while len(self._by_trial) > REMEMBERED_TRIALS:
                self._by_trial.popitem(last=False)

    def add_message(self) -> None:
        """Count a dropped message of another topic."""
        with self._lock:
            self.messages += 1

    def of_trial(self, trial_id: str) -> int:
        """Return the lost events of a trial, one of the latest REMEMBERED_TRIALS that lost any."""
        with self._lock:
            return self._by_trial.get(trial_id, 0)


class DiskWatch:
    """A watch that notices when the writer thread hangs in a call to the disk.

    `with watch:` around each such call.
    """

    def __init__(self, hung_after_s: float) -> None:
        self.hung_after_s = hung_after_s
        self._since: Optional[float] = None

    def __enter__(self) -> None:
        self._since = time.monotonic()

    def __exit__(self, *_: object) -> None:
        self._since = None

    def hangs(self) -> bool:
        """Whether the present call has taken too long."""
        since = self._since
        return since is not None and time.monotonic() - since > self.hung_after_s
