"""Runs states and functions that may have to be left behind in threads of their own.

A state with a time limit: on overrun the gate on its userdata is shut and the state is preempted.
After a grace period it is abandoned. A function: it cannot be preempted, and is abandoned at once.
While an abandoned thread lives, what it runs is blocked: nobody enters it again.
"""

import functools
import math
import threading
import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional

import smach
from smach_oracle.foreign import repr_of

from ..background import BackgroundCall, KeptThread
from ..identity import attribute_of, own_mark
from .limited_run import LimitedRun, enter
from .snapshots import UserdataGate

_STOP_PERIOD_S = 0.05  # how soon a function that runs is left behind at a preempt or a shutdown

_FUNCTION = 'smach_oracle function'  # name of its thread
_LATE = 'still runs since it overran its time limit'
_STOPPED = 'still runs since a preempt or a shutdown'


class LimitedResult(NamedTuple):
    """The result of a state or a function in its thread. One of the three is set."""

    outcome: object = None
    error: Optional[BaseException] = None
    overrun: str = ''  # what happened, in words


class _Left(NamedTuple):
    """A call that was left behind."""

    target: object  # the state or the function, kept so that its id stays its own
    call: BackgroundCall
    why: str  # it is blocked


class Workers:
    """Threads of one tree of containers, by the id of the state or function that they run."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.abandoned: Dict[int, _Left] = {}
        # states with a time limit whose thread lives, and those that are asked about if they take
        # long
        self.under_way: Dict[int, LimitedRun] = {}
        self._idle: List[KeptThread] = []  # of functions that have ended, for the next ones

    def blocked(self, target: object) -> str:
        """Return why a state or a function cannot be entered now, '' where it can."""
        if not self.abandoned:
            return ''
        with self._lock:
            left = self.abandoned.get(id(target))
            if left is None:
                return ''
            if left.call.is_alive():
                return left.why
            del self.abandoned[id(target)]
            return ''

    def run(
        self,
        state: smach.State,
        userdata: smach.Remapper,
        gate: UserdataGate,
        label: str,
        limit_s: float,
        grace_s: float,
    ) -> LimitedResult:
        """Execute `state` with a time limit and a grace period, in seconds of monotonic time.

        The limit stands still while a person is asked about something inside the state.
        `gate` is what `userdata` writes through. What the state raises is told in the result, not
        raised.
        """
        run = LimitedRun()
        call = BackgroundCall(
            functools.partial(_execute_inside, run, state, userdata),
            'smach_oracle worker of {}'.format(label),
            functools.partial(self._ended_late, state),
        )
        self.under_way[id(state)] = run
        try:
            call.start()
            return self._run_within(run, state, call, gate, limit_s, grace_s)
        finally:
            if not call.left:
                self.under_way.pop(id(state), None)

    def _run_within(
        self,
        run: LimitedRun,
        state: smach.State,
        call: BackgroundCall,
        gate: UserdataGate,
        limit_s: float,
        grace_s: float,
    ) -> LimitedResult:
        try:
            left_s = limit_s
            while left_s:
                if wait(call.done, left_s):
                    return LimitedResult(call.result, call.error)
                left_s = run.take_stood_s()
        except BaseException:
            # Ctrl-C in the machine's thread: nothing the state does from now on counts
            self._leave_state(run, state, call, gate, 0.0)
            raise
        ended = self._leave_state(run, state, call, gate, grace_s)
        what = 'overran its time limit of {:g} s and '.format(limit_s)
        if ended:
            return LimitedResult(overrun=what + 'ended when it was preempted')
        return LimitedResult(
            overrun=what + 'was abandoned {:g} s after it was preempted'.format(grace_s)
        )

    def _ended_late(self, state: smach.State) -> None:
        self.under_way.pop(id(state), None)
        recall_preempts(state)

    def call(
        self,
        function: Callable[[smach.UserData], object],
        userdata: smach.UserData,
        gate: UserdataGate,
        limit_s: Optional[float],
        grace_s: float,
        stopped: Callable[[], bool],
    ) -> LimitedResult:
        """Call `function` until its time limit (s, monotonic, None: no limit) or until `stopped()`.

        It has `grace_s` more to end by itself, in which it writes nothing any more, and is left
        behind then. `gate` is what `userdata` writes through. What the function raises is told in
        the result, not raised.
        """
        thread = self._take_thread()
        call = BackgroundCall(functools.partial(function, userdata), _FUNCTION, kept=thread)
        call.start()
        is_free = False
        end = time.monotonic() + (math.inf if limit_s is None else limit_s)
        why = ''
        try:
            while not why and not call.done.wait(
                min(_STOP_PERIOD_S, max(0.0, end - time.monotonic()))
            ):
                if time.monotonic() >= end:
                    why = 'overran its time limit of {:g} s'.format(limit_s or 0.0)
                elif stopped():
                    why = 'was stopped by a preempt or a shutdown'
            if not why:
                is_free = True
                return LimitedResult(call.result, call.error)
            gate.shut()
            wait(call.done, grace_s)
        except BaseException:
            self._abandon(function, call, gate, _STOPPED)
            raise
        finally:
            if is_free and not self.abandoned:
                self._idle.append(thread)
            else:
                thread.end()
        late = self._abandon(function, call, gate, _STOPPED if stopped() else _LATE)
        return LimitedResult(overrun=why + (' and was left behind' if late else ''))

    def _take_thread(self) -> KeptThread:
        """Return a thread for a function: an idle one, or a new one."""
        with self._lock:
            while self._idle:
                thread = self._idle.pop()
                if thread.thread.is_alive():  # it is not where the process was forked
                    return thread
        return KeptThread(_FUNCTION)

    def end_idle_threads(self) -> None:
        """Let the threads end that were kept for further functions."""
        with self._lock:
            while self._idle:
                self._idle.pop().end()

    def _leave_state(
        self,
        run: LimitedRun,
        state: smach.State,
        call: BackgroundCall,
        gate: UserdataGate,
        grace_s: float,
    ) -> bool:
        """Preempt a state and abandon it after its grace period.

        Return False where that was needed.
        """
        gate.shut()
        try:
            state.request_preempt()
        except Exception as err:  # a user's request_preempt must not keep the machine from going on
            smach.logerr('request_preempt of {} failed: {}'.format(repr_of(state), repr_of(err)))
        try:
            wait(call.done, grace_s)
        finally:
            abandoned = self._abandon(state, call, gate, _LATE)
            if abandoned:
                run.abandon()
                _stop_bare_machines(state)
            else:
                recall_preempts(state)
        return not abandoned

    def _abandon(self, target: object, call: BackgroundCall, gate: UserdataGate, why: str) -> bool:
        """Leave a thread to itself. Return False where it has ended after all."""
        if not call.leave():
            return False
        gate.shut()
        with self._lock:
            self.abandoned[id(target)] = _Left(target, call, why)
        return True

    def __getstate__(self) -> Dict[str, Any]:
        """Threads do not travel with a pickled machine."""
        return {}

    def __setstate__(self, state: Dict[str, Any]) -> None:
        self.__init__()  # type: ignore[misc]


def _execute_inside(run: LimitedRun, state: smach.State, userdata: smach.Remapper) -> object:
    enter(run)
    return state.execute(userdata)


def wait(event: threading.Event, seconds: float) -> bool:
    """Wait for `event`, however long, monotonic time."""
    end = time.monotonic() + seconds
    while not event.wait(min(max(0.0, end - time.monotonic()), threading.TIMEOUT_MAX)):
        if time.monotonic() >= end:
            return event.is_set()
    return True


def _stop_bare_machines(state: smach.State) -> None:
    """Let machines without an oracle end at their next state boundary, as both engines do then."""
    try:
        if isinstance(state, smach.StateMachine) and own_mark(state, '_oracle') is None:
            state._is_running = False
        for child in _children(state):
            _stop_bare_machines(child)
    except Exception as err:  # a user's container may be of any make
        smach.logwarn('Could not stop what is left of {}: {}'.format(repr_of(state), repr_of(err)))


def _children(state: smach.State) -> List[smach.State]:
    get_children = attribute_of(state, 'get_children')
    return list(get_children().values()) if callable(get_children) else []


def recall_preempts(state: smach.State) -> None:
    """Take a preempt request back from a state that has ended, and from all that it contains."""
    try:
        state.recall_preempt()
        for child in _children(state):
            recall_preempts(child)
    except Exception as err:  # a user's container may be of any make
        smach.logwarn(
            'Could not take a preempt request back from {}: {}'.format(repr_of(state), repr_of(err))
        )
