"""What may end early: a trial, a container that executes, a recovery, a question.

A scope lies in one scope or in several. It ends early with each of them. `trio.CancelScope` is the
model, in threads: nothing is raised, but each wait in a scope ends when the scope is cancelled, and
who works in it looks at `reason`.
"""

import contextlib
import contextvars
import threading
from enum import Enum, IntEnum, unique
from typing import (
    Callable,
    Iterable,
    Iterator,
    Optional,
    Protocol,
    Set,
    Tuple,
    Type,
)

from .background_call import BackgroundCall
from .clock import Bell, Clock, Flag, PausableClock

# how soon a wait sees a reason of which nobody tells it, such as `smach.is_shutdown`
LOOK_S = 0.05


@unique
class Reason(IntEnum):
    """A reason to end early. If there are several, the first of this order counts.

    The first two come first, as nobody waits for an outcome then, and no other state begins. A
    preempt comes before a shutdown: where both are there, the process that goes down has preempted
    its machines.
    """

    EARLY_END = 1  # of the trial, which goes on later from its store
    LEFT_BEHIND = 2  # the state around it was abandoned
    PREEMPTED = 3
    SHUTDOWN = 4  # of the process
    TIME_OVER = 5  # the minutes of the trial's budget
    ENDED = 6  # what it was about is over

    @property
    def text(self) -> str:
        """Return it in words."""
        return self.name.lower().replace('_', ' ')


Look = Callable[[], Optional[Reason]]


class Ringable(Protocol):
    """Something that is told of a cancel: a bell, or the engine of a machine."""

    def ring(self) -> None:
        """Look at the reason now, or soon."""


class CallEnd(Enum):
    """The end of a call, as who ran it sees it (`Scope.run`)."""

    BY_ITSELF = 'by itself'
    OVERRUN = 'overrun'
    STOPPED = 'stopped'


