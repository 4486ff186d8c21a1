"""Faults: what goes wrong in which state, at which of its visits."""

import math
from enum import Enum
from typing import Any, Iterable, Mapping, NamedTuple, Optional, Tuple, Union

from .errors import FaultError

Visits = Union[int, Iterable[int], None]


class FaultKind(str, Enum):
    """The ways in which a state goes wrong."""

    OUTCOME = 'outcome'  # it ends in a given outcome without doing anything
    EXCEPTION = 'exception'  # it raises
    HANG = 'hang'  # it does not end
    OVERRUN = 'overrun'  # it takes longer


class Fault(NamedTuple):
    """One fault of one state. `fail`, `crash`, `hang` and `overrun` make it."""

    state: str  # LABEL or PATH/LABEL
    kind: FaultKind
    visits: Tuple[int, ...] = ()  # (): every visit
    probability: float = 1.0  # at each of these visits
    seed: int = 0  # of the probability
    outcome: str = ''  # OUTCOME. '' means the one that is named like a failure
    outputs: Optional[Mapping[str, Any]] = None  # OUTCOME. By the state's own key names
    error: Optional[BaseException] = None  # EXCEPTION
    ignores_preempt: bool = False  # HANG
    seconds: float = 0.0  # OVERRUN; wall time
    is_stub: bool = False  # it stands for the work of the state, and other faults come first

    def __str__(self) -> str:
        return '{} {} {}'.format(self.state, self.does(), self.when())

    def does(self) -> str:
        """Return what the state does, as the end of a sentence."""
        if self.is_stub:
            return 'stands for its work: ends in {!r}'.format(self.outcome)
        if self.kind is FaultKind.OUTCOME:
            return 'ends in {!r}'.format(self.outcome) if self.outcome else 'fails'
        if self.kind is FaultKind.EXCEPTION:
            return 'raises {!r}'.format(self.error)
        if self.kind is FaultKind.HANG:
            return 'hangs for good' if self.ignores_preempt else 'hangs until it is preempted'
        return 'takes {:g} s longer'.format(self.seconds)

    def when(self) -> str:
        """Return at which visits, as the end of a sentence."""
        visits = 'at every visit'
        if self.visits:
            visits = 'at visit {}'.format(', '.join(map(str, self.visits)))
        if self.probability < 1.0:
            return '{} with probability {:g}'.format(visits, self.probability)
        return visits


def fail(
    state: str,
    *,
    visit: Visits = None,
    outcome: str = '',
    outputs: Optional[Mapping[str, Any]] = None,
    probability: float = 1.0,
    seed: int = 0,
) -> Fault:
    """Let a state end in an outcome without doing anything.

    :param state: LABEL or PATH/LABEL, the path relative to the top machine.
    :param visit: the number of a visit, from 1, or several. None means every visit.
    :param outcome: one that the state has registered. '' means the one that is named like a
        failure.
    :param outputs: written to the userdata, by the state's own key names.
    :param probability: that it happens at each of these visits, drawn with `seed`.
    :raises FaultError: for a visit below 1 or a probability outside 0 to 1.
    """
    __tracebackhide__ = True
    return _checked(
        Fault(state, FaultKind.OUTCOME, _visits(state, visit), probability, seed, outcome, outputs)
    )


def stub(state: str, outcome: str = 'succeeded', **userdata: Any) -> Fault:
    """Let a state end in an outcome without its work, at each visit: for states that need a robot.

    Other faults of the state come first. `assert_all_faults_happened` asks nothing of it.

    :param state: LABEL or PATH/LABEL, the path relative to the top machine.
    :param outcome: one that the state has registered.
    :param userdata: written to the userdata, by the state's own key names.
    """
    return Fault(state, FaultKind.OUTCOME, outcome=outcome, outputs=userdata, is_stub=True)


def crash(
    state: str,
    *,
    visit: Visits = None,
    error: Optional[BaseException] = None,
    probability: float = 1.0,
    seed: int = 0,
) -> Fault:
    """Let a state raise an exception (default: a RuntimeError). For the rest see `fail`.

    :raises FaultError: for a visit below 1 or a probability outside 0 to 1.
    """
    __tracebackhide__ = True
    given = RuntimeError('a fault of this test') if error is None else error
    return _checked(
        Fault(state, FaultKind.EXCEPTION, _visits(state, visit), probability, seed, error=given)
    )


def hang(
    state: str,
    *,
    visit: Visits = None,
    for_good: bool = False,
    probability: float = 1.0,
    seed: int = 0,
) -> Fault:
    """Let a state wait until it is preempted. For the rest see `fail`.

    :param for_good: it ignores a preempt too. The end of the trial lets it go.
    :raises FaultError: for a visit below 1 or a probability outside 0 to 1.
    """
    __tracebackhide__ = True
    return _checked(
        Fault(
            state,
            FaultKind.HANG,
            _visits(state, visit),
            probability,
            seed,
            ignores_preempt=for_good,
        )
    )


def overrun(
    state: str, seconds: float, *, visit: Visits = None, probability: float = 1.0, seed: int = 0
) -> Fault:
    """Let a state take so many seconds of wall time longer. For the rest see `fail`.

    It waits first, and does its work then. A preempt ends the wait, and the state does nothing.

    :raises FaultError: for a visit below 1, a probability outside 0 to 1, or a time below 0.
    """
    __tracebackhide__ = True
    if not (isinstance(seconds, (int, float)) and 0 <= seconds < math.inf):
        raise FaultError(
            'a fault of {}: {!r} s is not a time; give seconds from 0'.format(state, seconds)
        )
    return _checked(
        Fault(
            state,
            FaultKind.OVERRUN,
            _visits(state, visit),
            probability,
            seed,
            seconds=float(seconds),
        )
    )


def _visits(state: str, visit: Visits) -> Tuple[int, ...]:
    __tracebackhide__ = True
    if visit is None:
        return ()
    given = (visit,) if isinstance(visit, int) else tuple(visit)
    wrong = [
        each for each in given if not isinstance(each, int) or isinstance(each, bool) or each < 1
    ]
    if wrong or not given:
        raise FaultError(
            'a fault of {}: visit {} is not there; the first visit is 1'.format(
                state, ', '.join(map(repr, wrong)) or '()'
            )
        )
    return given


def _checked(fault: Fault) -> Fault:
    __tracebackhide__ = True
    if not (isinstance(fault.probability, (int, float)) and 0 <= fault.probability <= 1):
        raise FaultError(
            'a fault of {}: probability {!r} is not within 0 to 1'.format(
                fault.state, fault.probability
            )
        )
    return fault
