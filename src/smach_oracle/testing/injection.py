"""Puts faults into a machine, and takes them out again. The machine stays what it was.

Each state keeps its object, its class and its place. Only the attribute `execute` of the object
stands before that of its class for a while.
"""

import contextlib
import math
import random
import threading
import time
from typing import Any, Callable, Dict, Iterable, Iterator, List, Optional, Tuple

import smach
from smach_oracle.oracle.settings.failing_outcomes import PREEMPTED, FailingNames

from .errors import FaultError
from .faults import Fault, FaultKind
from .places import StatePlace, did_you_mean, find_place, places_of
from .stopped_clock import StoppedClock

_PERIOD_S = 0.01  # how soon a fault that waits notices a preempt
# told of a place, its visit, what happens (entered, fault, stub, ended, raised), and a text
Report = Callable[[StatePlace, int, str, str], None]
_MISSING = object()


def _tell_nobody(place: StatePlace, visit: int, what: str, text: str) -> None:
    """Stand for a report where nobody wants one."""


class ArmedFault:
    """A fault at its place."""

    def __init__(self, fault: Fault, place: StatePlace, outcome: str) -> None:
        self.fault = fault
        self.place = place
        self.happened = 0  # times
        self._outcome = outcome
        # each place draws on its own, so that the threads of a Concurrence do not mix
        self._random = random.Random('{}/{}'.format(fault.seed, place.path))

    def does(self) -> str:
        """Return what the state does, as the end of a sentence."""
        return self.fault._replace(outcome=self._outcome).does()

    def happens_at(self, visit: int) -> bool:
        """Whether it happens at this visit, to be asked once for each."""
        if self.fault.visits and visit not in self.fault.visits:
            return False
        return self.fault.probability >= 1.0 or self._random.random() < self.fault.probability

    def strike(self, userdata: Any, wait: 'FaultWait', work: Callable[[], object]) -> object:
        """Go wrong in place of the state, or before its work.

        It raises what an EXCEPTION fault is to raise.
        """
        self.happened += 1
        fault, state = self.fault, self.place.state
        if fault.kind is FaultKind.OUTCOME:
            for key, value in (fault.outputs or {}).items():
                userdata[key] = value
            return self._outcome
        if fault.error is not None:
            raise fault.error.with_traceback(None)
        if fault.kind is FaultKind.OVERRUN:
            return work() if wait.lasts(state, fault.seconds, True) else _preempted(state)
        wait.lasts(state, math.inf, not fault.ignores_preempt)
        return _preempted(state)


class FaultWait:
    """The waits of faults, until they are taken out of the machine."""

    def __init__(self, clock: Optional[StoppedClock]) -> None:
        """`clock`: by which the time passes. None: it is real time."""
        self.lifted = threading.Event()
        self._pass_some = clock.pass_some if clock is not None else self._really_pass

    def lasts(self, state: smach.State, seconds: float, heeds_preempt: bool) -> bool:
        """Wait in place of a state. Return False where something ended it before."""
        while not self.lifted.is_set() and not smach.is_shutdown():
            if heeds_preempt and state.preempt_requested():
                return False
            if seconds <= 0:
                return True
            seconds -= self._pass_some(seconds)
        return False

    def _really_pass(self, most_s: float) -> float:
        begun_s = time.monotonic()
        self.lifted.wait(min(_PERIOD_S, most_s))
        return time.monotonic() - begun_s


def _preempted(state: smach.State) -> object:
    """Return how a state ends that was preempted."""
    if state.preempt_requested():
        state.service_preempt()
    outcomes = sorted(state.get_registered_outcomes(), key=str)
    return PREEMPTED if PREEMPTED in outcomes else outcomes[0] if outcomes else None


