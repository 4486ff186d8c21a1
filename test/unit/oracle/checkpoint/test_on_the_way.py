"""A machine that is killed on its way to a state in a container below still comes to that state."""

import pytest
from killed_machines import Noted
from left_stores import Left

import smach

ENDS = {'succeeded': 'succeeded', 'aborted': 'aborted'}


def deep(diary, points):
    """A, then P and Q two machines down, then R one machine down."""

    def machine():
        return smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])

    top, outer, inner = machine(), machine(), machine()
    top.userdata.done = []
    with inner:
        inner.add('P', Noted('P', diary, points), {'succeeded': 'Q'})
        inner.add('Q', Noted('Q', diary, points), ENDS)
    with outer:
        outer.add('INNER', inner, {'succeeded': 'R'})
        outer.add('R', Noted('R', diary, points), ENDS)
    with top:
        top.add('A', Noted('A', diary, points), {'succeeded': 'OUTER'})
        top.add('OUTER', outer, ENDS)
    return top


SECONDS = tuple(range(1, 12))


@pytest.fixture(scope='module')
def sent():
    """Killed in R, then sent to Q, and killed once more."""
    left = Left(deep)
    in_r = left.folder(left.first_in('R'))
    return Left(deep, begins=in_r, points=SECONDS, on_resume='state:OUTER/INNER/Q')


@pytest.mark.parametrize('second', SECONDS)
def test_killed_on_its_way_down_it_begins_no_state_but_the_one_it_was_sent_to(
    tmp_path, sent, second
):
    killed = sent.killed_at(second, tmp_path / 'killed')
    told = killed.run(on_resume='recover')
    assert told.get('outcome') == 'succeeded', told
    begun = killed.diary.count('begins')
    assert begun['P'] == 1
    assert begun['Q'] >= (2 if second > 4 else 1)
