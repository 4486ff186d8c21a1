"""A machine that was killed goes on where it stood."""

import contextlib
import os
import re

import pytest
from killed_machines import KilledMachine, Noted
from killed_trees import ALL, ENDS, flat, make, tree
from left_stores import Left

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.checkpoint.stored_tree import read_tree
from smach_oracle.store.store_file import StoreFile


@pytest.fixture(scope='module')
def left():
    return Left(tree)


def test_killed_at_every_point_each_state_ends_and_only_the_one_in_doubt_runs_again(left, tmp_path):
    """A kill teaches nothing either: neither the state in doubt nor any other state."""
    for point in left.points():
        killed = left.killed_at(point, tmp_path / 'killed')
        told = killed.run()
        assert told.get('outcome') == 'succeeded', (point, told)
        begun, ended = killed.diary.count('begins'), killed.diary.count('ends')
        assert not set(ALL).difference(ended), point
        # before the two branches one state is in doubt; beside each other two can be
        again = {name for name in begun if begun[name] > 1}
        assert len(again) <= 1 or again <= {'LEFT', 'M1', 'M2'}, (point, again)
        assert all(begun[name] <= 2 for name in begun), point
        assert [name for name in told['done'] if name not in ('LEFT', 'M1', 'M2')] == [
            name for name in ALL if name not in ('LEFT', 'M1', 'M2')
        ], point
        assert told['rates'] == left.told['rates'], point


def test_killed_again_and_again_it_comes_to_its_end(tmp_path):
    # on a busy machine one branch may be in doubt each time, while the other one runs
    killed = KilledMachine(make(tmp_path / 'killed'), tree, max_recoveries=100)
    told, times = None, 0
    while told is None:
        told = killed.run(kill_at=16)
        times += 1
        assert times < 100
    assert times > 5
    assert told['outcome'] == 'succeeded'
    assert set(ALL) == set(killed.diary.count('ends'))


def test_killed_while_it_resumes_it_still_stands_where_it_stood(left, tmp_path):
    """A second kill comes before anything has been done: no state runs again that had ended."""
    seconds = (1, 3, 4, 6)
    for point in left.points(10, 14):
        twice = Left(tree, begins=left.folder(point), points=seconds)
        for second in seconds:
            killed = twice.killed_at(second, tmp_path / 'killed')
            told = killed.run()
            assert told.get('outcome') == 'succeeded', (point, second, told)
            begun = killed.diary.count('begins')
            again = {name for name in begun if begun[name] > 1}
            assert len(again) <= 1 or again <= {'LEFT', 'M1', 'M2'}, (point, second, again)
            assert len(told['done']) >= len(ALL) - 2, (point, second)


@pytest.mark.parametrize('point, is_stored', [(10, False), (11, True)])
def test_a_failure_is_stored_once_it_is_counted(tmp_path, point, is_stored):
    """At its event it is in doubt as before, at the transition to the oracle it is in the rates."""
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    assert killed.run(kill_at=point) is None
    told = killed.run()
    of_b = [name for name, _, state in told['events'] if state == 'B']
    rates = {state: row for _, state, *row in told['rates']}
    # in each process the state fails once
    assert (of_b[:2], rates['B']) == (
        (['CONTAINER_START', 'TRANSITION'], [1, 2])
        if is_stored
        else (['CONTAINER_START', 'FAILURE'], [1, 1])
    )


