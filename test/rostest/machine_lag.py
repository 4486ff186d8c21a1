"""How busy the machine is with others: what that adds to delays that a test measures by the
clock.
"""

import threading
import time
from collections import deque

_NAP_S = 0.005


class MachineLag:
    """Naps all the time, and notes how late it is woken."""

    def __init__(self):
        self._late = deque(maxlen=100000)  # (monotonic, s)
        threading.Thread(target=self._nap, daemon=True).start()

    def most_s(self, since_s):
        """The latest that a sleeper was woken since then (monotonic)."""
        return max((late for at, late in list(self._late) if at >= since_s), default=0.0)

    def _nap(self):
        while True:
            begun_s = time.monotonic()
            time.sleep(_NAP_S)  # how late it is woken is what is measured
            self._late.append((time.monotonic(), time.monotonic() - begun_s - _NAP_S))
