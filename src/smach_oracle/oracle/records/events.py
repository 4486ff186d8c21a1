"""Events, and how they reach observers (recorder, publisher, checkpoint, viewer).

An observer is a callable that takes one `Event`. It is called in the thread in which the step
happened, in the order of the sequence numbers, before the machine goes on: an observer that blocks
holds the machine back, which is how a recorder loses nothing. An observer that raises does not stop
the machine. The log names it once. It gets the events that follow.

    >>> import smach
    >>> from smach_oracle.oracle import OracleContainer
    >>> sm = smach.StateMachine(['succeeded'])
    >>> with sm:
    ...     _ = smach.StateMachine.add(
    ...         'PICK', smach.CBState(lambda userdata: 'succeeded', outcomes=['succeeded'])
    ...     )
    >>> seen = []
    >>> OracleContainer.wrap(sm).events.observers.append(seen.append)
    >>> sm.execute()
    'succeeded'
    >>> [event.kind.name for event in seen if event.state == 'PICK' and event.outcome]
    ['TRANSITION']
"""

import threading
from enum import IntEnum
from time import time
from types import MethodType
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple, cast

from smach_common.foreign import ends_program, error_text, repr_of

NAN = float('nan')
# Text of the TRIAL_END and CONTAINER_END of an execute() that returned None.
NO_OUTCOME = 'ended without an outcome: inconsistent, or shut down'


class EventKind(IntEnum):
    """The kinds of step. The numbers are those of OracleEvent.msg."""

    TRIAL_START = 1
    TRIAL_END = 2
    CONTAINER_START = 3
    CONTAINER_END = 4
    STATE_START = 5
    TRANSITION = 6
    FAILURE = 7
    PRECONDITION_START = 8
    PRECONDITION_END = 9
    DECISION = 10
    JUMP = 11
    QUERY_OPENED = 12
    QUERY_CLAIMED = 13
    QUERY_RELEASED = 14
    QUERY_ANSWERED = 15
    QUERY_EXPIRED = 16
    QUERY_CANCELLED = 17
    INTERFACE_START = 18
    INTERFACE_END = 19
    SUPERSEDE = 20
    GIVE_UP = 21
    PREEMPT = 22
    WARNING = 23
    HEALTH_WAIT_START = 24
    HEALTH_WAIT_END = 25
    OPERATOR_COMMAND = 26
    HOLD_START = 27
    HOLD_END = 28
    ANNOUNCE = 29
    SENT = 30
    RESUMED = 31


_LAST = EventKind.TRIAL_END


class FailureKind(IntEnum):
    """The kinds of failure of a state. The numbers are those of OracleEvent.msg."""

    NOT_A_FAILURE = 0
    FAILING_OUTCOME = 1
    FELL_THROUGH = 2
    EXCEPTION = 3
    UNREGISTERED_OUTCOME = 4
    TIME_LIMIT = 5
    INTERRUPTED = 8  # the program was stopped while it ran
    # not failures, but causes to ask an expert: of questions alone (ExpertQuery.action)
    HELD_BACK = 6  # it was not executed, since it is not to be repeated
    STILL_RUNNING = 7


class Event(NamedTuple):
    """One step of a trial. The fields are those of OracleEvent.msg."""

    kind: EventKind
    trial_id: str
    seq: int
    wall_time: float  # s since the epoch
    path: str
    state: str = ''
    outcome: str = ''
    target: str = ''
    failure_kind: int = 0
    failure_class: int = 0
    rate: float = NAN
    continuous: bool = False
    query_id: str = ''
    by: str = ''
    text: str = ''
    data: Optional[Mapping[str, Any]] = None  # plain data


def in_event(outcome: Optional[str]) -> str:
    """Return an outcome as an event has it, '' for none. It need not be text."""
    return '' if outcome is None else outcome


_new_tuple = tuple.__new__
# what it holds behind `target` where nothing else is said
_REST = tuple(Event._field_defaults.values())[3:]

Observer = Callable[[Event], None]


