"""A machine that is killed on its way to a state in a container below still comes to that state."""

import pytest
from killed_machines import KilledMachine, Noted

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


def killed_in_r(folder):
    """The machine, killed as R was under way for the first time."""
    for point in range(12, 100):  # before that R does not begin
        below = folder / str(point)
        below.mkdir()
        killed = KilledMachine(below, deep)
        killed.run(kill_at=point)
        if killed.diary.count('begins')['R']:
            return killed
    raise AssertionError('R never begins')


@pytest.mark.parametrize('second', range(1, 12))
def test_killed_on_its_way_down_it_begins_no_state_but_the_one_it_was_sent_to(tmp_path, second):
    killed = killed_in_r(tmp_path)
    assert killed.run(kill_at=second, on_resume='state:OUTER/INNER/Q') is None
    told = killed.run()
    assert told.get('outcome') == 'succeeded', told
    begun = killed.diary.count('begins')
    assert begun['P'] == 1
    assert begun['Q'] >= (2 if second > 4 else 1)
