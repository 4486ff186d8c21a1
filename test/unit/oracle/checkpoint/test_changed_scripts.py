"""A machine that was killed goes on in a script whose states have other names or places."""

import contextlib
import functools
import io
import json
import os
import re
import signal

import pytest
from killed_machines import KilledMachine, Noted
from left_stores import Left

import smach
from smach_oracle.oracle import Answer, AnswerKind, Expert
from smach_oracle.oracle.checkpoint.stored_marks import _joined
from smach_oracle.oracle.records.visits import VisitMark
from smach_oracle.store.state_command import main
from smach_oracle.store.store_file import StoreFile

ENDS = {'succeeded': 'succeeded', 'aborted': 'aborted'}
MAP = {
    'A': 'START',
    'KITCHEN': 'GALLEY',
    'KITCHEN/LOOK': 'GALLEY/SEE',
    'BOTH/LEFT': 'BOTH/PORT',
    'BOTH/LAST': 'BOTH/END',
    'Z': 'Y',
}
OUTCOMES = ['succeeded', 'aborted']


def task(**names):
    """A builder of a task, some of whose labels are others. What the states note stays."""

    def build(diary, points):
        def name(label):
            return names.get(label, label)

        def noted(label, **options):
            return Noted(label, diary, points, **options)

        def pair(first, second):
            machine = smach.StateMachine(OUTCOMES, ['done'], ['done'])
            with machine:
                machine.add(name(first), noted(first), {'succeeded': name(second)})
                machine.add(name(second), noted(second), ENDS)
            return machine

        both = smach.Concurrence(
            OUTCOMES,
            'aborted',
            ['done'],
            ['done'],
            outcome_map={'succeeded': {name('LEFT'): 'succeeded', name('LAST'): 'succeeded'}},
        )
        with both:
            both.add(name('LEFT'), noted('LEFT'))
            both.add(name('LAST'), pair('M1', 'M2'))
        machine = smach.StateMachine(OUTCOMES)
        machine.userdata.done = []
        with machine:
            machine.add(name('A'), noted('A', failures=1), {'succeeded': name('KITCHEN')})
            machine.add(name('KITCHEN'), pair('LOOK', 'PICK'), {'succeeded': 'BOTH'})
            machine.add('BOTH', both, {'succeeded': name('Z')})
            machine.add(name('Z'), noted('Z'), ENDS)
        return machine

    return build


BEFORE = task()
RENAMED = task(A='START', KITCHEN='GALLEY', LOOK='SEE', LEFT='PORT', LAST='END', Z='Y')


def flat_before(diary, points, failures=0):
    machine = smach.StateMachine(OUTCOMES)
    machine.userdata.done = []
    with machine:
        for label, follows in (('A', 'B'), ('B', 'C'), ('C', 'D'), ('D', 'succeeded')):
            noted = Noted(label, diary, points, failures=failures if label == 'B' else 0)
            machine.add(label, noted, {'succeeded': follows})
    return machine


def nested_after(diary, points):
    """B and C stand in a machine of their own."""
    inner = smach.StateMachine(OUTCOMES, ['done'], ['done'])
    with inner:
        inner.add('B', Noted('B', diary, points), {'succeeded': 'C'})
        inner.add('C', Noted('C', diary, points), ENDS)
    machine = smach.StateMachine(OUTCOMES)
    machine.userdata.done = []
    with machine:
        machine.add('A', Noted('A', diary, points), {'succeeded': 'IN'})
        machine.add('IN', inner, {'succeeded': 'D'})
        machine.add('D', Noted('D', diary, points), ENDS)
    return machine


@pytest.fixture
def folder(tmp_path):
    return tmp_path


@functools.lru_cache(maxsize=None)
def left(before):
    return Left(before)


def killed_while_it_runs(folder, before, name):
    """Leave what a machine leaves that is killed while a state runs for the first time."""
    left(before).killed_at(left(before).first_in(name), folder)


def both_scripts(folder, before, after, **settings):
    return KilledMachine(folder, before), KilledMachine(folder, after, **settings)


def test_renamed_states_go_on_wherever_it_was_killed(folder):
    whole = KilledMachine(folder, RENAMED).run()
    for point in [*left(BEFORE).points(), left(BEFORE).told['points']]:
        left(BEFORE).killed_at(point, folder)
        after = KilledMachine(folder, RENAMED, resume_map=MAP)
        told = after.run()
        assert told.get('outcome') == 'succeeded', (point, told)
        begun, ended = after.diary.count('begins'), after.diary.count('ends')
        # A fails the first time in each process, and may be in doubt
        most = dict.fromkeys(begun, 2)
        most['A'] = 4
        assert all(begun[name] <= most[name] for name in begun), (point, begun)
        assert set(ended) == {'A', 'LOOK', 'PICK', 'LEFT', 'M1', 'M2', 'Z'}, point
        if begun['A'] == 2:  # it had failed once, and then succeeded: that is kept
            assert told['rates'] == whole['rates'], point