class OwnObserver:
    """An observer of this package, or an object whose method is one: what the log calls it."""

    observer_name = 'an observer'
    without_it = 'this event is not told to it'


class EventSource:
    """Numbers the events of one trial after another and hands them to the observers.

    One source serves all containers of a wrapped tree. Emitting is serialised by a lock, so that
    the order in which observers see events is that of their numbers, also from the children of a
    Concurrence.
    """

    def __init__(self, log_error: Callable[[str], None]) -> None:
        self._log_error = log_error
        self._lock = threading.RLock()
        self.observers: List[Observer] = []
        self.begin_trial('')
        self._told: List[Observer] = []  # those that have failed, which the log has named

    def begin_trial(self, trial_id: str, is_silent: bool = False) -> None:
        """Number from 0 again under a new trial id.

        `is_silent`: nothing is told before `emit_first`. An operator may press a button meanwhile.
        """
        with self._lock:
            self.trial_id = trial_id
            self._seq = 0
            self._over = is_silent  # no trial is told of now

    @property
    def last_seq(self) -> int:
        """Return the number of the last event, or -1 before the first."""
        return self._seq - 1

    def go_on_behind(self, seq: int) -> None:
        """Number the coming events of the trial from `seq` + 1."""
        with self._lock:
            self._seq = seq + 1

    def emit_first(self, kind: EventKind, path: str, **more: Any) -> None:
        """Tell every observer that a trial has begun. See `emit`."""
        with self._lock:
            self._over = False
            self.emit(kind, path, **more)

    def emit(
        self,
        kind: EventKind,
        path: str,
        of_trial: Optional[str] = None,
        state: str = '',
        outcome: str = '',
        target: str = '',
        **more: Any,
    ) -> None:
        """Tell every observer. It costs nothing to speak of where there is none.

        What comes after the end of its trial (`of_trial`, None means the present one) is not told.
        `more`: further fields of the event.
        """
        if not self.observers:
            return
        with self._lock:
            if self._over or not (of_trial is None or of_trial == self.trial_id):
                return
            self._over = kind is _LAST
            event: Event
            if more:
                event = Event(
                    kind, self.trial_id, self._seq, time(), path, state, outcome, target, **more
                )
            else:  # twice at each step: in half the time
                event = _new_tuple(
                    Event,
                    (kind, self.trial_id, self._seq, time(), path, state, outcome, target) + _REST,
                )
            self._seq += 1
            for observer in tuple(self.observers):
                try:
                    observer(event)
                except BaseException as err:  # an observer's fault must not stop the robot
                    if ends_program(err):
                        raise
                    self._tell_failed(observer, event, err)

    def _tell_failed(self, observer: Observer, event: Event, err: BaseException) -> None:
        """Log that an observer has failed, the first time that it does."""
        if any(each is observer for each in self._told):
            return
        self._told = [
            each for each in self._told if any(each is other for other in self.observers)
        ] + [observer]
        name, without_it = _in_words(observer)
        self._log_error(
            '{}: {} failed at {} of {}: {}. So {}. The machine goes on. This is said once'.format(
                self.trial_id,
                name,
                event.kind.name,
                '/'.join(filter(None, (event.path, event.state))),
                error_text(err),
                without_it,
            )
        )

    def __getstate__(self) -> Dict[str, object]:
        """Leave out the lock and the observers: neither can travel with a pickled machine."""
        return {'trial_id': self.trial_id, '_seq': self._seq, '_log_error': self._log_error}

    def __setstate__(self, state: Dict[str, object]) -> None:
        self.__dict__.update(state)
        self._over = False
        self._lock = threading.RLock()
        self.observers = []
        self._told = []


def _in_words(observer: Observer) -> Tuple[str, str]:
    """Return what the log calls an observer, and what its failure means for the user."""
    is_method = type(observer) is MethodType
    owner: object = getattr(observer, '__self__', None) if is_method else observer
    if issubclass(type(owner), OwnObserver):  # `isinstance` would ask a property of the user's
        own = cast('OwnObserver', owner)
        return own.observer_name, own.without_it
    return 'the observer {}'.format(repr_of(observer)), 'it has missed this event'