class Injection:
    """Faults in one machine, from `put_in` until `take_out`."""

    def __init__(
        self,
        machine: smach.StateMachine,
        faults: Iterable[Fault] = (),
        report: Report = _tell_nobody,
        failing: Optional[FailingNames] = None,
        clock: Optional[StoppedClock] = None,
    ) -> None:
        """Find the places of the faults. Nothing is changed yet.

        :param clock: by which faults wait. None: they wait in real time.
        :raises FaultError: where a state is not there, or has not registered an outcome.
        """
        __tracebackhide__ = True
        self._places = places_of(machine)
        self._failing = FailingNames() if failing is None else failing
        self.armed: List[ArmedFault] = []
        for fault in faults:
            self.armed.append(self._armed(fault))
        self.armed.sort(key=lambda armed: armed.fault.is_stub)  # the others come first
        self._report = report
        self._wait = FaultWait(clock)
        self._lock = threading.Lock()
        self._visits: Dict[str, int] = {}
        self._changed: List[Tuple[smach.State, object]] = []  # and what stood there before

    def _armed(self, fault: Fault) -> ArmedFault:
        __tracebackhide__ = True
        if not isinstance(fault, Fault):
            raise FaultError(
                '{!r} is not a fault; make one with fail, crash, hang, overrun or stub'.format(
                    fault
                )
            )
        place = find_place(self._places, fault.state, 'a fault')
        return ArmedFault(fault, place, self._outcome(fault, place))

    def _outcome(self, fault: Fault, place: StatePlace) -> str:
        __tracebackhide__ = True
        if fault.kind is not FaultKind.OUTCOME:
            return ''
        outcomes = sorted(place.state.get_registered_outcomes(), key=str)
        if fault.outcome in outcomes:
            return fault.outcome
        named = [outcome for outcome in outcomes if outcome in self._failing]
        if not fault.outcome and len(named) == 1:
            return named[0]
        what = (
            'has no outcome {!r}'.format(fault.outcome)
            if fault.outcome
            else 'has {} that are named like a failure'.format(
                '{} outcomes'.format(len(named)) if named else 'no outcomes'
            )
        )
        raise FaultError(
            'a fault: {} {}{}; name one of {}'.format(
                place.path,
                what,
                did_you_mean(fault.outcome, outcomes),
                ', '.join(map(repr, outcomes)) or 'none',
            )
        )

    def put_in(self) -> None:
        """Let the faults happen from now on."""
        by_state: Dict[int, List[StatePlace]] = {}
        for place in self._places:
            by_state.setdefault(id(place.state), []).append(place)
        for places in by_state.values():
            state = places[0].state
            before = vars(state).get('execute', _MISSING)
            self._changed.append((state, before))
            vars(state)['execute'] = self._execute_for(places, before)

    def take_out(self) -> None:
        """Put everything back, and let go of what hangs."""
        self._wait.lifted.set()
        for state, before in reversed(self._changed):
            if before is _MISSING:
                vars(state).pop('execute', None)
            else:
                vars(state)['execute'] = before
        self._changed.clear()

    def _execute_for(self, places: List[StatePlace], before: Any) -> Callable[..., object]:
        """Return what stands for the method `execute` of a state."""
        state = places[0].state

        def execute(*args: Any, **kwargs: Any) -> object:
            def work() -> object:
                if before is not _MISSING:
                    return before(*args, **kwargs)
                # looked up only now: wrapping may have changed the class of a nested machine
                return type(state).execute(state, *args, **kwargs)

            place = next((each for each in places if each.visited_now()), None)
            if place is None or self._wait.lifted.is_set():
                return work()
            return self._visit(place, args[0] if args else kwargs.get('parent_ud'), work)

        return execute

    def _visit(self, place: StatePlace, userdata: Any, work: Callable[[], object]) -> object:
        with self._lock:
            visit = self._visits[place.path] = self._visits.get(place.path, 0) + 1
            # each fault of the place is asked, also where another comes first: draws stay the same
            due = [
                armed
                for armed in self.armed
                if armed.place.path == place.path and armed.happens_at(visit)
            ]
        self._report(place, visit, 'entered', '')
        try:
            if due:
                self._report(
                    place, visit, 'stub' if due[0].fault.is_stub else 'fault', due[0].does()
                )
                outcome = due[0].strike(userdata, self._wait, work)
            else:
                outcome = work()
        except BaseException as err:
            self._report(place, visit, 'raised', '{}: {}'.format(type(err).__name__, err))
            raise
        self._report(place, visit, 'ended', str(outcome))
        return outcome


@contextlib.contextmanager
def faults(machine: smach.StateMachine, given: Iterable[Fault]) -> Iterator[Injection]:
    """Let faults happen in a machine, plain or wrapped, within a `with` block.

    Visits are counted from the beginning of the block. The machine is restored at its end, and a
    state that hangs is let go.

    >>> import smach
    >>> from smach_oracle.testing import fail, faults
    >>> pick = smach.CBState(lambda userdata: 'succeeded', outcomes=['succeeded', 'aborted'])
    >>> sm = smach.StateMachine(['succeeded', 'aborted'])
    >>> with sm:
    ...     _ = smach.StateMachine.add('PICK', pick)
    >>> with faults(sm, [fail('PICK')]):
    ...     sm.execute()
    'aborted'

    :raises FaultError: where a state is not there, or has not registered an outcome. Nothing has
        been changed then.
    """
    __tracebackhide__ = True
    injection = Injection(machine, given)
    injection.put_in()
    try:
        yield injection
    finally:
        injection.take_out()