def told_at_each_point(folder, before, after_it, names):
    """Yield what the changed script tells, killed before at each point but the last one."""
    for point in left(before).points():
        left(before).killed_at(point, folder)
        after = KilledMachine(folder, after_it, resume_map=names)
        told = after.run()
        assert told.get('outcome') == 'succeeded', (point, told)
        begun = after.diary.count('begins')
        assert sum(begun[name] > 1 for name in begun) <= 1 and max(begun.values()) <= 2, point
        yield point, told


def test_what_has_moved_into_another_container_goes_on_there(folder):
    names = {'B': 'IN/B', 'C': 'IN/C'}
    for point, told in told_at_each_point(folder, flat_before, nested_after, names):
        assert told['done'][-1] == 'D', point


def test_what_has_moved_out_of_a_container_goes_on_there(folder):
    names = {'IN': 'B', 'IN/B': 'B', 'IN/C': 'C'}
    assert list(told_at_each_point(folder, nested_after, flat_before, names))


class _Noting(Expert):
    """Notes the id of each question in a file, and kills the program or sends it on."""

    def __init__(self, path, dies):
        self._path, self._dies = path, dies

    def ask(self, question, cancelled, progress):
        with open(self._path, 'a') as file:
            file.write('{} {}\n'.format(question.question_id, question.failed_state))
        if self._dies:
            os.kill(os.getpid(), signal.SIGKILL)
        return Answer(AnswerKind.GOTO, state=question.failed_state)


def test_the_question_about_a_moved_state_is_open_again(folder):
    before, after = both_scripts(
        folder,
        functools.partial(flat_before, failures=1),
        nested_after,
        resume_map={'B': 'IN/B', 'C': 'IN/C'},
    )
    asked = str(folder / 'asked')
    assert before.run(expert=_Noting(asked, True), max_recoveries=0) is None
    assert after.run(expert=_Noting(asked, False), max_recoveries=0)['outcome'] == 'succeeded'
    with open(asked) as file:
        first, again = file.read().splitlines()
    assert first.endswith(' B') and again == first
    assert after.diary.count('begins')['B'] == 2, 'it was asked about before B ran again'


def test_a_moved_state_in_doubt_is_not_repeated_where_it_must_not_be(folder):
    after = KilledMachine(
        folder,
        nested_after,
        resume_map={'B': 'IN/B', 'C': 'IN/C'},
        states={'IN/C': {'on_retry': 'never'}},
    )
    killed_while_it_runs(folder, flat_before, 'C')
    after.run()
    assert after.diary.count('begins')['C'] == 1


