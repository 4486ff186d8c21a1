"""Which bags go: all of a trial together, and soon said where there are thousands."""

import itertools
import sys

import pytest

from smach_oracle.ros.disk.limits import KnownBag, Limits, planned

SIZE = 1000


def bag(number, *trials):
    return KnownBag('{:06}.bag'.format(number), SIZE, float(number), trials, trials)


@pytest.mark.parametrize('order', itertools.permutations(range(4)))
def test_bags_that_others_join_go_together_in_whatever_order_they_are(order):
    bags = [bag(0, 'a'), bag(1, 'b', 'c'), bag(2, 'a', 'b'), bag(3, 'd')]
    bags.append(bag(4, 'e'))
    plan = planned([bags[number] for number in order] + bags[4:], Limits(gb=2 * SIZE / 1e9), 9.0)
    assert sorted(each.bag.path[:6] for each in plan.removals) == ['000000', '000001', '000002']
    open_one = bags[1]._replace(ended=('b',))
    plan = planned([open_one, *bags[2:], bags[0]], Limits(gb=SIZE / 1e9), 9.0)
    assert [each.bag for each in plan.removals] == bags[3:] and len(plan.kept) == 3


def plan_of(count):
    """The oldest ten of so many bags are to go."""
    bags = [bag(number, 'trial {}'.format(number)) for number in range(count)]
    plan = planned(bags, Limits(gb=(count - 10) * SIZE / 1e9), 1e6)
    assert [each.bag for each in plan.removals] == bags[:10]


def lines_for(count):
    """Lines of Python that a plan executes."""
    lines = itertools.count()

    def trace(frame, event, arg):
        if event == 'line':
            next(lines)
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        plan_of(count)
    finally:
        sys.settrace(before)
    return next(lines)


def test_each_bag_takes_no_longer_in_a_folder_of_thousands():
    assert lines_for(2000) < 2.2 * lines_for(1000)
    plan_of(20000)
