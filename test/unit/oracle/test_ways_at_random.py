"""The promises of the policies that go by ways, on menus that are drawn at random."""

import random
from typing import Any, List, Tuple

import pytest

from smach_oracle.oracle.decision.by_ways import Escalating
from smach_oracle.oracle.decision.failure_rate import FailureClass
from smach_oracle.oracle.decision.policies import POLICIES, policy_named
from smach_oracle.oracle.decision.policy import Action, Menu, Past, Policy, Preconditions, Situation
from smach_oracle.oracle.decision.ways import Prices, StreakSoFar, Way, WayKind, parts_of

BY_WAYS = sorted(name for name, policy in POLICIES.items() if policy.goes_by_ways)
DRAWS = 300
DEARER = (1.0, 1.3, 4.0, 100.0)


def rng_of(seed: int) -> random.Random:
    """The draws of one test. A failure names the seed."""
    print('seed', seed)
    return random.Random(seed)


def a_way(rng: random.Random, number: int) -> Way:
    """A way to a place of its own."""
    repeats = tuple('R{}'.format(each) for each in range(rng.choice((0, 0, 1, 2, 5))))
    minutes = rng.choice((0.0, rng.uniform(0.0, 3.0), rng.uniform(0.0, 30.0)))
    blocked = rng.choice(('', '', '', 'it would repeat R0'))
    kind = rng.choice(list(WayKind))
    if kind in (WayKind.AGAIN, WayKind.PREPARE):
        return Way(kind, 'HERE', minutes=minutes, blocked=blocked)
    if kind is WayKind.WAIT:
        return Way(kind, 'HERE', wait_s=float(number + 1), minutes=minutes, blocked=blocked)
    return Way(
        kind, 'T{}'.format(number), number + 1, minutes=minutes, repeats=repeats, blocked=blocked
    )


def a_menu(rng: random.Random) -> Tuple[Way, ...]:
    """Ways in any order. The keys differ, as in menus of the executive."""
    ways = {each.key: each for each in (a_way(rng, number) for number in range(rng.randint(0, 9)))}
    return tuple(rng.sample(list(ways.values()), len(ways)))


def a_situation(rng: random.Random) -> Situation:
    """A situation of any kind, in which nothing is spent in half of the cases."""
    ways = a_menu(rng)
    fresh = rng.random() < 0.5
    tried: List[str] = [] if fresh else [each.key for each in ways if rng.random() < 0.3]
    attempts = len(tried) + (0 if fresh else rng.choice((0, 0, 1, 3)))
    streak = StreakSoFar(tuple(tried), attempts, 0.0 if fresh else rng.uniform(0.0, 20.0))
    prices = Prices(*(price * rng.choice((0.0, 0.5, 1.0, 2.0)) for price in Prices()))
    past = Past(
        trial=rng.randint(0, 99),
        place='TASK/HERE {}'.format(rng.randint(1, 99)),
        attempts=attempts + (0 if fresh else rng.randint(0, 6)),
        usual_minutes=rng.choice((None, rng.uniform(0.1, 10.0))),
    )
    return Situation(
        rng.choice([FailureClass.LOW, FailureClass.MODERATE, FailureClass.HIGH]),
        rng.choice(list(Preconditions)),
        not fresh,
        past,
        Menu(ways, streak, prices, rng.random() < 0.8),
    )


def with_menu(situation: Situation, **changed: Any) -> Situation:
    return situation._replace(menu=situation.menu._replace(**changed))


def with_price(situation: Situation, name: str, factor: float) -> Situation:
    prices = situation.menu.prices
    return with_menu(situation, prices=prices._replace(**{name: getattr(prices, name) * factor}))


def policies(rng: random.Random) -> List[Policy]:
    """One of each that goes by ways."""
    return [
        policy_named(name, {'seed': rng.randint(0, 9)} if POLICIES[name].draws else {})
        for name in BY_WAYS
    ]


def spent(situation: Situation) -> bool:
    """Whether the bounds of the streak, the trial or the time are reached."""
    usual = situation.past.usual_minutes
    late = usual is not None and situation.menu.streak.minutes > max(3.0 * usual, 1.0)
    return situation.menu.streak.attempts >= 4 or situation.past.attempts >= 8 or late


def test_all_policies_that_go_by_ways_are_held_to_this():
    assert BY_WAYS == ['any_way', 'escalating', 'learned']


@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_only_ways_that_are_open_and_untried_are_gone_each_once(seed):
    rng = rng_of(seed)
    for _ in range(10):
        situation = a_situation(rng)
        menu = situation.menu
        for policy in policies(rng):
            order = policy.order(situation)
            assert len({way.key for way in order}) == len(order)
            for way in order:
                assert way in menu.ways and not way.blocked
                assert way.key not in menu.streak.tried


