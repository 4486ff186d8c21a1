"""Watches the robot's health for a whole tree of machines, and gives the one notice about it.

The sources of the health are ports, and functions of the user's own.
"""

import random
import threading
from typing import Callable, List, Optional, Protocol, Sequence, Set, Tuple

import smach
from smach_common.foreign import error_text, repr_of

from ..identity import is_same, name_of
from ..records.events import EventKind
from ..scope.background_call import BackgroundCall
from ..scope.clock import Clock, Flag
from ..scope.scope import Scope
from ..settings.health import HealthCondition, HealthFunction, HealthKind, sources_of

LOOK_PERIOD_S = 0.1  # how often the ports are asked during a wait
# A function knows only how the robot is at this moment. It is asked so often in the settle time,
# at irregular moments, so that a robot that is well at every other moment is not taken as well.
LOOKS_IN_SETTLE_TIME = 50
SHORTEST_LOOK_S = 0.002
FAILED = 'failed'  # what has happened to a state that waits

# a function that takes longer counts as one that says no
FUNCTION_LIMIT_S = 2.0


class HealthPort(Protocol):
    """Knows one thing, or several, that must hold. Called from any thread. It does not wait."""

    def why_unwell(self, since_s: Optional[float]) -> str:
        """Return what is wrong, or was since that monotonic time, '' where all is well."""


class HealthFunctionPort:
    """A function of the user's own, called in a thread that nobody has to wait for.

    Several may ask at once: one call answers them all. What a call says after its limit, or after
    nobody waited for it any more, is dropped: the robot may be otherwise by now.
    """

    def __init__(self, name: str, function: HealthFunction) -> None:
        self._name = name
        self._function = function
        self._call: Optional[BackgroundCall] = None
        self._since_s: float  # of the call

    def why_unwell(self, scope: Scope) -> str:
        """Return what is wrong, '' where all is well, also where `scope` ends the asking."""
        now = scope.clock.now
        call = self._call
        if call is None or call.done.is_set():
            self._since_s = now()
            call = self._call = BackgroundCall(self._function, 'smach_oracle health')
            call.start()
        until_s = self._since_s + FUNCTION_LIMIT_S
        has_returned = scope.wait(until_s - now(), call.done)
        if now() >= until_s:
            why = '{} took too long' if has_returned else '{} does not return'
            return why.format(self._name)
        return self._in_words(call) if has_returned else ''

    def _in_words(self, call: BackgroundCall) -> str:
        if call.error is not None:
            return '{}: {}'.format(self._name, error_text(call.error))
        result = call.result
        if isinstance(result, str):
            return '{}: {}'.format(self._name, result) if result else ''
        if type(result).__name__ in ('bool', 'bool_'):  # numpy's, too
            return '' if result else self._name
        return "{} returned {}; True and '' are well".format(self._name, repr_of(result))


Tell = Callable[..., None]  # tells the observers of a kind of event, with its fields
# makes a port for topics and diagnostics
ListenToHealth = Callable[[Sequence[HealthCondition]], Optional[HealthPort]]


class _UnwellPhase:
    """The time from the first state that waits to the last. `tell` is of the first one."""

    def __init__(self, tell: Tell, place: str, why: str, clock: Clock) -> None:
        self.tell = tell
        self.place = place
        self.why = why
        self.clock = clock
        self.since_s = clock.now()
        self.waiting = 0
        self.states: Set[str] = set()  # paths of the states that wait, or have waited
        self.well_since_s: Optional[float] = None
        self.over = False


