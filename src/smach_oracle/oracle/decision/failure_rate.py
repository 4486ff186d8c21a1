"""Failure rates of states, learned with a limited memory (paper, IV-A, IV-C). Pure.

The estimate starts as the designer's prior. Every result pushes one share of the prior out, and
once the memory is full only the latest results count. Two estimators share one face: a window and
an exponentially weighted mean.
"""

from collections import deque
from enum import IntEnum
from typing import Any, Callable, Deque, Dict, List, Mapping, Tuple, Union

from ..errors import SettingsError
from ..number_checks import is_number, is_whole

Snapshot = Dict[str, object]  # what an estimator has learned, as plain data
Learned = Mapping[str, Any]  # a snapshot that somebody else has made
_ROUNDING = 1e-9  # a rate that equals a threshold except for binary rounding has reached it


class FailureClass(IntEnum):
    """The class of a state by its failure rate. The numbers are those of OracleEvent.msg."""

    NO_CLASS = 0
    LOW = 1
    MODERATE = 2
    HIGH = 3


def classify(rate: float, moderate_from: float, high_from: float) -> FailureClass:
    """Return the class of a failure rate, 0 to 1.

    LOW below `moderate_from`, HIGH from `high_from` on, MODERATE between.
    """
    if rate + _ROUNDING >= high_from:
        return FailureClass.HIGH
    if rate + _ROUNDING >= moderate_from:
        return FailureClass.MODERATE
    return FailureClass.LOW


class _Totals:
    """What both estimators keep: their memory and prior, and the counts of all results."""

    kind = ''

    def __init__(self, memory: int, prior: float) -> None:
        """`memory`: results. `prior`: failure rate, 0 to 1.

        :raises SettingsError: for a memory or prior that is not allowed.
        """
        if not is_whole(memory, 1):
            raise SettingsError('memory', memory, 'a whole number of results from 1')
        if not is_number(prior, 0, 1):
            raise SettingsError('prior', prior, 'a failure rate from 0 to 1')
        self.memory = memory
        self.prior = float(prior)
        self.successes = 0
        self.failures = 0

    def _told(self) -> Snapshot:
        counts = {'successes': self.successes, 'failures': self.failures}
        return {'estimator': self.kind, **counts}


class FailureRate(_Totals):
    """The failure rate of a state over its last results.

    The window holds the last `memory` results. It starts filled with `prior`.

    rate = (failures in the window + prior * (memory - n)) / memory, with n results seen and n <
    memory. `successes` and `failures` count all results ever added.

    >>> from smach_oracle.oracle import FailureRate
    >>> rate = FailureRate(memory=4, prior=0.2)
    >>> for failed in (True, False, False):
    ...     rate.add(failed)
    >>> round(rate.rate, 2), rate.successes, rate.failures
    (0.3, 2, 1)
    """

    kind = 'window'

    def __init__(self, memory: int, prior: float) -> None:
        super().__init__(memory, prior)
        self._results = 0  # results seen, not the totals where these were taken over from elsewhere
        self._failed: Deque[int] = deque()  # which of them were failures, of the last memory + 1

    def add(self, failed: bool) -> None:
        """Learn one result, in O(1)."""
        if failed:
            self._forget(self._results - self.memory)
            self._failed.append(self._results)
            self._results += 1
            self.failures += 1
        else:
            self.add_successes(1)

    def add_successes(self, count: int) -> None:
        """Learn `count` successes in a row. O(1), as each failure is forgotten once."""
        self._results += count
        self.successes += count
        self._forget(self._results - self.memory - 1)

    def take_back_failure(self) -> None:
        """Unlearn the latest result, which must have been a failure, in O(1)."""
        if self._failed:  # else the results of others have pushed it out, who share the rate
            self._failed.pop()
            self._results -= 1
        self.failures -= 1

    def _forget(self, before: int) -> None:
        """Drop what is too old to count.

        One result more than `memory` stays, so that one can be taken back.
        """
        while self._failed and self._failed[0] < before:
            self._failed.popleft()

    @property
    def rate(self) -> float:
        """Return the failure rate, 0 to 1."""
        failures, results = self.recent
        return (failures + self.prior * (self.memory - results)) / self.memory

    @property
    def recent(self) -> Tuple[int, int]:
        """Return the number of failures among the latest results, and of those results, in O(1)."""
        failures = len(self._failed)
        if failures and self._failed[0] < self._results - self.memory:
            failures -= 1
        return failures, min(self.memory, self._results)

    def snapshot(self) -> Snapshot:
        """Return what was learned as plain data, for `restore` and the rates file.

        The newest result is the last one.
        """
        oldest = max(0, self._results - self.memory)
        window = [0] * (self._results - oldest)
        for position in self._failed:
            if position >= oldest:
                window[position - oldest] = 1
        return dict(self._told(), window=window)

    def restore(self, learned: Learned) -> None:
        """Take over a `snapshot`, also one made with another memory: its newest results count.

        A snapshot of the other estimator gives the totals alone.

        :raises ValueError: where it is no snapshot.
        """
        successes, failures = _totals(learned)
        window = _window(learned) if learned.get('estimator') == self.kind else []
        window = window[-self.memory :]
        self.successes, self.failures = successes, failures
        self._results = len(window)
        self._failed = deque(position for position, failed in enumerate(window) if failed)


