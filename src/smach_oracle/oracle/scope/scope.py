"""What may end early: a trial, a container that executes, a recovery, a question.

A scope lies in one scope or in several. It ends early with each of them. `trio.CancelScope` is the
model, in threads: nothing is raised, but each wait in a scope ends when the scope is cancelled, and
who works in it looks at `reason`.
"""

import threading
from enum import Enum
from typing import Any, Callable, Optional, Set, Tuple

from .background_call import BackgroundCall
from .bell import Bell, Bells, Flag
from .clock import Clock, MonotonicClock, PausableClock
from .reason import Reason

# how soon a wait sees a reason of which nobody tells it, such as `smach.is_shutdown`
LOOK_S = 0.05

Look = Callable[[], Optional[Reason]]


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
    """

    def __init__(
        self,
        *around: 'Scope',
        look: Optional[Look] = None,
        clock: Optional[Clock] = None,
    ) -> None:
        self.clock: Clock = clock or (around[0].clock if around else MonotonicClock())
        self._line: Tuple['Scope', ...] = (self,)  # it and all around it
        for each in around:
            self._line += each._line
        self._look = look
        self._cancelled: Optional[Reason] = None
        self._bells = Bells()

    def cancel(self, reason: Reason) -> None:
        """End it early, and wake all that wait in it. A reason that counts more stays."""
        self._cancelled = min(reason, self._cancelled or reason)
        self.wake()

    def renew(self) -> None:
        """Have it go on, as if it had not been cancelled."""
        self._cancelled = None

    def wake(self) -> None:
        """Have all that wait in it look at its reason now."""
        self._bells.ring()

    @property
    def told(self) -> Optional[Reason]:
        """Return why it was cancelled, or one around it, None where it was not."""
        told = None
        for each in self._line:
            reason = each._cancelled
            if reason is not None and (told is None or reason < told):
                told = reason
        return told

    @property
    def reason(self) -> Optional[Reason]:
        """Return why it is to end, None where it may go on. It looks for what nobody tells."""
        reason = self.told
        # a look may be the code of a user: nobody takes it where it cannot count
        if reason is None or reason > Reason.LEFT_BEHIND:
            for each in self._line:
                seen = None if each._look is None else each._look()
                if seen is not None and (reason is None or seen < reason):
                    reason = seen
        return reason

    @property
    def reasons(self) -> Set[Reason]:
        """Return all reasons for which it is to end."""
        found = [each._cancelled for each in self._line]
        found += [each._look() for each in self._line if each._look is not None]
        return {each for each in found if each is not None}

    def wait(self, seconds: Optional[float] = None, until: Optional[Flag] = None) -> bool:
        """Wait until a flag is set, or for so many seconds. A cancel ends it at once.

        :param seconds: at most, None for without end. Without a flag that is a pause.
        :returns: whether the flag is set, or whether the pause is over.
        """
        bell = Bell()
        ends_s = float('inf') if seconds is None else self.clock.now() + seconds
        looks = any(each._look is not None for each in self._line)
        longest_s = LOOK_S if looks else threading.TIMEOUT_MAX
        rung_by = [each._bells for each in self._line]
        if until is not None:
            rung_by.append(until.bells)
        for bells in rung_by:
            bells.add(bell)
        try:
            while True:
                bell.hush()  # before the look: what comes after that rings it again
                if until is not None and until.is_set():
                    return True
                if self.reason is not None:
                    return False
                left_s = ends_s - self.clock.now()
                if left_s <= 0:
                    return until is None
                self.clock.wait(bell, left_s, longest_s, until is None)
        finally:
            for bells in rung_by:
                bells.remove(bell)

    def run(
        self,
        call: BackgroundCall,
        limit_s: Optional[float],
        grace_s: float,
        stop: Callable[[], None],
        time: Optional[PausableClock] = None,
    ) -> CallEnd:
        """Run a call in its thread, and wait for its end.

        Once its time is over, or this scope is cancelled, `stop` is called. The call has a grace
        period then in which to end, and is left to itself after that. Where this thread itself is
        interrupted, as by Ctrl-C, it has none.

        :param limit_s: None for without end.
        :param time: the clock by which the limit goes, which others may pause.
        :returns: how it has ended. `call.left` says whether it has not.
        """
        time = time or PausableClock(self.clock)
        call.start()
        try:
            end = self._wait_for_end(call.done, limit_s, time)
            if end is not CallEnd.BY_ITSELF:
                stop()
        except BaseException:
            stop()
            call.leave()
            raise
        if end is not CallEnd.BY_ITSELF:
            try:
                Scope(clock=self.clock).wait(grace_s, call.done)
            finally:
                call.leave()
        return end

    def _wait_for_end(self, done: Flag, limit_s: Optional[float], time: PausableClock) -> CallEnd:
        while not self.wait(None if limit_s is None else time.left_s(limit_s), done):
            if limit_s is not None and not time.left_s(limit_s):
                return CallEnd.OVERRUN
            if self.reason is not None:
                return CallEnd.STOPPED
        return CallEnd.BY_ITSELF

    def __reduce__(self) -> Tuple[Any, ...]:
        """Nothing that is under way travels with a copied or pickled machine."""
        return Scope, ()
