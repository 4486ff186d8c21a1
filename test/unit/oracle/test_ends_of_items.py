"""What comes of it where an item of an Iterator has ended, or an Iterator lies in a Concurrence."""

import copy
import os

import pytest
from branch_machines import Item, both, inside, iterator_over
from machines import FakeExpert, Scripted, Watched, give_up, supersede

ASKS = {'max_recoveries': 0}


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')), reason='upstream takes the error for the end'
)
@pytest.mark.parametrize('answer', [give_up, supersede])
def test_an_item_that_is_given_up_settles_nothing_that_comes_behind_it(answer):
    def items():
        yield 1
        raise OSError('the camera is gone')

    iterator = iterator_over(Item(item1=['aborted']), items)
    expert = FakeExpert(answer('ok'), give_up('aborted'))
    machine = Watched(inside(iterator), name='TOP', settings=ASKS, expert=expert)
    assert machine.run() == 'aborted'
    assert [question.failed_state for question in expert.questions] == ['EACH', 'ALL']


def test_in_a_concurrence_an_outcome_of_an_iterator_is_judged_by_its_name():
    iterator = iterator_over(
        Scripted('aborted'), [1], loop_outcomes=['ok'], final_outcome_map={'aborted': 'tired'}
    )
    iterator.register_outcomes(['tired'])
    concurrence = both(iterator, Scripted(), outcome_map={'done': {'LEFT': 'tired', 'RIGHT': 'ok'}})
    expert = FakeExpert()
    machine = Watched(inside(concurrence), name='TOP', settings=ASKS, expert=expert)
    assert machine.run() == 'done'
    assert not expert.questions, 'its author has drawn what comes after'


def test_the_userdata_of_a_concurrence_is_copied_for_no_branch():
    """Another branch may write into it at the same time."""

    class Counted(list):
        copies = 0

        def __deepcopy__(self, memo):
            Counted.copies += 1
            return Counted(copy.copy(each) for each in self)

    concurrence = both(Scripted('aborted'), Scripted())
    concurrence.userdata.seen = Counted([1])
    machine = Watched(inside(concurrence), settings={'deep_copy_keys': ['seen']})
    assert machine.run() == 'done'
    assert machine.rate('LEFT').failures == 1 and Counted.copies == 0
