"""Runs states and functions that may have to be left behind in threads of their own.

A state with a time limit: on overrun the gate on its userdata is shut and the state is preempted.
After a grace period it is abandoned. A function: it cannot be preempted, and is abandoned at once.
While an abandoned thread lives, what it runs is blocked: nobody enters it again.
"""

import contextlib
import functools
import threading
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple, Type

import smach
from smach_common.foreign import repr_of

from ..identity import attribute_of, own_attributes, own_mark
from ..scope.background_call import BackgroundCall, KeptThread
from ..scope.clock import Clock
from ..scope.scope import CallEnd, Reason, Scope, inside
from ..settings.settings import StateSettings
from ..smach_private import mark_of, set_executing
from .userdata import UserdataGate

_FUNCTION = 'smach_oracle function'  # name of its thread
_RECALL = 'recall_preempt'
_LATE = 'still runs since it overran its time limit'
_STOPPED = 'still runs since a preempt or a shutdown'


class Overrun(NamedTuple):
    """Stands in place of the outcome of a state or a function that overran, or still runs."""

    text: str  # what happened, in words


class _AbandonedCall(NamedTuple):
    """A call that was left behind."""

    target: object  # the state or the function, kept so that its id stays its own
    call: BackgroundCall
    why: str  # it is blocked


class Workers:
    """Threads of one tree of containers, by the id of the state or function that they run."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self.abandoned: Dict[int, _AbandonedCall] = {}
        # states with a time limit whose thread lives, and those that are asked about if they take
        # long
        self.under_way: Dict[int, Scope] = {}
        self._idle: List[KeptThread] = []  # of functions that have ended, for the next ones

    def blocked(self, target: object) -> str:
        """Return why a state or a function cannot be entered now, '' where it can."""
        if not self.abandoned:
            return ''
        with self._lock:
            abandoned = self.abandoned.get(id(target))
            if abandoned is not None:
                if abandoned.call.is_alive():
                    return abandoned.why
                del self.abandoned[id(target)]
        return ''

    def run(
        self,
        state: smach.State,
        userdata: smach.Remapper,
        gate: UserdataGate,
        label: str,
        settings: StateSettings,
    ) -> object:
        """Execute `state` with the time limit and the grace period of some settings.

        The limit stands still while a person is asked about something inside the state.
        `gate` is what `userdata` writes through. It returns the outcome, or an Overrun. It raises
        what the state raises.
        """
        limit_s, grace_s = settings.time_limit_s or 0.0, settings.grace_period_s
        run = Scope(clock=self._clock, limit_s=limit_s)

        def execute() -> object:
            with inside(run):
                return state.execute(userdata)

        def stop() -> None:
            gate.shut()
            request_preempt(state)

        def end_late() -> None:
            self.under_way.pop(id(state), None)
            recall_preempts(state)

        call = BackgroundCall(execute, 'smach_oracle worker of {}'.format(label), end_late)
        self.under_way[id(state)] = run
        end = None
        try:
            end = run.run(call, grace_s, stop)
        finally:
            if call.was_left_behind:
                self._block(state, call, _LATE)
                run.cancel(Reason.LEFT_BEHIND)
                _leave_behind(state, call)
                if call.done.is_set():  # meanwhile, and what it took back may stand since
                    recall_preempts(state)
            elif end is CallEnd.BY_ITSELF:
                self.under_way.pop(id(state), None)
            else:
                end_late()
        if end is CallEnd.BY_ITSELF:
            return call.returned()
        ended = 'ended when it was preempted'
        if call.was_left_behind:
            ended = 'was abandoned {:g} s after it was preempted'.format(grace_s)
        return Overrun('overran its time limit of {:g} s and {}'.format(limit_s, ended))

    def call(
        self,
        function: Callable[[smach.UserData], object],
        userdata: smach.UserData,
        gate: UserdataGate,
        settings: StateSettings,
        scope: Scope,
    ) -> object:
        """Call `function` until its time limit, if any, or until `scope` is cancelled.

        It has the grace period more to end by itself, in which it writes nothing any more, and is
        left behind then. `gate` is what `userdata` writes through. It returns what the function
        returns, or an Overrun. It raises what that raises.
        """
        thread, limit_s = self._take_thread(), settings.time_limit_s
        call = BackgroundCall(functools.partial(function, userdata), _FUNCTION, kept=thread)
        end = None
        try:
            end = Scope(scope, limit_s=limit_s).run(call, settings.grace_period_s, gate.shut)
        finally:
            if call.was_left_behind:
                self._block(function, call, _LATE if end is CallEnd.OVERRUN else _STOPPED)
            if end is CallEnd.BY_ITSELF and not self.abandoned:
                self._idle.append(thread)
            else:
                thread.end()
        if end is CallEnd.BY_ITSELF:
            return call.returned()
        why = 'was stopped by a preempt or a shutdown'
        if end is CallEnd.OVERRUN:
            why = 'overran its time limit of {:g} s'.format(limit_s or 0.0)
        return Overrun(why + (' and was left behind' if call.was_left_behind else ''))

    def _take_thread(self) -> KeptThread:
        """Return a thread for a function: an idle one, or a new one."""
        try:
            while True:
                thread = self._idle.pop()
                if thread.is_usable():
                    return thread
        except IndexError:
            return KeptThread(_FUNCTION)

    def end_idle_threads(self) -> None:
        """Let the threads end that were kept for further functions."""
        with contextlib.suppress(IndexError):  # each thread has one who takes it out
            while True:
                self._idle.pop().end()

    def _block(self, target: object, call: BackgroundCall, why: str) -> None:
        with self._lock:
            self.abandoned[id(target)] = _AbandonedCall(target, call, why)


def request_preempt(state: Optional[smach.State]) -> None:
    """Preempt a state. A user's own `request_preempt` must not keep the machine from going on."""
    try:
        if state is not None:
            state.request_preempt()
    except Exception as err:
        smach.logerr('request_preempt of {} failed: {}'.format(repr_of(state), repr_of(err)))