class ExponentialFailureRate(_Totals):
    """The exponentially weighted mean of a state's results, beginning with the prior.

    Each result replaces a share 1/memory of the estimate.

    It agrees with `FailureRate` on the first result and forgets gradually instead of all at once.

    >>> from smach_oracle.oracle import ExponentialFailureRate
    >>> rate = ExponentialFailureRate(memory=4, prior=0.2)
    >>> for failed in (True, False, False):
    ...     rate.add(failed)
    >>> round(rate.rate, 3)
    0.225
    """

    kind = 'exponential'

    def __init__(self, memory: int, prior: float) -> None:
        super().__init__(memory, prior)
        self._rate = self._before = self.prior

    def add(self, failed: bool) -> None:
        """Learn one result, in O(1)."""
        self._before = self._rate
        self._rate += (float(failed) - self._rate) / self.memory
        if failed:
            self.failures += 1
        else:
            self.successes += 1

    def add_successes(self, count: int) -> None:
        """Learn `count` successes in a row, in O(1)."""
        self._rate *= (1.0 - 1.0 / self.memory) ** count
        self.successes += count

    def take_back_failure(self) -> None:
        """Unlearn the latest result, which must have been a failure."""
        self._rate = self._before
        self.failures -= 1

    @property
    def rate(self) -> float:
        """Return the failure rate, 0 to 1."""
        return self._rate

    @property
    def recent(self) -> Tuple[int, int]:
        """Return 0, 0: it does not know single results."""
        return 0, 0

    def snapshot(self) -> Snapshot:
        """Return what was learned as plain data, for `restore` and the rates file."""
        return dict(self._told(), rate=self._rate)

    def restore(self, learned: Learned) -> None:
        """Take over a `snapshot`. One of the other estimator gives the totals alone.

        :raises ValueError: where it is no snapshot.
        """
        successes, failures = _totals(learned)
        is_own = learned.get('estimator') == self.kind
        rate = _rate(learned, self.prior) if is_own else self.prior
        self.successes, self.failures, self._rate = successes, failures, rate
        if self.memory > 1:  # as it was if the latest result was a failure: no other is taken back
            self._before = max(0.0, (rate * self.memory - 1.0) / (self.memory - 1))


def _totals(learned: Learned) -> Tuple[int, int]:
    totals = (learned.get('successes', 0), learned.get('failures', 0))
    successes, failures = map(_whole, totals)
    if not (is_whole(successes, 0) and is_whole(failures, 0)):
        raise ValueError('successes, failures: {!r} are not counts'.format(totals))
    return successes, failures


def _whole(total: Any) -> Any:
    """Return an int for a whole float, which a program that rewrites a JSON file may make of it."""
    return int(total) if isinstance(total, float) and total.is_integer() else total


def _window(learned: Learned) -> List[int]:
    window = learned.get('window', [])
    if not isinstance(window, list) or any(result not in (0, 1) for result in window):
        raise ValueError('window: {!r} is not a list of 0 and 1'.format(window))
    return window


def _rate(learned: Learned, usual: float) -> float:
    rate = learned.get('rate', usual)
    if not is_number(rate, 0, 1):
        raise ValueError('rate: {!r} is not from 0 to 1'.format(rate))
    return float(rate)


Estimator = Union[FailureRate, ExponentialFailureRate]
ESTIMATORS: Dict[str, Callable[[int, float], Estimator]] = {
    FailureRate.kind: FailureRate,
    ExponentialFailureRate.kind: ExponentialFailureRate,
}


def make_estimator(kind: str, memory: int, prior: float) -> Estimator:
    """Return a new estimator named 'window' or 'exponential'.

    :raises SettingsError: for a memory or prior that is not allowed.
    """
    if kind not in ESTIMATORS:
        raise SettingsError('estimator', kind, ', '.join(sorted(ESTIMATORS)))
    return ESTIMATORS[kind](memory, prior)


# -- what two machines have learned of one state, merged


def base_of(learned: Learned) -> Snapshot:
    """Return what `merged` has to know of a snapshot, to tell later what is new since then."""
    return {
        key: learned[key]
        for key in ('estimator', 'successes', 'failures', 'rate', 'ways_total')
        if key in learned
    }


def merged(own: Learned, base: Learned, theirs: Learned, memory: int) -> Snapshot:
    """Return what others have learned, and behind it what is new of our own since `base`.

    A failure that was taken back since then is taken out.

    :raises ValueError: where `theirs` is no snapshot.
    """
    try:
        return _merged(own, base, theirs, memory)
    except (TypeError, AttributeError, LookupError) as err:
        raise ValueError('{!r} is not what was learned of a state'.format(theirs)) from err


def _merged(own: Learned, base: Learned, theirs: Learned, memory: int) -> Snapshot:
    shared_successes, shared_failures = _totals(base)
    successes, failures = own['successes'] - shared_successes, own['failures'] - shared_failures
    if base and base == base_of(theirs):
        return dict(own)
    their_successes, their_failures = _totals(theirs)
    result = dict(
        own,
        successes=max(0, their_successes + successes),
        failures=max(0, their_failures + failures),
    )
    if theirs['estimator'] != own['estimator']:
        return result
    new = max(0, successes) + max(0, failures)
    if 'window' in own:
        result['window'] = (
            _without([*_window(theirs)], -failures) + _latest(own['window'], new, failures)
        )[-memory:]
    else:
        left = (1.0 - 1.0 / memory) ** new
        theirs_since = _rate(theirs, own['rate']) - base.get('rate', own['rate'])
        rate = own['rate'] + left * theirs_since
        result['rate'] = min(1.0, max(0.0, rate))
    return result


def _latest(window: List[int], count: int, failures: int) -> List[int]:
    if failures < 0:
        return [0] * count
    return window[-count:] if count else []


def _without(window: List[int], failures: int) -> List[int]:
    """Return the results without the latest of these failures."""
    for _ in range(failures):
        if 1 in window:
            del window[len(window) - 1 - window[::-1].index(1)]
    return window
