"""Iterators in Iterators that were killed go on with the items of all of them."""

import itertools

import pytest
from killed_machines import around
from left_stores import Left

import smach

OUTCOMES = ['succeeded', 'aborted']
LABELS = ('outer', 'middle', 'inner')
ITEMS = list(itertools.product(range(2), range(2), range(2)))  # in the order of their visits


class Told(smach.State):
    """Appends the items of the three Iterators to the userdata key `done`."""

    def __init__(self, diary, points):
        smach.State.__init__(self, OUTCOMES, ['done', *LABELS], ['done'])
        self._diary, self._points = diary, points

    def execute(self, userdata):
        items = [userdata[label] for label in LABELS]
        self._diary.write('begins', str(items))
        self._points()
        userdata.done = list(userdata.done) + [items]
        self._diary.write('ends', str(items))
        return 'succeeded'


def three_deep(diary, points):
    state = Told(diary, points)
    for number in (2, 1, 0):
        inputs = ['done', *LABELS[:number]]
        iterator = smach.Iterator(
            OUTCOMES,
            inputs,
            ['done'],
            it=range(2),
            it_label=LABELS[number],
            exhausted_outcome='succeeded',
        )
        with iterator:
            smach.Iterator.set_contained_state('I', state, loop_outcomes=['succeeded'])
        state = iterator
    return around('ALL', state, {'succeeded': 'succeeded', 'aborted': 'aborted'})


def most_often(killed):
    """How often each item was begun, at least once for each that is there."""
    begun = killed.diary.count('begins')
    return sorted(begun[str(list(items))] for items in ITEMS)


@pytest.fixture(scope='module')
def left():
    return Left(three_deep)


def test_killed_at_every_point_each_item_ends_and_only_the_one_in_doubt_runs_again(left, tmp_path):
    for point in left.points():
        killed = left.killed_at(point, tmp_path / 'killed')
        told = killed.run()
        assert (point, told.get('done')) == (point, [list(items) for items in ITEMS])
        assert most_often(killed) in ([1] * 8, [1] * 7 + [2]), point


def test_killed_while_it_resumes_it_still_stands_at_its_items(left, tmp_path):
    seconds = (2, 3, 4)
    for point in left.points(5):
        twice = Left(three_deep, begins=left.folder(point), points=seconds)
        for second in seconds:
            killed = twice.killed_at(second, tmp_path / 'killed')
            told = killed.run()
            assert (point, told.get('done')) == (point, [list(items) for items in ITEMS])
            assert most_often(killed)[-2:] in ([1, 1], [1, 2], [1, 3]), (point, second)
