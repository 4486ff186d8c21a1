"""The signal that ends a check, whatever handlers rospy and the script have for it."""

import signal
from typing import Optional

from ..signals.signal_ear import SignalEar

ENDING = (signal.SIGINT, signal.SIGTERM)


class SignalWatch:
    """Hears SIGINT and SIGTERM from its making on. To be made in the main thread.

    Python writes the number of each signal to the ear before a handler runs: rospy's handler
    swallows the KeyboardInterrupt, and a script that sleeps goes on.
    """

    def __init__(self) -> None:
        self._ear = SignalEar()
        self._heard: Optional[signal.Signals] = None

    def heard(self) -> Optional[signal.Signals]:
        """Return the signal that is to end the process, or None where none came."""
        while self._heard is None:
            numbers = self._ear.heard()
            if not numbers:
                break
            self._heard = next((each for each in ENDING if each in numbers), None)
        return self._heard