def test_a_trial_that_has_told_its_end_is_not_resumed(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    whole = KilledMachine(make(tmp_path / 'whole'), flat).run()
    assert whole['events'][-1][0] == 'TRIAL_END'
    assert killed.run(kill_at=whole['points']) is None
    assert killed.run()['events'][0][0] == 'TRIAL_START'


@pytest.mark.parametrize(('before_end', 'outcome'), [(0, 'succeeded'), (4, 'restarted')])
def test_of_a_trial_that_does_not_go_on_the_store_says_how_it_ended(tmp_path, before_end, outcome):
    """Killed between the end of its machine and its own, or given up for a new one."""
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    whole = KilledMachine(make(tmp_path / 'whole'), flat).run()
    assert killed.run(kill_at=whole['points'] - before_end) is None
    killed.run(on_resume='restart' if outcome == 'restarted' else 'recover')
    first, second = StoreFile(killed.store, read_only=True).trials('TOP')
    assert (first.outcome, second.outcome) == (outcome, 'succeeded')


def test_equal_values_of_two_keys_do_not_become_one_object(tmp_path):
    class Adds(smach.State):
        def __init__(self):
            smach.State.__init__(self, ['succeeded', 'aborted'], ['done'], ['done'])

        def execute(self, userdata):
            userdata.done.append('ADDS')
            return 'succeeded'

    def two_lists(diary, points):
        machine = flat(diary, points)
        machine.userdata.done, machine.userdata.other = ['C'], ['C']
        with machine:
            smach.StateMachine.add('ADDS', Adds(), {'succeeded': 'TELL'})
            smach.StateMachine.add('TELL', Noted('TELL', diary, points, keys=('done',)), ENDS)
        machine.set_initial_state(['ADDS'])
        return machine

    killed = KilledMachine(make(tmp_path / 'killed'), two_lists)
    assert killed.run(kill_at=3) is None  # as ADDS begins
    killed.run(kill_at=0)
    seen = read_tree(StoreFile(killed.store, read_only=True), 1)
    assert seen.container('TOP').keys['done'][:2] == ['C', 'ADDS']
    assert seen.container('TOP').keys['other'] == ['C']


def test_no_number_of_an_event_is_used_twice(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=8)
    kinds = killed.run()['events']
    assert kinds[0][0] == 'RESUMED'
    assert kinds[0][1] >= 8
    assert [seq for _, seq, _ in kinds] == sorted({seq for _, seq, _ in kinds})


def test_the_state_in_doubt_is_a_failure_of_its_own_kind(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=4)
    events = killed.run()['events']
    assert [name for name, _, state in events if state == 'A'][:4] == [
        'CONTAINER_START',
        'FAILURE',
        'TRANSITION',
        'DECISION',
    ]


def test_a_state_that_is_never_repeated_is_not(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat, states={'A': {'on_retry': 'never'}})
    killed.run(kill_at=4)
    assert 'could' not in str(killed.run())
    assert killed.diary.count('begins')['A'] == 1


def test_a_finished_trial_is_not_resumed(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    assert killed.run()['outcome'] == 'succeeded'
    assert killed.run()['events'][0][0] == 'TRIAL_START'
    assert killed.diary.count('begins')['A'] == 2


def test_asked_first_nothing_moves_without_an_expert(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), tree, on_resume='ask')
    for point in (6, 30):
        killed.run(kill_at=point)
        begun = killed.diary.count('begins')
        killed.run()
        assert killed.diary.count('begins') == begun
        make(tmp_path / 'killed')


def test_restart_begins_anew_and_says_so(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=12)
    told = killed.run(on_resume='restart')
    assert any('a new one begins: checkpoint.on_resume is restart' in line for line in told['log'])
    assert told['events'][0][0] == 'TRIAL_START' and told['done'] == ['A', 'B', 'C']
    assert killed.diary.count('begins')['A'] == 2


def test_it_can_be_sent_to_a_state(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), tree)
    killed.run(kill_at=40)
    assert killed.diary.count('begins')['Y'] == killed.diary.count('begins')['X'] == 1
    told = killed.run(on_resume='state:XY/Y')
    assert told['outcome'] == 'succeeded'
    assert killed.diary.count('begins')['Y'] == 2
    assert killed.diary.count('begins')['X'] == 1


def test_a_state_that_is_not_there_is_named(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=12)
    assert "on_resume: 'state:NOWHERE'" in killed.run(on_resume='state:NOWHERE')['error']
    assert killed.run()['outcome'] == 'succeeded'


def test_the_log_says_in_which_state_it_goes_on(left, tmp_path):
    for machine, name, goes_on in (
        (Left(flat), 'B', ['B']),
        (left, 'Y', ['XY', 'Y']),
        (left, 'I1', ['PLAIN']),
    ):
        killed = machine.killed_at(machine.first_in(name), tmp_path / 'killed')
        log = killed.run()['log']
        assert any(
            re.match('TOP: trial .* goes on; its program was stopped [0-9]+ s ago', text)
            for text in log
        )
        said = [
            re.match("State machine going on in state '(.*)' with userdata: ", text) for text in log
        ]
        assert [each.group(1) for each in said if each] == goes_on
        begins = [text for text in log if 'starting in initial state' in text]
        if not os.environ.get('SMACH_UPSTREAM'):  # its engine says so before it can be put right
            assert not [text for text in begins if "'A'" in text or "'X'" in text], name


def test_a_changed_script_is_not_guessed_about(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=8)

    def changed(diary, points):
        machine = flat(diary, points)
        with machine:
            smach.StateMachine.add('D', Noted('D', diary, points), ENDS)
        return machine

    other = KilledMachine(tmp_path / 'killed', changed)
    begun = killed.diary.count('begins')
    told = other.run()
    assert told['outcome'] is None and told['ended_by'] == 'kept'  # nobody was there to ask
    assert killed.diary.count('begins') == begun


@pytest.mark.parametrize('value', ['now', 'state:', 'state: ', 3, 'ask:A'])
def test_what_on_resume_may_be_is_said(tmp_path, value):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    assert 'ask, recover, restart or state:LABEL' in killed.run(on_resume=value)['error']


def moments_of(killed):
    store = StoreFile(killed.store, read_only=True)
    return [each for trial in store.trials() for each in store.moments(trial.number)]


