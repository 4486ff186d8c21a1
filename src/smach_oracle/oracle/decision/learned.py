"""The order of ways, learned from what they have led to. Pure.

doc/ways.md says what is counted, and when a way is moved to the front.
"""

import math
import random
from typing import Dict, List, NamedTuple, Sequence, Tuple

from .by_ways import Escalating, keyed_ways
from .policy import Situation
from .ways import BY_PERSON, FIRST, LATER, ChosenOrder, Count, Evidence, Way, WayResult

HALF_LIFE = 30.0  # streaks of the state, after which a result counts half
PRIOR = 0.35  # chance to help of a way of which nothing is known
WEIGHT = 2.0  # results, for which the level above a count stands
OVERLAP = 0.5  # share of what the first way cures that another one would have cured, too
FEWEST = 5  # results of a way that is moved
CERTAIN = 0.9  # chance of being cheaper, from which on a way is moved
DRAWS = 200
# standard errors below what was expected. It is looked at after each result: so 2 to 5% of ways
# that help just as expected are given up within a hundred results
DISAPPOINTS = 3.0
FALLS_BACK = (
    'the ways that were learned to be better have helped {} of {} times, and {:.1f} were expected. '
    "The oracle goes by the menu's own order from now on"
)

_NOTHING: Count = (0.0, 0.0)


class Chance(NamedTuple):
    """A Beta distribution of a chance to help."""

    helped: float
    not_helped: float

    @property
    def mean(self) -> float:
        """Return its mean."""
        return self.helped / (self.helped + self.not_helped)


def _shrunk(count: Count, towards: float) -> Chance:
    return Chance(count[0] + WEIGHT * towards, count[1] + WEIGHT * (1.0 - towards))


class Estimates:
    """The chances of the ways on from one failure, by what is known of them.

    The counts of a kind of failure are shrunk towards those of the state, and these towards those
    of the same kind of way in the whole machine. A first way of a streak and a later one are
    counted apart, as a later one meets only what the earlier ones have not cured. Where a way has
    results at one place alone, its chance at the other one follows from them.
    """

    def __init__(self, evidence: Evidence, usual: Way) -> None:
        """`usual`: the way that comes first in the menu's own order."""
        self._of_kinds = evidence.of_kinds
        self._usual = usual
        self._of_state: Dict[Tuple[str, int], Count] = {}  # weighted by their age, as the next one
        self._of_failure: Dict[Tuple[str, int], Count] = {}
        self._minutes: Dict[str, Count] = {}  # sum and number
        self.results: Dict[str, int] = {}  # known ones, by way
        self._known: Dict[Tuple[str, int], Chance] = {}
        self._count(evidence)

    def _count(self, evidence: Evidence) -> None:
        """Count all results, the latest first. It is done at each decision, so it is one loop."""
        minutes, results = self._minutes, self.results
        of_state, of_failure, age, weight = self._of_state, self._of_failure, 0.0, 1.0
        for way, _, place, failure, helped, took, _ in reversed(evidence.results):
            if place != BY_PERSON:
                total, number = minutes.get(way, _NOTHING)
                minutes[way] = total + weight * took, number + weight
                if helped is not None:
                    results[way] = results.get(way, 0) + 1
                    key, is_same = (way, place), failure == evidence.failure
                    for counts in (of_state, of_failure) if is_same else (of_state,):
                        has, has_not = counts.get(key, _NOTHING)
                        counts[key] = (has + weight, has_not) if helped else (has, has_not + weight)
            if place == FIRST:
                age += 1.0
                weight = 0.5 ** (age / HALF_LIFE)

    def minutes(self, way: Way) -> float:
        """Return how long a way takes, by the menu and by its results."""
        total, number = self._minutes.get(way.key, _NOTHING)
        return (way.minutes + total) / (1.0 + number)

    def chance(self, way: Way, place: int) -> Chance:
        """Return the chance of a way to help at a place of the streak."""
        key = way.key, place
        if key not in self._known:
            of_state = _shrunk(self._of_state.get(key, _NOTHING), self._above(way, place)).mean
            self._known[key] = _shrunk(self._of_failure.get(key, _NOTHING), of_state)
        return self._known[key]

    def _above(self, way: Way, place: int) -> float:
        """Return what the counts of the state are shrunk towards."""
        other = LATER if place == FIRST else FIRST
        if (way.key, place) not in self._of_state and (way.key, other) in self._of_state:
            mean = self.chance(way, other).mean
            if place == LATER:
                return mean * (1.0 - OVERLAP)
            usual = self.chance(self._usual, FIRST).mean if way.key != self._usual.key else 0.0
            return mean * (1.0 - usual) + OVERLAP * usual
        return _shrunk(self._of_kinds.get((way.kind.value, place), _NOTHING), PRIOR).mean


