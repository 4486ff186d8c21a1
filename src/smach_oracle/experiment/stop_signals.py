"""Signals that ask to stop."""

import signal
from types import FrameType
from typing import Any, Dict, Optional


class StopRequested(Exception):
    """A signal asked to stop."""

    def __init__(self, signum: int) -> None:
        super().__init__(signal.Signals(signum).name)
        self.signum = signum


class StopSignals:
    """Notes signals that ask to stop, for `check` to raise: `with StopSignals() as signals`.

    So they cannot tear apart the starting and the stopping of the jobs, and the second Ctrl-C of
    somebody impatient does not leave robots running that the first one was about to stop. A hangup
    that nohup has ignored stays ignored.
    """

    SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def __init__(self) -> None:
        self._came: Optional[int] = None
        self._before: Dict[int, Any] = {}

    def __enter__(self) -> 'StopSignals':
        hangup_ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        self._before = {
            signum: signal.signal(signum, self._note)
            for signum in self.SIGNALS
            if not (signum == signal.SIGHUP and hangup_ignored)
        }
        return self

    def __exit__(self, *_: object) -> None:
        for signum, handler in self._before.items():
            signal.signal(signum, handler)

    def _note(self, signum: int, _: Optional[FrameType]) -> None:
        self._came = self._came or signum

    def check(self) -> None:
        """Raise StopRequested if a signal came."""
        if self._came:
            raise StopRequested(self._came)
