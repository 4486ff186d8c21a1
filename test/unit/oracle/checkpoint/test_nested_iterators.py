"""Iterators in Iterators that were killed go on with the items of all of them."""

import itertools

import pytest
from killed_machines import Noted, around, each_of
from killed_trees import ENDS
from left_stores import Left

import smach
from smach_oracle.oracle import OracleContainer

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


def items_of(diary, points):
    inner = smach.StateMachine(OUTCOMES, ['done', 'item'], ['done'])
    with inner:
        state = Noted('I', diary, points, keys=('done', 'item'))
        smach.StateMachine.add('I', state, ENDS)
    return around('ALL', each_of([1, 2, 3], 'EACH', inner), ENDS)


def test_killed_between_two_items_and_again_as_it_resumes_it_goes_on_with_the_next(tmp_path):
    left = Left(items_of)
    between = next(
        point
        for point in left.points(left.first_in('I1'))
        if killed_between(left, point) and not killed_between(left, point + 1)
    )
    twice = Left(items_of, begins=left.folder(between), points=range(1, 6))
    for second in range(1, 6):
        killed = twice.killed_at(second, tmp_path / 'killed')
        assert killed.run()['outcome'] == 'succeeded', second
        assert killed.diary.count('ends')['I1'] == 1, second


def killed_between(left, point):
    """Whether the first item has ended, and the next one has not begun."""
    diary = left.killed_at(point, left.folder('looked at')).diary
    return diary.count('ends')['I1'] and not diary.count('begins')['I2']


def test_an_item_of_a_trial_that_has_ended_before_it_came_there_is_not_gone_on_with(tmp_path):
    """Its machine was inconsistent, and is put right."""

    def run(*stops):
        def each(userdata):
            tried.append(userdata.item)
            if userdata.item in stops:
                raise KeyboardInterrupt
            return 'succeeded'

        tried = []
        state = smach.CBState(each, outcomes=['succeeded'], input_keys=['item', 'done'])
        machine = around('ALL', each_of([1, 2, 3], 'I', state), ENDS)
        settings = {'checkpoint': str(tmp_path / 'robot.db'), 'on_resume': 'recover'}
        return OracleContainer.wrap(machine, name='TOP', settings=settings), tried

    machine, tried = run(2)
    with pytest.raises((KeyboardInterrupt, smach.InvalidUserCodeError)):
        machine.execute()
    assert tried == [1, 2]
    machine, tried = run()
    machine._transitions['ALL']['aborted'] = 'NOWHERE'
    assert machine.execute() is None and not tried
    machine._transitions['ALL']['aborted'] = 'aborted'
    assert machine.execute() == 'succeeded' and tried == [1, 2, 3]


def test_killed_in_one_iterator_another_one_begins_with_its_first_item_again(tmp_path):
    """Its author leads back to it."""

    def build(diary, points):
        first, second = (
            each_of([1, 2], name, Noted(name, diary, points, keys=('done', 'item')))
            for name in ('ONE', 'TWO')
        )
        top = around('ONE', first, dict(ENDS, succeeded='TWO'))
        with top:
            smach.StateMachine.add('TWO', second, dict(ENDS, succeeded='CHECK'))
            check = Noted('CHECK', diary, points, failures=1)
            smach.StateMachine.add('CHECK', check, dict(ENDS, aborted='ONE'))
        return top

    left = Left(build)
    killed = left.killed_at(left.first_in('TWO2'), tmp_path / 'killed')
    assert killed.run()['outcome'] == 'succeeded'
    ended = killed.diary.count('ends')
    assert (ended['ONE1'], ended['ONE2'], ended['TWO1']) == (2, 2, 2)