class Scope:
    """Something under way that may have to end early. Safe to use from several threads.

    An example, a recovery in a trial that a preempt ends::

        trial = Scope()
        recovery = Scope(trial)
        threading.Timer(1.0, recovery.cancel, (Reason.PREEMPTED,)).start()
        recovery.wait(300.0)  # returns False after a second
        assert recovery.reason is Reason.PREEMPTED and trial.reason is None

    :param around: the scopes with each of which this one ends.
    :param look: returns a reason of which nobody tells, or None. A wait asks it again and again.
    :param clock: that of the waits, by default that of the first scope around.
    :param limit_s: of a call that runs in it (`run`), in seconds of its `time`.
    :param time: has passed in it, except where others have paused it. It has one with a limit.
    """

    __slots__ = ('clock', 'time', 'limit_s', 'line', 'looks', 'cancelled', 'bells')

    def __init__(
        self,
        *around: 'Scope',
        look: Optional[Look] = None,
        clock: Optional[Clock] = None,
        limit_s: Optional[float] = None,
        time: Optional[PausableClock] = None,
    ) -> None:
        self.clock: Clock = clock or (around[0].clock if around else Clock())
        self.limit_s = limit_s
        self.time = PausableClock(self.clock) if time is None and limit_s is not None else time
        self.line: Tuple['Scope', ...] = (self,)  # it and all around it
        self.looks: Tuple[Look, ...] = () if look is None else (look,)
        for each in around:
            self.line += each.line
            self.looks += each.looks
        self.cancelled: Optional[Reason] = None
        # of all who wait. To add one, to remove one and to copy them are one step each: no lock is
        # held, in which the handler of a signal could meet its own thread
        self.bells: Set[Ringable] = set()

    def cancel(self, reason: Reason) -> None:
        """End it early, and wake all that wait in it. A reason that counts more stays."""
        self.cancelled = min(reason, self.cancelled or reason)
        self.wake()

    def renew(self) -> None:
        """Have it go on, as if it had not been cancelled."""
        self.cancelled = None

    def wake(self) -> None:
        """Have all that wait in it look at its reason now."""
        for bell in tuple(self.bells):
            bell.ring()

    def tell(self, bell: Ringable) -> None:
        """Ring this, too, when it is cancelled, or now where it was."""
        self.bells.add(bell)
        if self.told is not None:
            bell.ring()

    @property
    def told(self) -> Optional[Reason]:
        """Return why it was cancelled, or one around it, None where it was not."""
        told = None
        for each in self.line:
            reason = each.cancelled
            if reason is not None and (told is None or reason < told):
                told = reason
        return told

    @property
    def reason(self) -> Optional[Reason]:
        """Return why it is to end, None where it may go on. It looks for what nobody tells."""
        reason = self.told
        # a look may be the code of a user: nobody takes it where it cannot count
        if reason is None or reason > Reason.LEFT_BEHIND:
            for look in self.looks:
                seen = look()
                if seen is not None and (reason is None or seen < reason):
                    reason = seen
        return reason

    @property
    def reasons(self) -> Set[Reason]:
        """Return all reasons for which it is to end."""
        found = [each.cancelled for each in self.line] + [look() for look in self.looks]
        return {each for each in found if each is not None}

    def wait(self, seconds: Optional[float] = None, until: Optional[Flag] = None) -> bool:
        """Wait until a flag is set, or for so many seconds. A cancel ends it at once.

        :param seconds: at most, None for without end. Without a flag that is a pause.
        :returns: whether the flag is set, or whether the pause is over.
        """
        bell, now = Bell(), self.clock.now
        ends_s = float('inf') if seconds is None else now() + seconds
        longest_s = LOOK_S if self.looks else threading.TIMEOUT_MAX
        for each in self.line:
            each.bells.add(bell)
        if until is not None:
            until.bells.add(bell)
        try:
            while True:
                if until is not None and until.is_set():
                    return True
                if self.reason is not None:
                    return False
                left_s = ends_s - now()
                if left_s <= 0:
                    return until is None
                self.clock.wait(bell, left_s, longest_s, until is None)
        finally:
            for each in self.line:
                each.bells.discard(bell)
            if until is not None:
                until.bells.discard(bell)

    def run(self, call: BackgroundCall, grace_s: float, stop: Callable[[], None]) -> CallEnd:
        """Run a call in its thread, and wait for its end.

        Once its time is over, or this scope is cancelled, `stop` is called. The call has a grace
        period then in which to end, and is left to itself after that. Where this thread itself is
        interrupted, as by Ctrl-C, it has none.

        :returns: how it has ended. `call.was_left_behind` says whether it has not.
        """
        call.start()
        try:
            end = self._wait_for_end(call.done)
            if end is not CallEnd.BY_ITSELF:
                stop()
        except BaseException:
            stop()
            call.leave_behind()
            raise
        if end is not CallEnd.BY_ITSELF:
            try:
                Scope(clock=self.clock).wait(grace_s, call.done)
            finally:
                call.leave_behind()
        return end

    def _wait_for_end(self, done: Flag) -> CallEnd:
        limit_s, time = self.limit_s, self.time
        if limit_s is None or time is None:
            return CallEnd.BY_ITSELF if self.wait(None, done) else CallEnd.STOPPED
        while not self.wait(time.left_s(limit_s), done):
            if not time.left_s(limit_s):
                return CallEnd.OVERRUN
            if self.reason is not None:
                return CallEnd.STOPPED
        return CallEnd.BY_ITSELF

    def __reduce__(self) -> Tuple[Type['Scope'], Tuple[()]]:
        """Nothing that is under way travels with a copied or pickled machine."""
        return Scope, ()


class Waiting:
    """Waits of an oracle before it goes on. Derive from it to have the time pass otherwise."""

    def wait(self, seconds: float, what: str, scope: Scope) -> None:
        """Wait so many seconds, or until `scope` is cancelled, in the machine's thread.

        :param what: takes the time, as records of it add it up.
        """
        scope.wait(seconds)


# -- executions of states whose time is watched, as the machines see them that run inside

_AROUND: 'contextvars.ContextVar[Tuple[Scope, ...]]' = contextvars.ContextVar(
    'smach_oracle_scopes', default=()
)


def scopes_of_thread() -> Tuple[Scope, ...]:
    """Return the scopes inside which this thread runs, the innermost last."""
    return _AROUND.get()


@contextlib.contextmanager
def inside(scope: Scope) -> Iterator[None]:
    """Be inside `scope` within it, in the caller's own thread."""
    token = _AROUND.set(_AROUND.get() + (scope,))
    try:
        yield
    finally:
        _AROUND.reset(token)


@contextlib.contextmanager
def standing_still(scopes: Iterable[Scope]) -> Iterator[None]:
    """Let the time of several scopes stand still."""
    with contextlib.ExitStack() as stack:
        for each in scopes:
            if each.time is not None:
                stack.enter_context(each.time.paused())
        yield
