"""What a streak would come to under another policy, by recorded streaks. Pure.

A decision that could not have been another one tells nothing of other ways. Then there are bounds
alone: the streaks in which the policies part are all cured, or none is. Where ways were drawn, a
streak counts by its weight: the chance of its ways under the other policy, divided by that under
the recorded one (Precup, Sutton and Singh, ICML 2000, the weighted estimator).
"""

import random
from typing import Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

from .streaks import RecordedStreak, StreakEnd, StreakStep

LEAST_EFFECTIVE = 30.0
MOST_OF_ONE = 0.1  # of the sum of the weights
MOST_UNCOVERED = 0.05  # of the streaks
RESAMPLES = 500
FIGURES = StreakEnd._fields

Range = Tuple[float, float]


class Bounds(NamedTuple):
    """What is certain. `streaks`: those whose end is known. `agree`: of them."""

    streaks: int
    agree: float
    left_out: int  # nobody knows how they would have ended
    ranges: Dict[str, Range]  # by figure


class _KnownStreak(NamedTuple):
    """A streak whose end is known."""

    trial: int
    steps: Tuple[StreakStep, ...]
    end: StreakEnd


def _known(streaks: Iterable[RecordedStreak]) -> List[_KnownStreak]:
    return [
        _KnownStreak(each.trial, each.steps, each.end) for each in streaks if each.end is not None
    ]


class Estimate(NamedTuple):
    """What the weighted streaks say. `why_not`: why that is not enough, '' where it is."""

    effective: float
    largest: float  # weight, as a share of their sum
    uncovered: float  # share of streaks in which the other policy goes where none was drawn
    why_not: str
    means: Dict[str, float]
    intervals: Dict[str, Range]  # 95%


def bounds_of(streaks: Sequence[RecordedStreak]) -> Bounds:
    """Return what is certain of a mean streak under the other policy."""
    known = _known(streaks)
    low, high, agree = [0.0] * len(FIGURES), [0.0] * len(FIGURES), 0.0
    for streak in known:
        share = 1.0
        for step in streak.steps:
            parts = 1.0 - step.follows - step.asks
            for one, other, weight in (
                (step.if_asks, step.if_asks, share * step.asks),
                (step.best, step.worst, share * parts),
            ):
                _add(low, map(min, one, other), weight)
                _add(high, map(max, one, other), weight)
            share *= step.follows
        for total in (low, high):
            _add(total, streak.end, share)
        agree += share
    count = max(1, len(known))
    ranges = {name: (one / count, other / count) for name, one, other in zip(FIGURES, low, high)}
    return Bounds(len(known), agree, len(streaks) - len(known), ranges)


def _add(total: List[float], values: Iterable[float], weight: float) -> None:
    for place, value in enumerate(values):
        total[place] += weight * value


class Findings(NamedTuple):
    """What recorded streaks say of another policy. `estimate`: None where no way was drawn."""

    bounds: Bounds
    estimate: Optional[Estimate]


def findings_of(streaks: Sequence[RecordedStreak]) -> Findings:
    """Return the bounds, and what the weighted streaks say."""
    return Findings(bounds_of(streaks), weigh(streaks))


class _Weighted(NamedTuple):
    """The sums of one trial, and the weights of its streaks."""

    sums: Tuple[float, ...]  # of streaks, of the weights, and of each figure by weight
    weights: Tuple[float, ...]


def weigh(streaks: Sequence[RecordedStreak], seed: int = 0) -> Optional[Estimate]:
    """Return what the streaks say of the other policy, None where no decision was drawn.

    Intervals are percentiles of a bootstrap by trial. `seed`: of its draws.
    """
    known = _known(streaks)
    if not any(step.chance < 1.0 for each in known for step in each.steps):
        return None
    uncovered = 0.0
    trials: Dict[int, List[_KnownStreak]] = {}
    for streak in known:
        uncovered += _uncovered(streak)
        trials.setdefault(streak.trial, []).append(streak)
    weighted = [_weighted(each) for each in trials.values()]
    weights = [weight for each in weighted for weight in each.weights]
    total = sum(weights)
    squares = sum(weight * weight for weight in weights)
    effective = total * total / squares if squares else 0.0
    largest = max(weights) / total if total else 0.0
    share = uncovered / len(known)
    why_not = _why_not(effective, largest, share)
    if why_not:
        return Estimate(effective, largest, share, why_not, {}, {})
    rows = [each.sums for each in weighted]
    _, weight, *sums = map(sum, zip(*rows))
    means = dict(zip(FIGURES, (each / weight for each in sums)))
    return Estimate(effective, largest, share, '', means, _intervals(rows, _limits(known), seed))


def _weighted(streaks: Sequence[_KnownStreak]) -> _Weighted:
    sums, weights = [0.0] * (2 + len(FIGURES)), []
    for streak in streaks:
        weight, of_streak = 1.0, 0.0
        for step in streak.steps:
            _add(sums, (0.0, 1.0, *step.if_asks), weight * step.asks)
            of_streak += weight * step.asks
            weight *= step.follows / step.chance
        _add(sums, (0.0, 1.0, *streak.end), weight)
        sums[0] += 1.0
        weights.append(of_streak + weight)
    return _Weighted(tuple(sums), tuple(weights))


def _uncovered(streak: _KnownStreak) -> float:
    weight, found = 1.0, 0.0
    for step in streak.steps:
        found += weight * max(0.0, 1.0 - step.covered)
        weight *= step.follows / step.chance
    return found


def _why_not(effective: float, largest: float, uncovered: float) -> str:
    if uncovered > MOST_UNCOVERED:
        return 'in {:.0%} of the streaks it goes a way that was not to be drawn'.format(uncovered)
    if effective < LEAST_EFFECTIVE:
        return 'an effective {:.0f} streaks agree, {:g} are needed'.format(
            effective, LEAST_EFFECTIVE
        )
    if largest >= MOST_OF_ONE:
        return 'one streak has {:.0%} of the weight, less than {:.0%} is needed'.format(
            largest, MOST_OF_ONE
        )
    return ''


def _limits(streaks: Sequence[_KnownStreak]) -> List[Range]:
    """Return between what a figure may lie of streaks that were not drawn."""
    ends = [
        end
        for streak in streaks
        for end in (
            streak.end,
            *(each for step in streak.steps for each in (step.if_asks, step.best, step.worst)),
        )
    ]
    return [(min(values), max(values)) for values in zip(*ends)]


def _intervals(
    rows: Sequence[Sequence[float]], limits: Sequence[Range], seed: int
) -> Dict[str, Range]:
    """Return intervals of the means.

    The weights of all that may happen add up to the number of streaks. Where they add up to less,
    something rare was not drawn. The rest may then come to anything within the limits.
    """
    generator = random.Random(seed)
    lows: List[List[float]] = [[] for _ in FIGURES]
    highs: List[List[float]] = [[] for _ in FIGURES]
    for _ in range(RESAMPLES):
        count, weight, *sums = map(sum, zip(*generator.choices(rows, k=len(rows))))
        rest = max(0.0, count - weight)
        for place, (value, (least, most)) in enumerate(zip(sums, limits)):
            lows[place].append((value + rest * least) / (weight + rest))
            highs[place].append((value + rest * most) / (weight + rest))
    cut = int(0.025 * RESAMPLES)
    return {
        name: (sorted(low)[cut], sorted(high)[-1 - cut])
        for name, low, high in zip(FIGURES, lows, highs)
    }
