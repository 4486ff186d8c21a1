"""The failure rates that an oracle has learned, after each trial. Pure."""

from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.decision.failure_rate import FailureClass, classify, make_estimator
from smach_oracle.oracle.errors import OracleError
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind

from ..replaying.checks import beginnings, that_count
from ..replaying.followed import Key, key_of
from ..replaying.replay import Replay

LEARNED = 'learned'  # key in the data of TRIAL_END
_ROUNDING = 1e-6
_THRESHOLDS = ('moderate_from', 'high_from')


class Bands(NamedTuple):
    """The failure rates from which a state's class is MODERATE, and HIGH."""

    moderate_from: float
    high_from: float

    def class_of(self, rate: float) -> str:
        """Return the name of the class."""
        return FailureClass(classify(rate, self.moderate_from, self.high_from)).name


class StateRates(NamedTuple):
    """The rates of one state after trials."""

    state: str  # path
    points: Tuple[Tuple[int, float], ...]  # number of the trial, from 1, and the rate
    failures: int  # in these trials


class LearnedRates(NamedTuple):
    """The rates of one oracle."""

    states: List[StateRates]  # those that failed most first
    trials: int
    bands: Optional[Bands]  # None: not recorded
    has_gaps: bool  # the rates are known after failures alone
    settings_differ: bool  # of single states: their classes may have other bounds


def bands_of(settings: Mapping[str, Any]) -> Optional[Bands]:
    """Return the bands, None where the settings do not tell them."""
    found = [settings.get(name) for name in _THRESHOLDS]
    shares = [float(each) for each in found if isinstance(each, (int, float)) and 0 <= each <= 1]
    return Bands(*shares) if len(shares) == len(_THRESHOLDS) else None


def learned_rates(
    trials: Sequence[Sequence[Event]], settings: Mapping[str, Any]
) -> Optional[LearnedRates]:
    """Return the rates of the states that have failed. None where no rate is known.

    A rate is what the record of the trial's end tells, else that of the estimator that has seen the
    same results. Where that one does not reproduce the recorded rates, it is the last one that is
    recorded.

    :param trials: of one replicate, in their order, each in the order of its events.
    :param settings: of the oracle.
    """
    replay, starts = _replay_of(settings), _starts(trials, settings)
    points: Dict[Key, List[Tuple[int, float]]] = {}
    failures: Dict[Key, int] = {}
    is_replayed, has_gaps, differ = replay is not None, False, False
    for number, trial in enumerate(trials, 1):
        rates: Dict[Key, float] = {}
        if number - 1 in starts:
            replay = _replay_of(settings)
        for event in that_count(trial):
            key = key_of(event)
            if event.kind == EventKind.FAILURE and event.failure_kind != FailureKind.INTERRUPTED:
                failures[key] = failures.get(key, 0) + 1
            if event.kind in (EventKind.FAILURE, EventKind.DECISION) and 0 <= event.rate <= 1:
                is_replayed = is_replayed and _agrees(replay, event)
                rates[key] = event.rate
                differ = differ or _differs(event, settings)
            if replay is not None and is_replayed:
                is_replayed = _follow(replay, event)
        told = _told(trial, settings)
        if told:
            rates = told
        elif replay is not None and is_replayed:
            rates = _rates_of(replay.learned(), settings)
        else:
            has_gaps = True
        for key, rate in rates.items():
            points.setdefault(key, []).append((number, rate))
    found = [
        StateRates('/'.join(key), tuple(points[key]), count)
        for key, count in failures.items()
        if points.get(key)
    ]
    if not found:
        return None
    return LearnedRates(
        sorted(found, key=lambda each: (-each.failures, each.state)),
        len(trials),
        bands_of(settings),
        has_gaps,
        differ,
    )


def _replay_of(settings: Mapping[str, Any]) -> Optional[Replay]:
    try:
        return Replay(settings, {})
    except (OracleError, KeyError, TypeError, ValueError):
        return None  # a later version has recorded it, or settings are not told


def _starts(trials: Sequence[Sequence[Event]], settings: Mapping[str, Any]) -> List[int]:
    """Return the numbers of trials that began with nothing learned, as far as the rates tell it."""
    try:
        return beginnings(trials, lambda: Replay(settings, {}))
    except (OracleError, LookupError, TypeError, ValueError):
        return []  # _agrees() finds where the rates are other ones


def _agrees(replay: Optional[Replay], event: Event) -> bool:
    """Whether the rate before a failure is the recorded one."""
    if replay is None or event.kind != EventKind.FAILURE:
        return replay is not None
    return abs(replay.rate(event) - event.rate) <= _ROUNDING


def _follow(replay: Replay, event: Event) -> bool:
    try:
        replay.take(event)
    except (OracleError, LookupError, TypeError, ValueError):
        return False  # the record lacks events, or is no record of an oracle
    return True


def _differs(event: Event, settings: Mapping[str, Any]) -> bool:
    """Whether the class of a state is another one than by the settings of its machine."""
    bands = bands_of(settings)
    if bands is None or event.kind != EventKind.DECISION or not event.failure_class:
        return False
    return classify(event.rate, *bands) != event.failure_class


def _told(trial: Sequence[Event], settings: Mapping[str, Any]) -> Dict[Key, float]:
    """Return the rates that the end of a trial tells."""
    for event in reversed(trial):
        if event.kind == EventKind.TRIAL_END:
            learned = event.data.get(LEARNED) if isinstance(event.data, Mapping) else None
            if not isinstance(learned, Mapping):
                return {}
            return _rates_of(
                {
                    ('/'.join(filter(None, (event.path, str(below)))), str(state)): snapshot
                    for below, states in learned.items()
                    if isinstance(states, Mapping)
                    for state, snapshot in states.items()
                },
                settings,
            )
    return {}


def _rates_of(learned: Mapping[Key, Any], settings: Mapping[str, Any]) -> Dict[Key, float]:
    """Return the rates of snapshots. Those that are not sound are left out."""
    rates = {}
    for key, snapshot in learned.items():
        try:
            estimator = make_estimator(settings['estimator'], settings['memory'], settings['prior'])
            if snapshot['estimator'] != settings['estimator']:
                continue
            estimator.restore(snapshot)
        except (OracleError, LookupError, TypeError, ValueError, AttributeError):
            continue
        rates[key] = estimator.rate
    return rates
