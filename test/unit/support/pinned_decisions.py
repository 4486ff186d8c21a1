"""Decisions in situations drawn at random, and failure rates after results drawn at random.

    python3 test/unit/support/pinned_decisions.py FOLDER [--pin]

writes what each policy does there, and what the rates are, to FOLDER, and with --pin the digests to
test/data/pinned/decisions.txt. What users see of a change is the difference of two folders, of
before and after it.
"""

import random
import sys
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple

HERE = Path(__file__).resolve().parent
if __name__ == '__main__':
    sys.path[:0] = [str(HERE), str(HERE.parents[2] / 'src')]

from pinned import drawn, write_told

from smach_oracle.oracle.decision.failure_rate import (
    ESTIMATORS,
    FailureClass,
    base_of,
    classify,
    make_estimator,
    merged,
)
from smach_oracle.oracle.decision.policies import POLICIES, policy_named
from smach_oracle.oracle.decision.policy import (
    Action,
    FailureContext,
    Menu,
    Past,
    Policy,
    Preconditions,
    Situation,
)
from smach_oracle.oracle.decision.sentence import (
    DecisionFacts,
    cause_of,
    decision_sentence,
    going_would_repeat,
    still_running_sentence,
)
from smach_oracle.oracle.decision.ways import (
    BY_PERSON,
    FIRST,
    LATER,
    Evidence,
    Prices,
    StreakSoFar,
    Way,
    WayKind,
    WayResult,
    way_in_words,
)

# few values, so that costs meet their limits, and each other, exactly
MINUTES = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 3.75, 7.5, 15.0, 30.0, 60.0)
SET: Dict[str, Tuple[Dict[str, float], ...]] = {
    'escalating': ({'explore': 0.3, 'seed': 3},),
    'any_way': ({'seed': 3},),
    'random': ({'seed': 3},),
    'retry': ({'times': 0}, {'times': 1}),
    'ladder': ({'tries': 2, 'steps_back': 1, 'wait_s': 2.0},),
}
FAILURES = 'aborted', 'aborted: no object'


def tell() -> Dict[str, List[str]]:
    """Return a line for each thing that is told, by the draws that it comes from."""
    groups = (
        ('situations', 12, _of_situation),
        ('rates', 6, _of_rates),
        ('sentences', 2, _of_sentence),
    )
    return drawn(groups, draws=40)


# -- what policies do


def _of_situation(rng: random.Random) -> Iterator[str]:
    situation, context = _situation(rng), _context(rng)
    for name in sorted(POLICIES):
        for given in ({}, *SET.get(name, ())):
            policy = policy_named(name, given)
            does = _by_ways if policy.goes_by_ways else _by_table
            yield '{} {}: {}'.format(name, given or '', does(policy, situation))
            yield '{}: {} {} {}'.format(
                name,
                policy.is_continuous(context),
                policy.step_back_target(context),
                policy.runs_preconditions(situation.failure_class),
            )
    results = situation.menu.evidence
    for way in situation.menu.ways:
        counts = results.of_way(way.key)
        yield '{}: {} {} {}'.format(way_in_words(way.key), way.reach, counts, counts.share)


def _by_table(policy: Policy, situation: Situation) -> str:
    action = policy.decide(situation)
    can = [each.value for each in policy.may_do(situation)]
    waits_s = policy.wait_s(situation)
    return '{} {} {} {!r}'.format(action.value, can, waits_s, policy.why(situation))


def _by_ways(policy: Any, situation: Situation) -> str:
    chosen = policy.choose(situation)
    keys = ['', *(way.key for way in situation.menu.ways)]
    return ' '.join(
        map(
            str,
            (
                policy.decide(situation).value,
                [way.key for way in policy.order(situation)],
                chosen._replace(ways=[way.key for way in chosen.ways]),
                repr(policy.why(situation)),
                [policy.chance_of(situation, key) for key in keys],
                [policy.cost(way, situation) for way in situation.menu.ways],
                policy.price_of_asking(situation),
            ),
        )
    )


def _situation(rng: random.Random) -> Situation:
    """A situation of any kind. In half of them nothing is spent, and a way has often helped."""
    is_fresh = rng.random() < 0.5
    number = rng.choice((2, 3, 5)) if is_fresh else rng.choice((0, 1, 2, 3, 5, 7))
    ways = [_way(rng, number, MINUTES[:6] if is_fresh else MINUTES) for number in range(number)]
    ways = list({way.key: way for way in ways}.values())
    tried = [way.key for way in ways if rng.random() < (0.1 if is_fresh else 0.4)]
    attempts = len(tried) + (0 if is_fresh else rng.choice((0, 0, 0, 1, 2)))
    moved = rng.choice(tried) if tried and rng.random() < 0.5 else ''
    streak = StreakSoFar(tuple(tried), attempts, rng.choice((0.0, 0.0, 1.0, 1.5, 3.0)), moved)
    past = Past(
        rng.randrange(6),
        rng.randrange(4),
        'TASK/HERE {}'.format(rng.randrange(9)),
        rng.randrange(9),
        attempts + rng.choice((0, 0, 2, 4, 6)),
        None if is_fresh else rng.choice((None, 0.2, 0.5, 1.0, 2.0)),
    )
    prices = Prices() if rng.random() < 0.7 else Prices(0.5, 2.0, 20.0, 60.0)
    evidence = _evidence(rng, ways, is_fresh)
    return Situation(
        rng.choice((FailureClass.LOW, FailureClass.MODERATE, FailureClass.HIGH)),
        rng.choice(list(Preconditions)),
        rng.random() < 0.5,
        past,
        Menu(tuple(ways), streak, prices, rng.random() < 0.8, evidence),
    )