class _KeptRequest:
    """Stands in place of the `recall_preempt` of a state that was left behind, as long as it runs.

    So nobody takes its request back: no engine at the end of a container, no action server for the
    goal before. A deep copy of the state does not run. `own`: what a user had put in this place.
    """

    def __init__(self, state: smach.State, call: Optional[BackgroundCall], own: object) -> None:
        self._state = state
        self._call = call
        self.own = own

    @property
    def stands(self) -> bool:
        """Whether the state still runs."""
        return self._call is not None and not self._call.done.is_set()

    def __call__(self) -> None:
        if self.stands:
            return
        attributes = own_attributes(self._state)
        attributes.pop(_RECALL, None)
        if self.own is not None:
            attributes[_RECALL] = self.own
        self._state.recall_preempt()

    def __reduce__(self) -> Tuple[Type['_KeptRequest'], Tuple[object, ...]]:
        return _KeptRequest, (self._state, None, self.own)


def _leave_behind(state: smach.State, call: BackgroundCall) -> None:
    """Have the request to a state that still runs stand, and to all that it contains.

    Machines in it without an oracle end at their next state boundary, as both engines do then.
    """
    if call.done.is_set():  # it has ended meanwhile
        return
    kept = own_mark(state, _RECALL)
    own = kept.own if isinstance(kept, _KeptRequest) else kept
    own_attributes(state)[_RECALL] = _KeptRequest(state, call, own)
    try:
        if isinstance(state, smach.StateMachine) and mark_of(state) is None:
            set_executing(state, False)
        for child in _children(state):
            kept = own_mark(child, _RECALL)
            # one that was left behind itself may run longer
            if not (isinstance(kept, _KeptRequest) and kept.stands):
                _leave_behind(child, call)
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
