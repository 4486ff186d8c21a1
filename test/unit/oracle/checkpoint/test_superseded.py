"""A person does by hand what the program was stopped at: SUPERSEDE of whatever is in doubt."""

import json
import os
import signal
import threading

import pytest
from killed_machines import KilledMachine, Noted, around, each_of
from killed_trees import ENDS, flat, make, tree
from left_stores import Left

import smach
from smach_oracle.oracle import Expert
from smach_oracle.oracle.asking.question import Answer, AnswerKind

FAILING = {'I': 1, 'X': 1, 'LEFT': 1, 'M2': 1, 'J': 1, 'B': 1}


class ByHand(Expert):
    """Supersedes all that it is asked about, and writes down what that was."""

    def __init__(self, path):
        self._path = path

    def ask(self, question, cancelled, progress):
        with self._path.open('a') as stream:
            stream.write(
                json.dumps('{}/{}'.format(question.container_path, question.failed_state)) + '\n'
            )
        return Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='ann')


def asked(path):
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def failing_tree(diary, points):
    """The tree of everything, in which a state of each kind of container fails once."""
    machine = tree(diary, points)

    def prepare(container):
        for label, state in container.get_children().items():
            if isinstance(state, smach.Container):
                prepare(state)
            elif label in FAILING:
                state._failures = FAILING[label]

    prepare(machine)
    return machine


@pytest.fixture(
    scope='module',
    params=[
        (tree, {}),
        (failing_tree, {'max_recoveries': 0}),
        (tree, {'on_retry': 'never'}),
        (failing_tree, {'on_retry': 'confirm'}),
    ],
)
def left(request, tmp_path_factory):
    build, settings = request.param
    return Left(build, expert=ByHand(tmp_path_factory.mktemp('left') / 'asked'), **settings)


@pytest.mark.parametrize('on_resume', ['ask', 'recover'])
def test_killed_anywhere_what_is_superseded_ends_the_trial_well_and_does_not_run_again(
    tmp_path, left, on_resume
):
    for point in left.points(3, 4):
        killed = left.killed_at(point, tmp_path / 'killed')
        begun, path = killed.diary.count('begins'), tmp_path / 'killed' / 'asked'
        told = killed.run(expert=ByHand(path), on_resume=on_resume)
        assert told.get('outcome') == 'succeeded', (point, told)
        first = asked(path)[:1]
        label = first[0].rpartition('/')[2] if first else ''
        if label and label not in ('I', 'J', 'K') and on_resume == 'ask':
            assert killed.diary.count('begins')[label] == begun[label], (point, first)


def rates(told):
    return {state: row for _, state, *row in told['rates']}


def test_a_failure_of_before_stays_in_the_rate_of_the_state_in_doubt(tmp_path):
    """B fails once, is tried again, and is in doubt then."""
    left = Left(flat, on_resume='ask')
    killed = left.killed_at(left.first_in('B', times=2), tmp_path / 'killed')
    told = killed.run(expert=ByHand(tmp_path / 'asked'))
    assert (told['outcome'], asked(tmp_path / 'asked')) == ('succeeded', ['TOP/B'])
    assert rates(told)['B'] == [0, 1]


def failing_twice(diary, points):
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    with machine:
        for label, following in (('A', 'B'), ('B', 'succeeded')):
            noted = Noted(label, diary, points, failures=1)
            smach.StateMachine.add(label, noted, dict(ENDS, succeeded=following))
    return machine


def test_wherever_it_is_killed_a_failure_is_taken_back_once(tmp_path):
    """Also between the answer and the move to the next state, or to the end."""
    left = Left(failing_twice, expert=ByHand(tmp_path / 'asked'), max_recoveries=0)
    for point in left.points():
        killed = left.killed_at(point, tmp_path / 'killed')
        told = killed.run(expert=ByHand(tmp_path / 'killed' / 'asked'))
        assert told.get('outcome') == 'succeeded', (point, told)
        assert rates(told) == {'A': [0, 0], 'B': [0, 0]}, point