def _way(rng: random.Random, number: int, minutes: Sequence[float]) -> Way:
    kind, takes = rng.choice(list(WayKind)), rng.choice(minutes)
    blocked = rng.choice(('', '', '', '', '', 'is closed'))
    if kind in (WayKind.AGAIN, WayKind.PREPARE):
        return Way(kind, 'HERE', minutes=takes, blocked=blocked)
    if kind is WayKind.WAIT:
        return Way(kind, 'HERE', 0, rng.choice((10.0, 60.0)), minutes=takes, blocked=blocked)
    back, repeats = rng.choice((1, 2, 3, 4, 8)), tuple('ABC'[: rng.randrange(4)])
    return Way(kind, 'T{}'.format(number), back, minutes=takes, repeats=repeats, blocked=blocked)


def _evidence(rng: random.Random, ways: Sequence[Way], is_clear: bool) -> Evidence:
    """Results of the ways. `is_clear`: there are many, and they favour one of them."""
    if not ways:
        return Evidence()
    favourite, hoping = rng.choice(ways), rng.choice((0.0, 0.0, 0.0, 0.3))
    number = rng.choice((12, 25, 60, 120)) if is_clear else rng.choice((0, 4, 5, 6, 12))
    results = [_result(rng, rng.choice(ways), hoping, favourite) for _ in range(number)]
    places = [(kind.value, place) for kind in WayKind for place in (FIRST, LATER)]
    some = rng.sample(places, rng.randrange(5))
    of_kinds = {each: (float(rng.randrange(5)), float(rng.randrange(5))) for each in some}
    return Evidence(tuple(results), FAILURES[0], of_kinds)


def _result(rng: random.Random, way: Way, hoping: float, favourite: Way) -> WayResult:
    helped: Optional[bool] = rng.random() < (0.95 if way is favourite else 0.1)
    return WayResult(
        way.key,
        way.kind.value,
        rng.choice((FIRST, LATER, LATER, BY_PERSON)),
        rng.choice((FAILURES[0], *FAILURES)),
        helped if rng.random() < 0.9 else None,
        rng.choice(MINUTES[:6]),
        rng.choice((0.1, 0.5, 1.0)) if rng.random() < hoping else None,
    )


def _context(rng: random.Random) -> FailureContext:
    return FailureContext(
        'HERE',
        'A',
        rng.random() < 0.5,
        rng.random() < 0.5,
        rng.choice((None, 'B')),
        rng.choice((None, 'C')),
    )


# -- what is learned of a state


def _of_rates(rng: random.Random) -> Iterator[str]:
    """Two programs learn of one state, and share it now and then."""
    memory, prior = rng.choice((1, 2, 3, 10)), rng.choice((0.0, 0.1, 0.5, 1.0))
    kinds = sorted(ESTIMATORS)
    one, other = (make_estimator(rng.choice(kinds), memory, prior) for _ in range(2))
    shared: Dict[str, Any] = {}
    for _ in range(12):
        failed = False
        for each in (one, one, other):
            failed = rng.random() < 0.5
            each.add(failed)
        if rng.random() < 0.3:
            one.add_successes(rng.randrange(memory + 2))
        elif failed:
            other.take_back_failure()
        if rng.random() < 0.3:
            own, theirs = one.snapshot(), other.snapshot()
            together = merged(own, shared, theirs, memory)
            yield 'merged {} {}'.format(together, base_of(together))
            shared = base_of(together) if rng.random() < 0.8 else {}
            again = make_estimator(rng.choice(kinds), rng.choice((memory, 2)), prior)
            again.restore(together)
            yield 'restored {} {}'.format(again.rate, again.snapshot())
            one.restore(together)
        for each in (one, other):
            limits = sorted(rng.choice((0.0, 0.1, 0.3, 0.5, 0.55, 0.7, 1.0)) for _ in range(2))
            found = classify(each.rate, *limits)
            yield '{} {} {} {}'.format(each.rate, each.recent, found.name, each.snapshot())


# -- what people are told


def _of_sentence(rng: random.Random) -> Iterator[str]:
    target = rng.choice(('HERE', 'A'))
    facts = DecisionFacts(
        'HERE',
        rng.choice(((0, 0), (1, 1), (1, 2), (3, 10))),
        rng.choice((0.0, 0.125, 1.0)),
        rng.random() < 0.5,
        rng.choice(list(Action)),
        target,
        rng.choice(((), ('P',), ('P', 'Q'))),
        rng.choice(('', '', 'Q')),
        rng.choice((-1, -1, 0, 1, 3)),
        rng.choice(('', 'all is blocked')),
        rng.choice(('', '', 'was done before')),
        rng.choice(('', 'nobody')),
        rng.choice((0.0, 0.5, 10.0)),
        rng.choice(('', 'going back to A')),
    )
    yield decision_sentence(facts, cause_of(facts))
    yield going_would_repeat('HERE', target, rng.choice((('HERE',), ('A', 'B'), ('HERE', 'A'))))
    longest_s: Optional[float] = rng.choice((None, 0.0, 0.1, 9.96, 61.0))
    ran_s = rng.choice((0.0, 0.09, 0.1, 9.96, 10.0, 3600.0))
    yield still_running_sentence('HERE', ran_s, longest_s)


if __name__ == '__main__':
    write_told('decisions', tell(), Path(sys.argv[1]), '--pin' in sys.argv)
