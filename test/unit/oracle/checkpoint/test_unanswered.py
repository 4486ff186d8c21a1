"""Nobody says how a stored trial goes on: it is kept, and asked about again."""

import contextlib
import io
import json
import os
import signal

import pytest
from killed_machines import KilledMachine, Noted, around
from killed_trees import ALL, ENDS, flat, make, tree
from left_stores import Left
from waiting import wait_for

import smach
from smach_oracle.oracle import Expert, OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind
from smach_oracle.oracle.checkpoint.stored_tree import read_tree
from smach_oracle.store.state_command import main
from smach_oracle.store.store_file import StoreFile

BEFORE_THE_FIRST = {1, 2}  # TRIAL_START and CONTAINER_START
FIRST_STATE = 3
# points at which the branches of the Concurrence, and the first item of an Iterator, have ended
ALL_HAD_ENDED = {34, 46}


class Answers(Expert):
    """A fake expert that writes down what it is asked; `give(question, number)` answers."""

    def __init__(self, path, give):
        self._path, self._give, self._number = path, give, 0

    def ask(self, question, cancelled, progress):
        self._number += 1
        with self._path.open('a') as stream:
            stream.write(
                json.dumps(
                    [
                        question.question_id,
                        question.container_path,
                        question.failed_state,
                        question.reason,
                        question.fallback,
                    ]
                )
                + '\n'
            )
        return self._give(question, self._number)

    def run_interface(self, offer, question, cancelled, progress):
        return None