def test_the_script_that_went_on_is_no_changed_one_later(folder):
    before, after = both_scripts(folder, BEFORE, RENAMED, resume_map=MAP)
    before.run(kill_at=left(BEFORE).told['points'] // 2)
    after.run(kill_at=2)
    told = KilledMachine(folder, RENAMED).run()  # it needs no map any more
    assert told.get('outcome') == 'succeeded', told


def test_killed_once_more_it_still_goes_on(folder):
    """The names are kept from the first moment of the second part on."""
    for point in left(BEFORE).points(5, 7):
        left(BEFORE).killed_at(point, folder)
        after = KilledMachine(folder, RENAMED, resume_map=MAP)
        for _ in range(3):
            after.run(kill_at=1)  # at its RESUMED event
        told = after.run()
        assert told['outcome'] == 'succeeded', (point, told)


def test_an_earlier_moment_of_before_can_still_be_gone_back_to(folder):
    before, after = both_scripts(folder, BEFORE, RENAMED, resume_map=MAP)
    before.run(kill_at=40)
    after.run(kill_at=4)
    store = StoreFile(after.store, read_only=True)
    first = next(
        each for each in store.moments(1) if each.kind == 'STATE_START' and each.label == 'PICK'
    )
    told = after.run(resume_from=first.number)
    assert told['outcome'] == 'succeeded'
    assert after.diary.count('begins')['LOOK'] == 1
    assert after.diary.count('begins')['PICK'] >= 2


@pytest.mark.parametrize(
    'names, why',
    [
        (
            {'NOWHERE': 'Y'},
            "checkpoint.map.NOWHERE: 'NOWHERE' is not allowed; allowed: a state of the "
            'machine that was stopped: A, BOTH',
        ),
        (
            {'A': 'NOWHERE'},
            "checkpoint.map.A: 'NOWHERE' is not allowed; allowed: a state of the machine: BOTH",
        ),
        ({'KITCHEN/A': 'Y'}, "checkpoint.map.KITCHEN/A: 'KITCHEN/A'"),
    ],
)
def test_a_label_that_is_not_there_is_named_before_anything_moves(folder, names, why):
    before, after = both_scripts(folder, BEFORE, RENAMED)
    before.run(kill_at=12)
    begun = before.diary.count('begins')
    assert why in after.run(resume_map=names)['error']
    assert before.diary.count('begins') == begun
    assert after.run(resume_map=MAP)['outcome'] == 'succeeded'


def test_without_a_map_a_person_decides_also_where_its_state_is_gone(folder):
    for point in left(BEFORE).points(4, 5):
        before, after = left(BEFORE).killed_at(point, folder), KilledMachine(folder, RENAMED)
        begun = before.diary.count('begins')
        told = after.run()
        assert told.get('ended_by') == 'kept', (point, told)  # nobody was there to ask
        assert before.diary.count('begins') == begun, point


def test_a_map_that_leaves_out_its_state_has_a_person_decide(folder):
    names = {old: new for old, new in MAP.items() if old != 'KITCHEN/LOOK'}
    before, after = both_scripts(folder, BEFORE, RENAMED, resume_map=names)
    killed_while_it_runs(folder, BEFORE, 'LOOK')
    begun = before.diary.count('begins')
    told = after.run()
    assert told['ended_by'] == 'kept'
    assert before.diary.count('begins') == begun
    # that has ended well, and the state at which it begins has not failed either
    assert not [line for line in told['log'] if ' failed' in line]
    assert [line for line in told['log'] if 'which is not there any more' in line]


def test_the_question_says_how_old_it_is_and_what_has_changed(folder):
    after = KilledMachine(folder, nested_after)
    killed_while_it_runs(folder, flat_before, 'D')
    noted = folder / 'question'

    class Noting(Expert):
        def ask(self, question, cancelled, progress):
            noted.write_text(
                json.dumps(
                    [
                        question.failed_state,
                        question.reason + question.text,
                        question.userdata['done'],
                    ]
                )
            )

        def run_interface(self, offer, question, cancelled, progress):
            return None

    told = after.run(expert=Noting())
    assert noted.exists(), told
    state, text, done = json.loads(noted.read_text())
    assert (state, done) == ('D', ['A', 'B', 'C'])
    assert re.search(r'the program was stopped \d+ s ago', text)
    for change in (
        'container IN is new',
        'state B is gone',
        'state C is gone',
        'state IN is new',
        'state A: succeeded led to B, and leads to IN',
    ):
        assert change in text


def test_other_keys_of_a_state_are_a_change(folder):
    def other_keys(diary, points):
        machine = flat_before(diary, points)
        machine._states['D'].register_input_keys(['tool'])
        return machine

    killed_while_it_runs(folder, flat_before, 'B')
    told = KilledMachine(folder, other_keys).run()
    assert [line for line in told['log'] if 'state D: keys' in line], told['log']


@pytest.mark.parametrize(
    'names, unknown',
    [
        ({'A': 'Z', 'KITCHEN/LOOK': 'KITCHEN/PICK'}, []),
        ({'A': 'Zz', 'KITCHEN/LOK': 'KITCHEN/PICK'}, ['KITCHEN/LOK', 'Zz']),
    ],
)
def test_in_the_same_script_a_map_is_of_no_effect_and_unknown_names_are_named(
    folder, names, unknown
):
    before, after = both_scripts(folder, BEFORE, BEFORE, resume_map=names)
    before.run(kill_at=14)
    told = after.run()
    assert told['outcome'] == 'succeeded'
    log = told['log']
    named = [text for text in log if 'checkpoint.map' in text]
    assert [
        re.search(
            "names '(.*)', which is not a state of the machine, and was not one "
            'before; there are A, BOTH',
            text,
        ).group(1)
        for text in named
    ] == unknown
    goes_on = next(index for index, text in enumerate(log) if ' goes on; its program' in text)
    assert all(log.index(text) < goes_on for text in named)


def test_a_map_that_is_not_needed_any_more_is_not_warned_of(folder):
    before, after = both_scripts(folder, BEFORE, RENAMED, resume_map=MAP)
    before.run(kill_at=14)
    after.run(kill_at=6)
    told = after.run()
    assert told['outcome'] == 'succeeded'
    assert not [text for text in told['log'] if 'checkpoint.map' in text]


def test_oracle_state_tells_the_new_names(folder):
    before, after = both_scripts(folder, BEFORE, RENAMED, resume_map=MAP)
    killed_while_it_runs(folder, BEFORE, 'LOOK')
    assert 'TOP/KITCHEN/LOOK was under way' in shown(before.store)
    after.run(kill_at=1)
    assert 'TOP/GALLEY/SEE was under way' in shown(before.store)
    assert 'KITCHEN' not in shown(before.store)
    assert main([after.store, 'goto', 'GALLEY/PICK']) == 0
    told = after.run()
    assert told['outcome'] == 'succeeded'
    assert after.diary.count('begins')['LOOK'] == 1


def shown(store):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main([store, 'show']) == 0
    return out.getvalue()


@pytest.mark.parametrize('first_done', [False, True])
def test_of_two_states_that_are_one_now_either_may_have_been_done(first_done):
    one, other = (VisitMark(3, 1, first_done, False), VisitMark(2, 4, not first_done, False))
    joined = _joined(one, other)
    assert (joined.reached, joined.executed, joined.done) == (3, 4, True)
