"""Notes that a trial ends before its machine does, or is started over.

Pure, and without smach.
"""

import contextlib
import threading
from typing import Dict, Iterator, Mapping, Optional

from ..scope.scope import Reason, Scope
from .facts import TrialEnd


class EarlyEnd:
    """The early end of one trial. Every container then stops where it stands, without an outcome.

    It cancels the scope of the trial. Any thread may call it.
    """

    why: Optional[TrialEnd]  # None: it has not come
    # sys.exit or Ctrl-C in a thread: the error of a Concurrence need not have it as its cause
    of_program: Optional[BaseException]

    def __init__(self, scope: Scope) -> None:
        self._scope = scope
        self._is_going_down = False  # the process
        self._asking = 0  # questions that are open
        self._lock = threading.Lock()
        self.begin_trial(is_stored=False)

    def begin_trial(self, is_stored: bool) -> None:
        """Begin a trial. `is_stored`: it has a store from which it can go on."""
        with self._lock:
            self._scope.renew()
            self.why, self.of_program, self._is_stored = None, None, is_stored

    @contextlib.contextmanager
    def asking(self) -> Iterator[None]:
        """Mark a question as open: after a shutdown the trial then goes on later."""
        with self._lock:
            self._asking += 1
        try:
            yield
        finally:
            with self._lock:
                self._asking -= 1

    def is_near(self) -> bool:
        """Whether it has come, or may come at a shutdown, since a question is open."""
        return bool(self._asking or self.why)

    def note_end_of_state(self) -> None:
        """Note that a state has ended: next to an open question a shutdown may have ended it."""
        if self._asking:
            self.end_at_shutdown()

    def keep(self) -> None:
        """End the trial early, as nobody has answered whether it may go on."""
        with self._lock:
            self._end(TrialEnd.KEPT)

    def note_shutdown(self) -> None:
        """Note that the process goes down, before its machines are preempted for that."""
        with self._lock:
            self._is_going_down = True
            if self._asking:
                self._end_at_shutdown()

    def end_at_shutdown(self) -> bool:
        """End a stored trial early where the process goes down, and return whether it has ended."""
        is_shutdown = self._is_going_down or self._scope.reason is Reason.SHUTDOWN
        with self._lock:
            if is_shutdown:
                self._end_at_shutdown()
            return self.why is not None

    def _end_at_shutdown(self) -> None:
        if self._is_stored:
            self._end(TrialEnd.SHUTDOWN)

    def _end(self, why: TrialEnd) -> None:
        self.why = self.why or why
        self._scope.cancel(Reason.EARLY_END)


class Restarts:
    """The restarts of one trial of a tree.

    `count`: how often its top machine was started over. `is_due`: whether the userdata of the start
    is wanted, and not kept yet. `is_new`: whether it is kept, and not stored yet. `userdata`: that
    with which containers have begun, by node.
    """

    def __init__(self) -> None:
        self.begin_trial(False)

    def begin_trial(self, is_wanted: bool) -> None:
        """Forget the trial before. `is_wanted`: whether a policy may start this one over."""
        self.count = 0
        self.is_due = is_wanted
        self.is_new = False
        self.userdata: Mapping[object, Dict[str, object]] = {}

    def keep(self, userdata: Mapping[object, Dict[str, object]]) -> None:
        """Keep snapshots of the userdata of the start."""
        self.is_due, self.is_new = False, True
        self.userdata = userdata