def questions(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def nobody(question, number):
    return None


def same_state(question, number):
    return Answer(AnswerKind.GOTO, state=question.failed_state, by='Ann')


def raises(question, number):
    raise RuntimeError('no line')


def last_moment(killed):
    store = StoreFile(killed.store, read_only=True)
    trial = store.trials()[-1]
    return trial, store.moments(trial.number)[-1]


def oracle_state(*arguments):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main([str(each) for each in arguments]) == 0
    return out.getvalue()


@pytest.fixture(scope='module')
def left():
    return Left(tree, on_resume='ask')


def some_points(left):
    """From the start of the trial on."""
    return sorted({*left.points(FIRST_STATE, 5)} | BEFORE_THE_FIRST | ALL_HAD_ENDED)


def test_killed_anywhere_the_trial_is_kept_until_somebody_decides(left, tmp_path):
    for point in some_points(left):
        killed = left.killed_at(point, tmp_path / 'killed')
        begun = killed.diary.count('begins')
        for _ in range(2):
            told = killed.run()
            assert told.get('outcome') is None and told['ended_by'] == 'kept', (point, told)
            assert killed.diary.count('begins') == begun, point
            trial, moment = last_moment(killed)
            assert (trial.ended, moment.kind) == (None, 'KEPT'), point
        told = killed.run(on_resume='recover')
        assert told['outcome'] == 'succeeded', (point, told)
        assert set(ALL) == set(killed.diary.count('ends')), point
        begun = killed.diary.count('begins')
        again = {name for name in begun if begun[name] > 1}
        assert len(again) <= 1 or again <= {'LEFT', 'M1', 'M2'}, (point, again)


def test_killed_anywhere_nothing_moves_before_the_answer(left, tmp_path):
    asked = tmp_path / 'asked'
    for point in some_points(left):
        killed = left.killed_at(point, tmp_path / 'killed')
        begun, moved = killed.diary.count('begins'), tmp_path / 'moved'

        def give(question, number, killed=killed, begun=begun, moved=moved):
            if number == 1 and killed.diary.count('begins') != begun:
                moved.touch()
            return same_state(question, number)

        asked.write_text('')
        told = killed.run(expert=Answers(asked, give))
        assert told['outcome'] == 'succeeded', (point, told)
        assert not moved.exists(), point
        assert set(ALL) == set(killed.diary.count('ends')), point
        states = [state for _, _, state, _, _ in questions(asked)]
        # two branches are asked about where both were under way
        assert len(states) == 1 or states and set(states) <= {'LEFT', 'M1', 'M2'}, (point, states)
        assert len(states) == len(set(states)), (point, states)
        begun = killed.diary.count('begins')
        again = {name for name in begun if begun[name] > 1}
        assert len(again) <= 1 or again <= {'LEFT', 'M1', 'M2'}, (point, again)


@pytest.mark.parametrize('give', [None, nobody, raises])
@pytest.mark.parametrize('on_no_answer', ['stop', {'goto': 'A'}, {'give_up': 'aborted'}])
def test_whatever_is_to_happen_without_an_answer_nothing_moves(tmp_path, give, on_no_answer):
    killed = KilledMachine(tmp_path, flat, on_resume='ask', on_no_answer=on_no_answer)
    killed.run(kill_at=8)
    begun = killed.diary.count('begins')
    expert = None if give is None else Answers(tmp_path / 'asked', give)
    told = killed.run(expert=expert)
    assert (told['outcome'], told['ended_by']) == (None, 'kept')
    assert killed.diary.count('begins') == begun
    (said,) = [text for text in told['log'] if 'nobody has said' in text]
    for part in (
        'The next start asks again',
        '`oracle_run --resume`',
        '`oracle_state {} drop`'.format(killed.store),
    ):
        assert part in said
    if give is not None:
        ((_, _, _, reason, fallback),) = questions(tmp_path / 'asked')
        assert 'the program was stopped' in reason
        assert fallback == 'stop, and keep the trial for the next start'


def test_it_is_asked_again_and_goes_on_with_the_answer(tmp_path):
    asked = tmp_path / 'asked'
    killed = KilledMachine(tmp_path, flat, on_resume='ask')
    killed.run(kill_at=8)
    for give, ended_by in ((nobody, 'kept'), (nobody, 'kept'), (same_state, 'outcome')):
        assert killed.run(expert=Answers(asked, give))['ended_by'] == ended_by
    ids = [each[0] for each in questions(asked)]
    assert len(set(ids)) == 3
    assert killed.run()['events'][0][0] == 'TRIAL_START'


# under which nobody else would be asked about a failure
ASKS_NOBODY = [
    {'policy': 'retry'},
    {'policy': 'step_back'},
    {'policy': 'restart'},
    {'budget': {'questions': 0}},
    {'policy': 'retry', 'budget': {'questions': 0}},
]


@pytest.mark.parametrize('settings', ASKS_NOBODY)
def test_how_a_trial_goes_on_is_asked_whatever_the_policy_and_the_budget(tmp_path, settings):
    asked = tmp_path / 'asked'
    killed = KilledMachine(tmp_path, flat, on_resume='ask', **settings)
    killed.run(kill_at=8)
    for give, ended_by in ((nobody, 'kept'), (nobody, 'kept'), (same_state, 'outcome')):
        told = killed.run(expert=Answers(asked, give))
        assert told['ended_by'] == ended_by
    # if B is not tried again, it fails: that costs a question, or the policy asks nobody
    assert len(questions(asked)) == 3 and told['outcome'] in ('succeeded', 'aborted')
    with contextlib.closing(StoreFile(killed.store, read_only=True)) as store:
        assert read_tree(store, 1).whole['budget'][1] == 0


@pytest.mark.parametrize('settings', ASKS_NOBODY)
def test_a_guarded_state_that_would_begin_again_is_asked_about_as_well(tmp_path, settings):
    asked = tmp_path / 'asked'
    killed = KilledMachine(tmp_path, flat, states={'A': {'on_retry': 'confirm'}}, **settings)
    killed.run(kill_at=8)
    for give, ended_by in ((nobody, 'kept'), (same_state, 'outcome')):
        told = killed.run(expert=Answers(asked, give), on_resume='state:A')
        assert told['ended_by'] == ended_by
        (said,) = [each for each in told['log'] if 'not repeated by itself: ' in each]
        assert said.endswith(': asking an expert, 300 s')
    assert [state for _, _, state, _, _ in questions(asked)] == ['A', 'A']


@pytest.mark.parametrize('settings', ASKS_NOBODY)
def test_killed_while_that_is_asked_it_is_open_again_under_its_id(tmp_path, settings):
    asked = tmp_path / 'asked'
    killed = KilledMachine(tmp_path, flat, on_resume='ask', **settings)
    killed.run(kill_at=8)
    killed.run(expert=Answers(asked, lambda *_: os.kill(os.getpid(), signal.SIGKILL)))
    killed.run(expert=Answers(asked, same_state), on_resume='recover')
    first, second = questions(asked)
    assert first[0] == second[0]


def test_killed_as_it_is_kept_it_asks_again(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat, on_resume='ask')
    killed.run(kill_at=8)
    begun = killed.diary.count('begins')
    points = killed.run()['points']
    for point in range(1, points + 1):
        assert killed.run(kill_at=point) is None
        assert killed.diary.count('begins') == begun
        assert last_moment(killed)[0].ended is None
    assert killed.run(on_resume='recover')['outcome'] == 'succeeded'


class Meets(smach.State):
    """Ends once the other one runs as well; the first time the program is killed then."""

    def __init__(self, name, diary):
        smach.State.__init__(self, ['succeeded', 'preempted'])
        self._name, self._diary = name, diary
        self._before = diary.count('begins')

    def execute(self, userdata):
        self._diary.write('begins', self._name)
        wait_for(lambda: self._have_met() or self.preempt_requested())
        if self.preempt_requested():
            self.service_preempt()
            return 'preempted'
        if not self._before:  # in the first process neither ends
            os.kill(os.getpid(), signal.SIGKILL)
        self._diary.write('ends', self._name)
        return 'succeeded'

    def _have_met(self):
        begun = self._diary.count('begins')
        return all(begun[name] > self._before[name] for name in ('LEFT', 'RIGHT'))


def meeting(diary, points):
    both = smach.Concurrence(
        ['succeeded', 'aborted'],
        'aborted',
        outcome_map={'succeeded': {'LEFT': 'succeeded', 'RIGHT': 'succeeded'}},
    )
    with both:
        both.add('LEFT', Meets('LEFT', diary))
        both.add('RIGHT', Meets('RIGHT', diary))
    return around('BOTH', both, {'succeeded': 'C', 'aborted': 'C'}, C=Noted('C', diary, points))


def test_in_a_concurrence_the_branch_that_was_answered_stops_as_well(tmp_path):
    killed = KilledMachine(tmp_path, meeting, on_resume='ask')
    assert killed.run() is None

    def give(question, number):
        if question.failed_state == 'LEFT':
            return same_state(question, number)
        assert wait_for(lambda: killed.diary.count('begins')['LEFT'] == 2)
        return None

    told = killed.run(expert=Answers(tmp_path / 'asked', give))
    assert (told['outcome'], told['ended_by']) == (None, 'kept')
    assert killed.diary.count('begins') == {'LEFT': 2, 'RIGHT': 1}
    assert not killed.diary.count('ends'), 'it is preempted, and does not run to its end'
    told = killed.run(on_resume='recover')
    assert told['outcome'] == 'succeeded'
    assert killed.diary.count('begins') == {'LEFT': 3, 'RIGHT': 2, 'C': 1}


def test_a_trial_that_is_kept_can_be_dropped_and_the_next_one_is_not_held_up(tmp_path):
    killed = KilledMachine(tmp_path, tree, on_resume='ask')
    killed.run(kill_at=46)
    assert killed.run()['ended_by'] == 'kept'
    assert 'kept, as nobody answered: TOP/' in oracle_state(killed.store)
    oracle_state(killed.store, 'drop')
    assert killed.run()['outcome'] == 'succeeded'


def test_in_one_process_a_kept_trial_goes_on_and_a_dropped_one_leaves_nothing(tmp_path):
    for drops in (False, True):
        killed = KilledMachine(make(tmp_path / 'killed'), tree, on_resume='ask')
        for point in (30, 34, 46):
            killed.run(kill_at=point)
        machine = OracleContainer.wrap(
            tree(killed.diary, lambda: None),
            name='TOP',
            settings={
                'checkpoint': killed.store,
                'on_resume': 'ask',
                'checkpoint_synchronous': 'OFF',
            },
        )
        assert machine.execute() is None
        assert not machine.preempt_requested()
        if drops:
            oracle_state(killed.store, 'drop')
            (tmp_path / 'killed' / 'diary').write_text('')
        else:
            machine.expert = Answers(tmp_path / 'asked', same_state)
        assert machine.execute() == 'succeeded'
        assert set(ALL) == set(killed.diary.count('ends'))


def wrapped(killed, **settings):
    return OracleContainer.wrap(
        flat(killed.diary, lambda: None),
        name='TOP',
        settings={'checkpoint': killed.store, 'checkpoint_synchronous': 'OFF', **settings},
    )


def test_the_active_state_of_a_trial_that_is_kept_is_the_one_in_which_it_stands(tmp_path):
    killed = KilledMachine(tmp_path, flat)
    killed.run(kill_at=4)
    machine = wrapped(killed, on_resume='ask')
    assert machine.execute() is None and machine.get_active_states() == ['A']


def test_a_preempt_before_it_goes_on_ends_the_state_in_doubt_and_is_no_failure(tmp_path):
    killed = KilledMachine(tmp_path, flat)
    killed.run(kill_at=4)
    machine, kinds = wrapped(killed, on_resume='recover'), []
    machine.events.observers.append(lambda event: kinds.append(event.kind.name))
    machine.request_preempt()
    assert machine.execute() == 'aborted'
    assert kinds[2:4] == ['PREEMPT', 'TRANSITION'] and 'FAILURE' not in kinds


def test_a_trial_whose_minutes_are_over_is_kept_and_nobody_is_asked(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), tree, on_resume='ask')
    killed.run(kill_at=30)
    asked = tmp_path / 'asked'
    asked.write_text('')
    told = killed.run(expert=Answers(asked, same_state), budget={'minutes': 1e-9})
    assert (told['outcome'], told['ended_by']) == (None, 'kept')
    assert not questions(asked)
    assert any("the trial's 1e-09 minutes are over" in line for line in told['log'])
    assert killed.run(expert=Answers(asked, same_state))['outcome'] == 'succeeded'


def test_a_failure_of_a_concurrence_whose_branches_had_ended_is_asked_about(tmp_path):
    def both(diary, points):
        inner = smach.Concurrence(
            ['succeeded', 'aborted'],
            'aborted',
            ['done'],
            ['done'],
            outcome_map={'succeeded': {'LEFT': 'aborted'}},
        )
        with inner:
            inner.add('LEFT', Noted('LEFT', diary, points))
            inner.add('RIGHT', Noted('RIGHT', diary, points))
        return around('BOTH', inner, ENDS)

    asked, tried = tmp_path / 'asked', 0
    left = Left(both, on_resume='ask')
    for point in left.points(5):
        killed = left.killed_at(point, tmp_path / 'killed')
        begun = killed.diary.count('begins')
        trial, moment = last_moment(killed)
        if sum(killed.diary.count('ends').values()) != 2 or moment.kind != 'TRANSITION':
            continue
        tried += 1
        asked.write_text('')
        told = killed.run(expert=Answers(asked, nobody))
        assert told['ended_by'] == 'kept', (point, told)
        assert killed.diary.count('begins') == begun
        assert questions(asked), point
    assert tried