@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_nothing_is_gone_beyond_the_bounds(seed):
    rng = rng_of(seed)
    for _ in range(10):
        situation = a_situation(rng)
        for policy in policies(rng):
            if spent(situation):
                assert policy.order(situation) == ()
                assert policy.decide(situation) is Action.ASK and policy.why(situation)


@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_a_streak_has_at_most_four_ways_and_a_trial_at_most_eight(seed):
    rng = rng_of(seed)
    menus = [a_menu(rng) for _ in range(6)]
    for policy in policies(rng):
        of_trial = 0
        for ways in menus:
            tried: List[str] = []
            while True:
                situation = Situation(
                    FailureClass.LOW,
                    Preconditions.NONE,
                    True,
                    Past(attempts=of_trial, place='TASK/HERE {}'.format(of_trial)),
                    Menu(ways, StreakSoFar(tuple(tried), len(tried)), has_expert=False),
                )
                order = policy.order(situation)
                if not order:
                    break
                tried.append(order[0].key)
                of_trial += 1
            assert len(set(tried)) == len(tried) <= 4
        assert of_trial <= 8


@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_a_person_is_not_asked_where_a_retry_is_free_and_certain(seed):
    rng = rng_of(seed)
    for _ in range(10):
        situation = a_situation(rng)
        again = Way(WayKind.AGAIN, 'HERE', minutes=0.0)
        ways = [way for way in situation.menu.ways if way.key != again.key]
        streak = StreakSoFar()
        free = with_menu(situation, ways=(*ways, again), streak=streak, prices=Prices())
        free = free._replace(failure_class=FailureClass.LOW, past=Past())
        for policy in policies(rng):
            assert policy.decide(free) is not Action.ASK
        assert Escalating().order(free)[0].minutes == 0.0


@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_a_person_is_asked_where_all_ways_are_tried_or_blocked(seed):
    rng = rng_of(seed)
    for _ in range(10):
        situation = a_situation(rng)
        tried = tuple(way.key for way in situation.menu.ways if not way.blocked)
        situation = with_menu(situation, streak=StreakSoFar(tried, min(len(tried), 3)))
        for policy in policies(rng):
            assert policy.decide(situation) is Action.ASK and policy.why(situation)


@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_the_order_of_the_menu_changes_nothing(seed):
    rng = rng_of(seed)
    for _ in range(10):
        situation = a_situation(rng)
        ways = situation.menu.ways
        other = with_menu(situation, ways=tuple(rng.sample(ways, len(ways))))
        for policy in policies(rng):
            assert policy.order(situation) == policy.order(other)


@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_the_way_that_takes_less_and_repeats_less_comes_first_whatever_the_prices(seed):
    rng, policy = rng_of(seed), Escalating()
    for _ in range(10):
        situation = a_situation(rng)
        for name in Prices._fields:
            for factor in DEARER:
                order = policy.order(with_price(situation, name, factor))
                for index, later in enumerate(order):
                    for first in order[:index]:
                        if later.reach == first.reach:
                            assert not (
                                later.minutes < first.minutes
                                and len(later.repeats) <= len(first.repeats)
                            )


@pytest.mark.parametrize('name', ['robot_minute', 'harm'])
@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_a_dearer_price_puts_no_way_before_one_that_it_makes_less_dear(seed, name):
    rng, policy = rng_of(seed), Escalating()
    for _ in range(10):
        situation = with_menu(a_situation(rng), prices=Prices())
        free = with_menu(situation, prices=Prices(0.0, 0.0, 0.0, 0.0)._replace(**{name: 1.0}))
        for factor, dearer in zip(DEARER, DEARER[1:]):
            before = policy.order(with_price(situation, name, factor))
            now = policy.order(with_price(situation, name, dearer))
            for index, later in enumerate(now):
                for first in now[:index]:
                    pair = [each for each in before if each in (first, later)]
                    if pair == [later, first]:  # they have changed places
                        assert policy.cost(first, free) <= policy.cost(later, free)


def test_farther_back_has_the_hope_of_each_doubling_that_was_not_reached():
    ways = tuple(
        Way(WayKind.STEP_BACK, str(back), back, minutes=1.0) for back in (1, 2, 3, 4, 5, 8)
    )
    assert [way.reach for way in ways] == [1, 2, 3, 3, 4, 4]
    situation = Situation(FailureClass.LOW, Preconditions.NONE, True, menu=Menu(ways))
    policy = Escalating()
    costs = [policy.cost(way, situation) for way in ways]
    assert costs == pytest.approx([1, 1 / 2, 1 / 3, 1 / 3, 1 / 4, 1 / 4])
    # after two back in vain, what is nearer has half the hope, and farther back what is new
    later = with_menu(situation, streak=StreakSoFar(('from 2',), 1))
    assert [policy.cost(way, later) for way in ways] == pytest.approx([2, 2, 1, 1, 1 / 2, 1 / 2])


