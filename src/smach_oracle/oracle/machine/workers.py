"""Runs a state that has a time limit in a thread of its own, so that it can be left behind.

On overrun the gate on its userdata is shut and the state is preempted; after a grace period it is
abandoned. While an abandoned thread lives its state is blocked: nobody enters it again.
"""
import contextvars
import threading
import time
from typing import Any, Dict, NamedTuple, Optional

import smach

from .userdata_gate import UserdataGate


class LimitedResult(NamedTuple):
    """How an execution with a time limit went; exactly one of the three is told."""

    outcome: object = None
    error: Optional[BaseException] = None
    overrun: str = ''  # what happened, in words


class _Execution:
    """One execution in a thread of its own."""

    def __init__(self, state: smach.State, userdata: smach.Remapper, name: str) -> None:
        self.state = state
        self.outcome: object = None
        self.error: Optional[BaseException] = None
        self.abandoned = False
        self._lock = threading.Lock()
        self._userdata = userdata
        self.done = threading.Event()
        context = contextvars.copy_context()
        self.thread = threading.Thread(target=context.run, args=(self._work,), name=name,
                                       daemon=True)

    def _work(self) -> None:
        try:
            self.outcome = self.state.execute(self._userdata)
        except BaseException as err:
            # handed to the machine's thread, SystemExit and KeyboardInterrupt among them
            self.error = err
        with self._lock:
            self.done.set()
            late = self.abandoned
        if late:
            recall_preempts(self.state)

    def abandon(self) -> bool:
        """Leave the thread to itself; False where it has ended after all."""
        with self._lock:
            self.abandoned = not self.done.is_set()
            return self.abandoned


class Workers:
    """The abandoned threads of one tree of containers, by state."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.abandoned: Dict[int, _Execution] = {}

    def blocked(self, state: smach.State) -> str:
        """Return why `state` cannot be entered now, '' where it can."""
        with self._lock:
            run = self.abandoned.get(id(state))
            if run is None:
                return ''
            if run.thread.is_alive():
                return 'still runs since it overran its time limit'
            del self.abandoned[id(state)]
            return ''

    def run(self, state: smach.State, userdata: smach.Remapper, gate: UserdataGate, label: str,
            limit_s: float, grace_s: float) -> LimitedResult:
        """Execute `state` with a time limit and a grace period, in seconds of monotonic time.

        `gate` is what `userdata` writes through. What the state raises is told in the result, not
        raised.
        """
        run = _Execution(state, userdata, 'smach_oracle worker of {}'.format(label))
        run.thread.start()
        try:
            if wait(run.done, limit_s):
                return LimitedResult(run.outcome, run.error)
        except BaseException:
            # Ctrl-C in the machine's thread: nothing the state does from now on counts
            self._leave(run, gate, 0.0)
            raise
        ended = self._leave(run, gate, grace_s)
        what = 'overran its time limit of {:g} s and '.format(limit_s)
        if ended:
            return LimitedResult(overrun=what + 'ended when it was preempted')
        return LimitedResult(overrun=what +
                             'was abandoned {:g} s after it was preempted'.format(grace_s))

    def _leave(self, run: _Execution, gate: UserdataGate, grace_s: float) -> bool:
        gate.shut()
        try:
            run.state.request_preempt()
        except Exception as err:  # a user's request_preempt must not keep the machine from going on
            smach.logerr('request_preempt of {!r} failed: {!r}'.format(run.state, err))
        try:
            wait(run.done, grace_s)
        finally:
            if run.abandon():
                with self._lock:
                    self.abandoned[id(run.state)] = run
            else:
                recall_preempts(run.state)
        return not run.abandoned

    def __getstate__(self) -> Dict[str, Any]:
        """Threads do not travel with a pickled machine."""
        return {}

    def __setstate__(self, state: Dict[str, Any]) -> None:
        self.__init__()  # type: ignore[misc]


def wait(event: threading.Event, seconds: float) -> bool:
    """Wait for `event`, however long; monotonic time."""
    end = time.monotonic() + seconds
    while not event.wait(min(max(0.0, end - time.monotonic()), threading.TIMEOUT_MAX)):
        if time.monotonic() >= end:
            return event.is_set()
    return True


def recall_preempts(state: smach.State) -> None:
    """Take a preempt request back from a state that has ended, and from all that it contains."""
    try:
        state.recall_preempt()
        get_children = getattr(state, 'get_children', None)
        for child in (get_children() if callable(get_children) else {}).values():
            recall_preempts(child)
    except Exception as err:  # a user's container may be of any make
        smach.logwarn('Could not take a preempt request back from {!r}: {!r}'.format(state, err))
