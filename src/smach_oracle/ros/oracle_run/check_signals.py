"""The signal that ends a check, whatever handlers rospy and the script have for it."""
import os
import signal
from typing import Optional

ENDING = (signal.SIGINT, signal.SIGTERM)


class SignalWatch:
    """Hears SIGINT and SIGTERM from its making on. To be made in the main thread.

    Python writes the number of each signal into a pipe before a handler runs: rospy's handler
    swallows the KeyboardInterrupt, and a script that sleeps goes on.
    """

    def __init__(self) -> None:
        self._pipe, writing = os.pipe()
        os.set_blocking(self._pipe, False)
        os.set_blocking(writing, False)
        signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
        self._heard: Optional[signal.Signals] = None

    def heard(self) -> Optional[signal.Signals]:
        """Return the signal that is to end the process, or None where none came."""
        while self._heard is None:
            try:
                numbers = os.read(self._pipe, 64)
            except BlockingIOError:
                break
            self._heard = next((each for each in ENDING if each in numbers), None)
        return self._heard
