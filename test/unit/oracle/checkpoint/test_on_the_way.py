"""A machine that is killed on its way to a state in a container below still comes to that state."""

import pytest
from killed_machines import Noted, around, each_of
from left_stores import Left
from test_never_twice import oracle_state
from test_unanswered import Answers, nobody, questions

import smach
from smach_oracle.oracle.asking.question import Answer, AnswerKind

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
def left():
    return Left(deep)


@pytest.fixture(scope='module')
def sent(left):
    """Killed in R, then sent to Q, and killed once more."""
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


def test_sent_below_it_asks_before_it_enters_the_container(tmp_path, left):
    killed = left.killed_at(left.first_in('A'), tmp_path / 'killed')
    oracle_state(killed, 'goto', 'OUTER/INNER/Q')
    told = killed.run(on_resume='ask', expert=Answers(tmp_path / 'asked', nobody))
    assert told['ended_by'] == 'kept'
    assert [each[1:3] for each in questions(tmp_path / 'asked')] == [['TOP', 'OUTER']]


def test_what_a_state_has_changed_inside_above_it_is_stored_as_its_container_ends(tmp_path):
    def build(diary, points):
        class Changes(Noted):
            def execute(self, userdata):
                top.userdata.notes.append('changed')
                return super().execute(userdata)

        class Looks(Noted):
            def execute(self, userdata):
                diary.write('finds', ' '.join(top.userdata.notes))
                return super().execute(userdata)

        inner = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
        with inner:
            inner.add('X', Changes('X', diary, points), ENDS)
        last = Looks('LAST', diary, points)
        top = around('IN', inner, dict(ENDS, succeeded='LAST'), LAST=last)
        top.userdata.notes = ['before']
        return top

    left = Left(build)
    killed = left.killed_at(left.first_in('LAST'), tmp_path / 'killed')
    assert killed.run()['outcome'] == 'succeeded'
    assert killed.diary.count('finds') == {'before changed': 2}


def test_sent_into_an_item_it_does_not_begin_the_next_one_there(tmp_path):
    """It is killed as the next item begins."""

    def build(diary, points):
        inner = smach.StateMachine(['succeeded', 'aborted'], ['done', 'item'], ['done'])
        with inner:
            for label, following in (('P', 'Q'), ('Q', 'succeeded')):
                state = Noted(label, diary, points, keys=('done', 'item'))
                inner.add(label, state, dict(ENDS, succeeded=following))
        top = around('ALL', each_of([1, 2], 'EACH', inner), ENDS)
        with top:
            top.add('FIRST', Noted('FIRST', diary, points, failures=1), {'succeeded': 'ALL'})
        top.set_initial_state(['FIRST'])
        return top

    def to_q(question, number):
        return Answer(AnswerKind.GOTO, state='Q', container='TOP/ALL/EACH', by='ann')

    left = Left(build, expert=Answers(tmp_path / 'asked', to_q), max_recoveries=0)
    ended = left.first_in('P2') - 1
    for point in range(ended - 2, ended + 1):
        killed = left.killed_at(point, tmp_path / 'killed')
        assert killed.run(max_recoveries=5)['outcome'] == 'succeeded'
        assert killed.diary.count('ends')['P2'] == 1, point
        assert not killed.diary.count('begins')['P1'], point