class Last(smach.State):
    """Waits for another state to end. The first program is killed in it."""

    def __init__(self, diary, beside):
        smach.State.__init__(self, ['succeeded', 'aborted'])
        self._diary, self._beside = diary, beside

    def execute(self, userdata):
        assert self._beside.wait(20)
        self._diary.write('begins', 'LAST')
        if self._diary.count('begins')['LAST'] == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        return 'succeeded'


def beside_last(diary, points):
    """LEFT fails and ends while LAST still runs."""
    ended = threading.Event()
    both = smach.Concurrence(
        ['succeeded', 'aborted'],
        'aborted',
        ['done'],
        ['done'],
        outcome_map={'succeeded': {'LEFT': 'succeeded', 'LAST': 'succeeded'}},
        child_termination_cb=lambda outcomes: outcomes['LEFT'] == 'succeeded' and ended.set(),
    )
    with both:
        smach.Concurrence.add('LEFT', Noted('LEFT', diary, points, failures=1))
        smach.Concurrence.add('LAST', Last(diary, ended))
    return around('BOTH', both, ENDS)


def items_before_last(diary, points):
    """Of two items the second one fails."""

    class Failing(Noted):
        def execute(self, userdata):
            return 'aborted' if userdata.item == 2 else super().execute(userdata)

    ended = threading.Event()
    ended.set()
    failing = Failing('LEFT', diary, points, keys=('done', 'item'))
    items = each_of([1, 2], 'LEFT', failing)
    return around('ITEMS', items, dict(ENDS, succeeded='LAST'), LAST=Last(diary, ended))


@pytest.mark.parametrize(
    'build, rate', [(beside_last, [0, 0]), (items_before_last, [1, 0])], ids=['branch', 'item']
)
def test_what_is_superseded_beside_others_is_not_asked_about_again(tmp_path, build, rate):
    killed = KilledMachine(tmp_path, build, max_recoveries=0, on_resume='recover')
    assert killed.run(expert=ByHand(tmp_path / 'first')) is None
    told = killed.run(expert=ByHand(tmp_path / 'again'))
    assert told.get('outcome') == 'succeeded', told
    assert [path for path in asked(tmp_path / 'first') if path.endswith('/LEFT')]
    assert not [path for path in asked(tmp_path / 'again') if path.endswith('/LEFT')]
    assert rates(told)['LEFT'] == rate


def test_a_failure_that_was_asked_about_is_taken_back_once(tmp_path):
    """The program is killed while the question is open. The answer comes in the next one."""
    killed = KilledMachine(tmp_path, flat, max_recoveries=0)
    point = 0
    while not asked(tmp_path / 'asked'):
        make(tmp_path)
        point += 1
        killed.run(kill_at=point, expert=ByHand(tmp_path / 'asked'))
    told = killed.run(expert=ByHand(tmp_path / 'asked'))
    assert (told['outcome'], set(asked(tmp_path / 'asked'))) == ('succeeded', {'TOP/B'})
    assert rates(told).get('B', [0, 0]) == [0, 0]
    assert killed.diary.count('begins')['B'] == 1


def test_a_state_that_had_not_begun_is_not_done_by_the_oracle_once_a_person_has_done_it(tmp_path):
    """Killed before POUR. A person pours. CARRY keeps failing, and the step back is asked about."""

    def pouring(diary, points):
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        with machine:
            for label, following, failures in (
                ('LOOK', 'POUR', 0),
                ('POUR', 'CARRY', 0),
                ('CARRY', 'succeeded', 9),
            ):
                smach.StateMachine.add(
                    label, Noted(label, diary, points, failures), dict(ENDS, succeeded=following)
                )
        return machine

    left = Left(pouring, on_resume='ask', prior=0.5, states={'POUR': {'on_retry': 'confirm'}})
    point, path = 0, tmp_path / 'killed' / 'asked'
    while not asked(path) or asked(path)[0] != 'TOP/POUR':
        point += 1
        killed = left.killed_at(point, tmp_path / 'killed')
        if not killed.diary.count('begins')['POUR']:
            killed.run(expert=ByHand(path))
    # CARRY is tried again by itself, but LOOK, from which the way leads to POUR, is not
    assert asked(path) == ['TOP/POUR', 'TOP/CARRY']
    assert killed.diary.count('begins') == {'LOOK': 1, 'CARRY': 2}