class HealthWatch:
    """The health of one tree. Safe to use from several threads.

    `given`: the function that was given to the machine. `listen`: makes a port for topics and
    diagnostics, or None where this process listens to none.
    """

    def __init__(self, given: Optional[HealthFunction]) -> None:
        self.given = given
        self.listen: Optional[ListenToHealth] = None
        self._lock = threading.RLock()
        self._asking = threading.Lock()
        self._asked = Flag()  # by the thread that has asked last
        self._settle_s: float  # in force
        self._functions: List[HealthFunctionPort] = []
        self._listening: Optional[HealthPort] = None
        self._made_of: object = None
        self._phase: Optional[_UnwellPhase] = None

    @property
    def is_set(self) -> bool:
        """Whether anything says how the robot is."""
        return bool(self._functions) or self._listening is not None

    def use(self, conditions: Tuple[HealthCondition, ...], settle_s: float) -> None:
        """Ask these from now on.

        Called before each trial. It costs nothing where nothing is new.
        """
        self._settle_s = settle_s
        made_of = (conditions, self.given, self.listen)
        if is_same(made_of, self._made_of):
            return
        self._made_of = made_of
        functions = [
            HealthFunctionPort(each.name, each.function)
            for each in conditions
            if each.function is not None
        ]
        if self.given is not None:
            functions.append(HealthFunctionPort(name_of(self.given), self.given))
        self._functions = functions
        self._listening = self._listen_to(conditions)

    def _listen_to(self, conditions: Tuple[HealthCondition, ...]) -> Optional[HealthPort]:
        heard = [each for each in conditions if each.kind is not HealthKind.FUNCTION]
        if not heard:
            return None
        if self.listen is None:
            smach.logwarn(
                'healthy: this process is not a ROS node, so {} is not listened to, and '
                'its condition holds'.format(', '.join(sources_of(conditions)))
            )
            return None
        return self.listen(heard)

    def why_unwell(self, scope: Scope, since_s: Optional[float] = None) -> str:
        """Ask once, and return all that is wrong, '' where all is well or `scope` is cancelled.

        :param since_s: from this monotonic time on all must have held, as far as it was heard.
        """
        # one thread asks at a time, and the others have their look a little later
        while not self._asking.acquire(blocking=False):
            self._asked.clear()
            if self._asking.locked() and not scope.wait(until=self._asked):
                return ''
        try:
            wrong = [self._listening.why_unwell(since_s)] if self._listening is not None else []
            wrong += [port.why_unwell(scope) for port in self._functions]
        finally:
            self._asking.release()
            self._asked.set()
        return '; '.join(why for why in wrong if why)

    def unwell_after(self, scope: Scope) -> str:
        """Return why the robot was not well at what has just happened, '' where it was.

        What stops a robot may be heard of after what it has stopped: it is looked again until the
        settle time is over, and once after that. The end of `scope` ends that.
        """
        now = scope.clock.now
        looked_s = now()
        until_s = looked_s + self._settle_s
        while True:
            since_s, looked_s = looked_s, now()
            phase = self._phase
            why = phase.why if phase is not None else self.why_unwell(scope, since_s)
            if why or looked_s >= until_s or scope.reason is not None:
                return why
            scope.wait(max(0.0, min(self._until_next_look_s(), until_s - now())))

    def wait_until_well(self, tell: Tell, place: str, what: str, why: str, scope: Scope) -> bool:
        """Wait until the robot has been well for the settle time.

        The first who waits gives the notice, for the whole tree. It is ended once.

        :param tell: tells the observers of what befalls the state.
        :param place: path of the state.
        :param what: happened to it, or is about to. The log says it.
        :param why: the robot is not well.
        :returns: False where `scope` has ended the wait.
        """
        phase = self._join(tell, place, what, why, scope.clock)
        looked_s = scope.clock.now()
        try:
            while scope.reason is None:
                since_s, looked_s = looked_s, scope.clock.now()
                if self._has_settled(phase, scope, since_s):
                    return True
                scope.wait(
                    self._until_next_look_s() if phase.well_since_s is not None else LOOK_PERIOD_S
                )
            return False
        finally:
            self._leave(phase)

    def _until_next_look_s(self) -> float:
        """Return how long to wait before the next look of several, in which all must hold."""
        if not self._functions:
            return LOOK_PERIOD_S  # what was heard between two looks is known
        mean_s = max(SHORTEST_LOOK_S, self._settle_s / LOOKS_IN_SETTLE_TIME)
        return min(LOOK_PERIOD_S, mean_s) * random.uniform(0.2, 1.8)

    def _join(self, tell: Tell, place: str, what: str, why: str, clock: Clock) -> _UnwellPhase:
        with self._lock:
            phase = self._phase
            is_first = phase is None
            if phase is None:
                phase = self._phase = _UnwellPhase(tell, place, why, clock)
            phase.waiting += 1
            phase.states.add(place)
            if is_first:
                smach.logwarn(
                    '{} {} while the robot is not well ({}): waiting{}'.format(
                        place, what, why, '; no failure is counted' if what == FAILED else ''
                    )
                )
                tell(EventKind.HEALTH_WAIT_START, text=why)
            else:
                smach.loginfo('{} {}; it waits, too'.format(place, what))
        return phase

    def _has_settled(self, phase: _UnwellPhase, scope: Scope, since_s: float) -> bool:
        """Look once. Return whether the phase is over, by this look or another's."""
        why = '' if phase.over else self.why_unwell(scope, since_s)
        with self._lock:
            if phase.over or (not why and scope.reason is not None):
                return phase.over
            now_s = phase.clock.now()
            if why:
                phase.well_since_s = None
                return False
            if phase.well_since_s is None:
                phase.well_since_s = now_s
            if now_s - phase.well_since_s < self._settle_s:
                return False
            self._end(phase, 'well')
            return True

    def _leave(self, phase: _UnwellPhase) -> None:
        with self._lock:
            phase.waiting -= 1
            if not phase.waiting and not phase.over:
                self._end(phase, 'stopped')

    def _end(self, phase: _UnwellPhase, outcome: str) -> None:
        phase.over = True
        self._phase = None
        waited_s = phase.clock.now() - phase.since_s
        text = (
            'the robot is well again after {:.1f} s'
            if outcome == 'well'
            else 'the wait for the robot to be well was ended after {:.1f} s'
        ).format(waited_s)
        smach.loginfo('{}: {}'.format(phase.place, text))
        phase.tell(
            EventKind.HEALTH_WAIT_END,
            outcome=outcome,
            text=text,
            data={'waited_s': round(waited_s, 3), 'states': sorted(phase.states)},
        )
