"""What recorded streaks say of another policy: worlds in which the true value is known."""

import random

import pytest

from smach_oracle.analysis.replaying.streak_words import findings_as_data, findings_in_words
from smach_oracle.analysis.replaying.streaks import RecordedStreak, StreakEnd, StreakStep
from smach_oracle.analysis.replaying.weighting import bounds_of, findings_of, weigh

CURES = {'again': 0.3, 'back': 0.7, 'wait': 0.2}  # each by itself
PRICES = {'again': 1.0, 'back': 3.0, 'wait': 2.0}
ASKING = 15.0
USUAL, ASKED = ('again', 'back', 'wait'), ('back', 'again', 'wait')


def true_end(order):
    """The mean end of a streak in which all ways of an order are gone, until one cures."""
    cost, left = 0.0, 1.0
    for way in order:
        cost += left * PRICES[way]
        left *= 1.0 - CURES[way]
    return StreakEnd(1.0 - left, left, cost + left * ASKING)


def drawn_streak(generator, trial, explore):
    """A streak under a policy whose first two ways change places with a chance."""
    left, tried, steps, cost = list(USUAL), [], [], 0.0
    while left:
        way, chance = left[0], 1.0
        if len(left) > 1 and explore:
            swaps = generator.random() < explore
            way, chance = (left[1], explore) if swaps else (left[0], 1.0 - explore)
        asked = next(each for each in ASKED if each not in tried)
        steps.append(
            StreakStep(
                chance,
                float(way == asked),
                0.0,
                float(bool(explore) or way == asked),
                StreakEnd(0.0, 1.0, cost + ASKING),
                StreakEnd(1.0, 0.0, cost + min(PRICES.values())),
                StreakEnd(0.0, 1.0, cost + sum(PRICES.values()) + ASKING),
            )
        )
        cost += PRICES[way]
        tried.append(way)
        left.remove(way)
        if generator.random() < CURES[way]:
            return RecordedStreak(trial, tuple(steps), StreakEnd(1.0, 0.0, cost))
    return RecordedStreak(trial, (*steps, StreakStep()), StreakEnd(0.0, 1.0, cost + ASKING))


def drawn(seed, explore, trials=400):
    generator = random.Random(seed)
    return [
        drawn_streak(generator, trial, explore)
        for trial in range(trials)
        for _ in range(generator.choice([0, 1, 1, 2]))
    ]


def holds(interval, value):
    return interval[0] - 1e-9 <= value <= interval[1] + 1e-9


@pytest.mark.parametrize('explore, widest', [(0.5, 0.25), (0.2, 0.4)])
def test_the_intervals_cover_the_true_value_in_nine_of_ten_records(explore, widest):
    true, found = true_end(ASKED)._asdict(), [weigh(drawn(seed, explore)) for seed in range(50)]
    enough = [each for each in found if not each.why_not]
    assert len(enough) > 45
    for name, value in true.items():
        covered = sum(holds(each.intervals[name], value) for each in enough)
        assert covered >= 0.9 * len(enough), name
        # and they say more than that it is anything between 0 and all
        widths = [high - low for low, high in (each.intervals[name] for each in enough)]
        all_of_it = sum(PRICES.values()) + ASKING if name == 'cost' else 1.0
        assert sorted(widths)[len(widths) // 2] < widest * all_of_it


def test_the_bounds_hold_the_true_value_whatever_was_recorded():
    for explore in (0.0, 0.1, 0.5):
        bounds = bounds_of(drawn(1, explore, trials=3000))
        for name, value in true_end(ASKED)._asdict().items():
            low, high = bounds.ranges[name]
            assert low < value < high


def test_a_record_without_chance_supports_no_weighting():
    streaks = drawn(1, explore=0.0)
    assert weigh(streaks) is None
    lines = findings_in_words(findings_of(streaks))
    assert len(lines) == 2 and 'supports no weighting' in lines[1]
    assert findings_as_data(findings_of(streaks))['weighted'] is None


def test_a_policy_that_agrees_everywhere_is_known_for_certain():
    streaks = [
        each._replace(steps=tuple(step._replace(follows=1.0) for step in each.steps))
        for each in drawn(1, explore=0.0)
    ]
    bounds = bounds_of(streaks)
    assert bounds.agree == bounds.streaks == len(streaks)
    mean = sum(each.end.cost for each in streaks) / len(streaks)
    assert bounds.ranges['cost'] == pytest.approx((mean, mean))


def test_a_streak_in_which_the_other_policy_would_ask_at_once_is_known():
    step = StreakStep(follows=0.0, asks=1.0, if_asks=StreakEnd(0.0, 1.0, 15.0))
    bounds = bounds_of([RecordedStreak(0, (step,), StreakEnd(1.0, 0.0, 1.0))])
    assert bounds.ranges == {'cured': (0.0, 0.0), 'questions': (1.0, 1.0), 'cost': (15.0, 15.0)}


def test_streaks_without_a_known_end_are_left_out_and_told():
    streaks = drawn(1, explore=0.5)
    unknown = [each._replace(end=None) for each in streaks[:7]]
    assert weigh(streaks + unknown) == weigh(streaks)
    assert bounds_of(streaks + unknown).left_out == 7
    assert '7 more have no known end' in findings_in_words(findings_of(streaks + unknown))[0]
    assert findings_in_words(findings_of(unknown)) == []


def test_few_streaks_are_not_enough():
    (_, line) = findings_in_words(findings_of(drawn(1, 0.1, trials=100)))
    assert line.startswith('not enough data to weight: an effective ') and '30 are needed' in line


def test_one_streak_with_a_tenth_of_the_weight_is_not_enough():
    likely, unlikely = StreakStep(0.9), StreakStep(0.01)
    streaks = [RecordedStreak(n, (likely,), StreakEnd(1.0, 0.0, 1.0)) for n in range(700)]
    assert weigh(streaks).why_not == ''
    streaks.append(RecordedStreak(700, (unlikely,), StreakEnd(1.0, 0.0, 1.0)))
    assert weigh(streaks).why_not == 'one streak has 11% of the weight, less than 10% is needed'


def test_ways_that_were_never_drawn_are_not_enough():
    streaks = drawn(1, explore=0.5)
    away = [
        each._replace(steps=(each.steps[0]._replace(follows=0.0, covered=0.0), *each.steps[1:]))
        for each in streaks
    ]
    why_not = weigh(streaks + away).why_not
    assert why_not == 'in 50% of the streaks it goes a way that was not to be drawn'


def test_the_same_streaks_give_the_same_intervals():
    assert weigh(drawn(3, 0.5)) == weigh(drawn(3, 0.5))
    assert weigh(drawn(3, 0.5), seed=1).intervals != weigh(drawn(3, 0.5), seed=2).intervals