@pytest.mark.parametrize('name', ['expert_minute', 'lost_trial'])
@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_a_dearer_person_or_trial_never_has_it_ask_earlier(seed, name):
    rng = rng_of(seed)
    for _ in range(10):
        situation = a_situation(rng)
        for policy in policies(rng):
            before = set(policy.order(situation))
            for factor in DEARER:
                now = set(policy.order(with_price(situation, name, factor)))
                assert before <= now
                before = now


@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_dearer_harm_never_adds_a_way(seed):
    rng = rng_of(seed)
    for _ in range(10):
        situation = a_situation(rng)
        for policy in policies(rng):
            before = set(policy.order(situation))
            for factor in DEARER:
                now = set(policy.order(with_price(situation, 'harm', factor)))
                assert now <= before
                before = now


@pytest.mark.parametrize('seed', range(DRAWS // 10))
def test_a_higher_failure_rate_never_puts_a_retry_earlier(seed):
    rng, policy = rng_of(seed), Escalating()
    for _ in range(10):
        situation = a_situation(rng)
        places = []
        for each in (FailureClass.LOW, FailureClass.MODERATE, FailureClass.HIGH):
            order = policy.order(situation._replace(failure_class=each))
            places.append([w.key for w in order])
        for key in places[0]:
            elsewhere = [keys for keys in places if key in keys]
            before = [
                {k for k in keys[: keys.index(key)] if k.startswith('from')} for keys in elsewhere
            ]
            if not key.startswith('from'):
                assert all(a <= b for a, b in zip(before, before[1:]))


# -- the control


def test_the_control_goes_the_ways_of_escalating_in_another_order():
    rng = rng_of(7)
    others = 0
    for _ in range(DRAWS):
        situation = a_situation(rng)
        own, drawn = (policy_named(name).order(situation) for name in ('escalating', 'any_way'))
        assert sorted(own) == sorted(drawn)
        others += own != drawn
        assert POLICIES['any_way'].why(situation) == POLICIES['escalating'].why(situation)
    assert others > DRAWS / 4
    assert POLICIES['any_way'].userdata == POLICIES['escalating'].userdata


def test_the_control_has_each_way_first_as_often():
    ways = tuple(Way(WayKind.STEP_BACK, each, minutes=float(n)) for n, each in enumerate('ABCD'))
    first = []
    for trial in range(2000):
        past = Past(trial=trial, place='TASK/HERE 1')
        situation = Situation(FailureClass.LOW, Preconditions.NONE, True, past, Menu(ways))
        first.append(POLICIES['any_way'].order(situation)[0].target)
    assert all(420 < first.count(each) < 580 for each in 'ABCD')


def test_the_control_draws_by_the_seed_the_trial_the_state_and_its_visits():
    ways = tuple(Way(WayKind.STEP_BACK, each) for each in 'ABCDEFGH')

    def order(seed: int, trial: int, place: str) -> Tuple[Way, ...]:
        past = Past(trial=trial, place=place)
        situation = Situation(FailureClass.LOW, Preconditions.NONE, True, past, Menu(ways))
        return policy_named('any_way', {'seed': seed}).order(situation)

    assert order(3, 4, 'TASK/A 1') == order(3, 4, 'TASK/A 1') == order(0, 7, 'TASK/A 1')
    differing = [(3, 5, 'TASK/A 1'), (3, 4, 'TASK/A 2'), (3, 4, 'TASK/B 1')]
    assert all(order(3, 4, 'TASK/A 1') != order(*each) for each in differing)


@pytest.mark.parametrize(
    'way, kind, what',
    [
        (Way(WayKind.AGAIN, 'HERE'), WayKind.AGAIN, ''),
        (Way(WayKind.WAIT, 'HERE', wait_s=10.0), WayKind.WAIT, '10 s'),
        (Way(WayKind.PREPARE, 'HERE'), WayKind.PREPARE, ''),
        (Way(WayKind.STEP_BACK, 'wait 3'), WayKind.STEP_BACK, 'wait 3'),
        (Way(WayKind.TOP, '/A/from B'), WayKind.STEP_BACK, '/A/from B'),
    ],
)
def test_the_parts_of_a_key_are_those_of_its_way(way, kind, what):
    assert parts_of(way.key) == (kind, what)


def test_another_text_is_no_key_of_a_way():
    assert parts_of('reboot') == (None, '')