class Learned(Escalating):
    """Goes the ways of `escalating`, with one way before its turn where that has helped.

    It moves at most one way of a streak, and only where it is cheaper with a chance of 0.9 by at
    least five results. doc/ways.md says how it counts.
    """

    name = 'learned'
    learns = True

    def order(self, situation: Situation) -> Tuple[Way, ...]:
        """Return the ways that are open, untried and pay, in the order that was learned."""
        return self._learned(situation).ways

    def choose(self, situation: Situation) -> ChosenOrder:
        """Return that order, and what it hopes for where a way has come before its turn."""
        return self._explored(self._learned(situation), situation)

    def _learned(self, situation: Situation) -> ChosenOrder:
        usual = ChosenOrder(self._usual(situation))
        results = situation.menu.evidence.results
        if len(usual.ways) < 2 or len(results) < FEWEST or situation.menu.streak.moved:
            return usual
        remark = _why_back(results)
        if remark:
            return usual._replace(remark=remark)
        return self._moved(usual, situation)

    def _usual(self, situation: Situation) -> Tuple[Way, ...]:
        """Return the order of the menu, in which a way that was moved is still to come."""
        streak = situation.menu.streak
        if not streak.moved:
            return super().order(situation)
        tried = tuple(each for each in streak.tried if each != streak.moved)
        before = streak._replace(tried=tried, attempts=streak.attempts - 1)
        past = situation.past._replace(attempts=situation.past.attempts - 1)
        ways = super().order(
            situation._replace(menu=situation.menu._replace(streak=before), past=past)
        )
        if not ways or ways[0].key == streak.moved:  # now was its turn
            return super().order(situation)
        return tuple(way for way in ways if way.key != streak.moved)

    def _moved(self, usual: ChosenOrder, situation: Situation) -> ChosenOrder:
        """Return the order with the way in front that is surely cheaper there, where one is."""
        sequence, evidence = self._sequence(situation), situation.menu.evidence
        estimates = Estimates(evidence, sequence[0])
        gains = [
            (_Gain(self, situation, estimates, sequence[:number], way), way)
            for number, way in enumerate(sequence)
            if number and estimates.results.get(way.key, 0) >= FEWEST
        ]
        last = _last_help(evidence)
        gains.sort(key=lambda each: (each[1].key != last, -each[0].expected()))
        for gain, way in gains:
            if gain.expected() > 0.0 and gain.is_certain():
                ways = (way, *(each for each in usual.ways if each.key != way.key))
                return ChosenOrder(ways, hoped=round(gain.chance.mean, 3))
        return usual

    def _sequence(self, situation: Situation) -> List[Way]:
        """Return the ways that the menu's own order would go one after the other, in vain."""
        found: List[Way] = []
        menu, past = situation.menu, situation.past
        keyed = keyed_ways(menu)
        while True:
            ways = self._order_of(situation._replace(menu=menu, past=past), keyed)
            if not ways:
                return found
            found.append(ways[0])
            streak, past = menu.streak, past._replace(attempts=past.attempts + 1)
            tried, attempts = (*streak.tried, ways[0].key), streak.attempts + 1
            menu = menu._replace(streak=streak._replace(tried=tried, attempts=attempts))


class _Gain:
    """What is gained where a way comes before others, which it follows in the menu's own order.

    Whether all of them fail does not depend on their order. So no way after them counts, and no
    question. What counts is the price of the ways that are not needed any more, less the price of
    this one where the ones before would have helped.

    `chance`: of the way to help in front.
    """

    def __init__(
        self,
        policy: Escalating,
        situation: Situation,
        estimates: Estimates,
        before: Sequence[Way],
        way: Way,
    ) -> None:
        def price(each: Way) -> float:
            minutes = estimates.minutes(each)
            return policy.price(each._replace(minutes=minutes), situation.menu.prices)

        place = LATER if situation.menu.streak.tried else FIRST
        self._prices = [price(each) for each in before]
        self._price = price(way)
        self._before = [
            estimates.chance(each, LATER if number else place) for number, each in enumerate(before)
        ]
        self._later = estimates.chance(way, LATER)
        self.chance = estimates.chance(way, place)

    def expected(self) -> float:
        """Return the gain by the means of the chances."""
        means = [each.mean for each in self._before]
        return self._by(means, self.chance.mean, self._later.mean)

    def is_certain(self) -> bool:
        """Return whether there is one with a chance of 0.9. It depends on the situation alone."""
        rng = random.Random(0)
        gained = 0
        for _ in range(DRAWS):
            before = [rng.betavariate(*each) for each in self._before]
            first, later = rng.betavariate(*self.chance), rng.betavariate(*self._later)
            gained += self._by(before, first, later) > 0.0
        return gained >= CERTAIN * DRAWS

    def _by(self, before: Sequence[float], first: float, later: float) -> float:
        gain, reached, helps = 0.0, 1.0, first
        for price, chance in zip(self._prices, before):
            gain += price * reached * helps
            reached, helps = reached * (1.0 - chance), later
        return gain - self._price * (1.0 - reached)


def _last_help(evidence: Evidence) -> str:
    """Return the way that has helped last after a failure of the same kind, '' for none."""
    same = (
        each.way
        for each in reversed(evidence.results)
        if each.helped and each.failure == evidence.failure and each.place != BY_PERSON
    )
    return next(same, '')


def _why_back(results: Sequence[WayResult]) -> str:
    """Say why the menu's own order is gone again: moved ways have disappointed. '' if not."""
    moved = [
        (each.hoped, each.helped)
        for each in results
        if each.hoped is not None and each.helped is not None
    ]
    hoped, helped = sum(hope for hope, _ in moved), sum(has for _, has in moved)
    spread = math.sqrt(sum(hope * (1.0 - hope) for hope, _ in moved))
    if len(moved) < FEWEST or hoped - helped <= DISAPPOINTS * spread:
        return ''
    return FALLS_BACK.format(helped, len(moved), hoped)