def test_it_goes_on_from_an_earlier_moment(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=20)
    assert killed.diary.count('begins')['B'] == 2  # it had failed once
    before = moments_of(killed)
    first = next(each for each in before if each.label == 'B' and each.kind == 'STATE_START')
    told = killed.run(resume_from=first.number)
    assert told['done'] == ['A', 'B', 'C']
    assert any(
        ' goes on from moment {}; its program was'.format(first.number) in line
        for line in told['log']
    )
    assert killed.diary.count('begins')['A'] == 1
    after = moments_of(killed)
    assert after[: len(before)] == before  # those behind it stay
    assert after[len(before)].after == first.number
    assert min(seq for _, seq, _ in told['events']) > max(each.seq for each in before)


def test_from_an_earlier_moment_it_is_sent_to_no_other_state(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=20)
    first = next(each for each in moments_of(killed) if each.kind == 'STATE_START')
    told = killed.run(resume_from=first.number, on_resume='state:C')
    assert told['done'] == ['A', 'B', 'C'] and killed.diary.count('begins')['A'] == 2


def test_where_it_goes_on_with_its_last_moment_each_follows_the_one_before_it(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=12)
    assert killed.run()['events'][0][0] == 'RESUMED'
    assert {each.after for each in moments_of(killed)} == {None}


def test_killed_once_more_it_goes_on_behind_the_moment_that_it_was_sent_to(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=20)
    first = next(each for each in moments_of(killed) if each.kind == 'STATE_START')
    killed.run(kill_at=1, resume_from=first.number)  # at its RESUMED event
    assert moments_of(killed)[-1].kind == 'RESUMED'
    assert killed.run()['done'] == ['A', 'B', 'C']
    assert killed.diary.count('begins')['A'] == 2


def test_a_moment_that_is_not_there_is_refused(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), flat)
    killed.run(kill_at=12)
    begun = killed.diary.count('begins')
    assert 'checkpoint.from: 999' in killed.run(resume_from=999)['error']
    assert killed.diary.count('begins') == begun
    assert killed.run()['outcome'] == 'succeeded'
    ended = moments_of(killed)[2].number
    assert 'checkpoint.from: {}'.format(ended) in killed.run(resume_from=ended)['error']


def test_what_is_spent_is_stored_where_it_has_changed(tmp_path):
    killed = KilledMachine(make(tmp_path / 'killed'), tree)
    killed.run(kill_at=60)
    store = StoreFile(killed.store, read_only=True)
    facts = [fact for fact in store.facts(1) if fact.name in ('questions', 'budget')]
    moments = len(store.moments(1))
    assert moments > 20
    assert len({fact.name for fact in facts}) == 2
    for name in ('questions', 'budget'):
        values = [fact.value.text for fact in facts if fact.name == name]
        assert all(one != other for one, other in zip(values, values[1:])), name
    assert len(facts) < moments  # the time of the budget is in whole seconds


def test_a_container_that_comes_under_way_is_stored_once_the_machine_is_wrapped_again(tmp_path):
    def machine_of(label, state, **ends):
        machine = smach.StateMachine(['done'])
        with machine:
            smach.StateMachine.add(label, state, ends or {'done': 'done'})
        return machine

    def grow(userdata):
        with kitchen:
            smach.StateMachine.add('IN', machine_of('X', nothing), {'done': 'done'})
        kitchen.set_initial_state(['IN'])
        OracleContainer.wrap(top)
        return 'done'

    nothing = smach.CBState(lambda _: 'done', outcomes=['done'])
    kitchen = machine_of('A', nothing)
    top = machine_of('GROW', smach.CBState(grow, outcomes=['done']), done='KITCHEN')
    with top:
        smach.StateMachine.add('KITCHEN', kitchen, {'done': 'done'})
    path = str(tmp_path / 'robot.db')
    OracleContainer.wrap(top, name='TOP', settings={'checkpoint': path})
    assert top.execute() == 'done'
    with contextlib.closing(StoreFile(path, read_only=True)) as store:
        grown = read_tree(store, 1).container('TOP/KITCHEN/IN')
    assert (grown.execution, grown.at) == (1, ['done', 'ended'])


def test_of_a_machine_that_has_ended_all_userdata_are_stored_as_they_were_then(tmp_path):
    """Also a value that was changed inside, by a function that has told nobody of it."""

    def changes(userdata):
        machine.userdata.notes.append('changed')
        return 'done'

    machine = smach.StateMachine(['done'])
    machine.userdata.notes = ['before']
    with machine:
        smach.StateMachine.add('A', smach.CBState(changes, outcomes=['done']))
    path = str(tmp_path / 'robot.db')
    OracleContainer.wrap(machine, name='TOP', settings={'checkpoint': path})
    assert machine.execute() == 'done'
    with contextlib.closing(StoreFile(path, read_only=True)) as store:
        assert read_tree(store, 1).container('TOP').keys['notes'] == ['before', 'changed']
