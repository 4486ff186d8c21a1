"""Killed as it tries one way after the other, a machine goes on with those that are left."""

import contextlib
import json
import os
import sqlite3

import pytest
from killed_machines import KilledMachine, Noted, in_a_process
from killed_trees import make
from left_stores import Left
from machines import Scripted, Watched, chain_of

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.checkpoint.container_facts import ContainerFacts
from smach_oracle.oracle.checkpoint.stored_tree import read_tree
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.recovery import options
from smach_oracle.store.renaming import Renaming
from smach_oracle.store.rows import StoredFact, StoredValue
from smach_oracle.store.store_file import StoreFile

FAILURES = 4  # of PICK, in all processes together


class FailingAtFirst(Noted):
    """Fails the first times that it comes to its end, in whichever process."""

    def execute(self, userdata):
        super().execute(userdata)
        return 'aborted' if self._diary.count('ends')[self._name] <= FAILURES else 'succeeded'


def fetch(diary, points):
    """HOME, and LOOK and PICK in a machine. The second way waits no time."""
    options.WAITS_S = (0.001,)  # of this process alone
    inner = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
    with inner:
        smach.StateMachine.add('LOOK', Noted('LOOK', diary, points), {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', FailingAtFirst('PICK', diary, points))
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('HOME', Noted('HOME', diary, points), {'succeeded': 'GET'})
        smach.StateMachine.add('GET', inner)
    return machine


def killed_at(folder, point, **settings):
    killed = KilledMachine(make(folder), fetch, policy='escalating', **settings)
    return killed, killed.run(kill_at=point)


@pytest.mark.parametrize('userdata', ['keep', 'restore'])
def test_no_way_is_gone_twice_wherever_it_is_killed(tmp_path, userdata):
    """A crash loses the result of the way under way alone."""
    left = Left(fetch, policy='escalating', userdata=userdata)
    told, usual = left.told, {'HOME': 2, 'LOOK': 3, 'PICK': 5}
    assert told['outcome'] == 'succeeded'
    assert left.killed_at(told['points'], tmp_path / 'killed').diary.count('begins') == usual
    for point in left.points(1 + (userdata == 'keep'), 2):
        killed = left.killed_at(point, tmp_path / 'killed')
        rest = killed.run()
        assert rest.get('outcome') == 'succeeded', (point, rest)
        begun = killed.diary.count('begins')
        # one state was in doubt, and is entered again for that
        assert sum(begun.values()) <= sum(usual.values()) + 1, (point, begun)
        assert all(begun[name] <= usual[name] + 1 for name in usual), (point, begun)
        if userdata == 'restore':  # what was in doubt has not come to its end
            assert rest['done'] == told['done'], point
        found = rest['ways']['PICK']
        # the state in doubt is entered again, and may succeed earlier than it would have
        assert 2 <= len(found) <= 4 and all(not helped for _, helped in found[:-1]), (point, found)


def facts(store, name):
    """Kind of the moment and text of each fact of a name, oldest first."""
    with sqlite3.connect(store) as database:
        found = database.execute(
            'SELECT kind, text FROM facts JOIN moments ON moments.number = facts.moment '
            'WHERE facts.name = ? ORDER BY moments.number',
            (name,),
        ).fetchall()
    database.close()
    return found


def test_the_results_are_stored_where_there_is_one_more_and_not_at_each_visit(tmp_path):
    killed, told = killed_at(tmp_path / 'whole', 0)
    assert [helped for _, helped in told['ways']['PICK']] == [False, False, False, True]
    stored = [json.loads(text) for _, text in facts(killed.store, 'ways:PICK')]
    assert [each['ways_total'] for each in stored] == [1, 2, 3, 4]
    assert all('ways' not in text for _, text in facts(killed.store, 'state:PICK'))
    assert not facts(killed.store, 'ways:LOOK')


def as_before(store):
    """Have the results of ways in the facts of the states, as an earlier version had them."""
    with sqlite3.connect(store) as database:
        for moment, name, text in database.execute(
            "SELECT moment, name, text FROM facts WHERE name LIKE 'state:%'"
        ).fetchall():
            ways = database.execute(
                'SELECT text FROM facts WHERE name = ? AND moment <= ? ORDER BY moment DESC',
                ('ways:' + name.partition(':')[2], moment),
            ).fetchone()
            told = json.loads(text)
            told['learned'].update(json.loads(ways[0]) if ways else {})
            database.execute(
                'UPDATE facts SET text = ? WHERE moment = ? AND name = ?',
                (json.dumps(told), moment, name),
            )
        assert database.execute("DELETE FROM facts WHERE name LIKE 'ways:%'").rowcount == 3
    database.close()


def test_the_results_in_a_store_of_an_earlier_version_are_read(tmp_path):
    points = killed_at(tmp_path / 'whole', 0)[1]['points']
    killed, _ = killed_at(tmp_path / 'killed', points - 4)
    before = facts(killed.store, 'ways:PICK')[-1][1]
    as_before(killed.store)
    assert json.loads(before)['ways_total'] == 3
    killed.run(kill_at=2)
    assert facts(killed.store, 'ways:PICK') == [('RESUMED', before)]
    assert len(killed.run()['ways']['PICK']) >= 3


def test_a_store_of_an_earlier_version_has_no_pause_and_no_time_of_work(tmp_path):
    killed, _ = killed_at(tmp_path, 5)
    with sqlite3.connect(killed.store) as database:
        database.execute("DELETE FROM facts WHERE name = 'paused'")
        database.execute("UPDATE facts SET text = '[0, 0, 60]' WHERE name = 'budget'")
    database.close()
    assert killed.run()['outcome'] == 'succeeded'
    assert all(each >= 60 for each in json.loads(facts(killed.store, 'budget')[-1][1])[2:])


def test_the_results_of_a_renamed_state_are_those_of_its_new_name():
    renaming = Renaming('TOP', {'GET/PICK': 'TAKE'}, ['', 'GET'])
    value = StoredValue('{}', None)
    fact = StoredFact(1, 'JUMP', 'TOP/GET', 'PICK', 'TOP/GET', 'ways:PICK', value)
    assert renaming(fact)[4:] == ('TOP', 'ways:TAKE', value)


class Ends(smach.State):
    """Ends as told, one entry a visit, and then well."""

    def __init__(self, *results):
        smach.State.__init__(self, ['succeeded', 'aborted'])
        self._results = list(results)

    def execute(self, userdata):
        return self._results.pop(0) if self._results else 'succeeded'


def boxes(depth, innermost, beside):
    """Containers in containers, GET in GET, each with others BESIDE that have not run yet."""
    machine = smach.StateMachine(['succeeded', 'aborted'])
    with machine:
        smach.StateMachine.add('HOME', Ends(), {'succeeded': 'GET'})
        inner = boxes(depth - 1, innermost, beside) if depth else innermost
        smach.StateMachine.add('GET', inner, {'succeeded': 'BESIDE_0'})
        for number in range(beside):
            other = smach.StateMachine(['succeeded', 'aborted'])
            with other:
                smach.StateMachine.add('ONLY', Ends())
            following = 'BESIDE_{}'.format(number + 1) if number + 1 < beside else 'succeeded'
            smach.StateMachine.add('BESIDE_{}'.format(number), other, {'succeeded': following})
    return machine


def test_a_jump_stores_the_streaks_around_the_failed_state_and_looks_at_no_others(
    tmp_path, monkeypatch
):
    """The third way leaves the container of the failed state, whose streak has all three."""
    monkeypatch.setattr(options, 'WAITS_S', (0.001,))
    store = tmp_path / 'store.db'
    machine = boxes(1, Ends('aborted', 'aborted', 'aborted'), beside=12)
    settings = {'policy': 'escalating', 'checkpoint': str(store)}
    OracleContainer.wrap(machine, settings=settings, name='TOP')
    looked, stored = [], []
    look = ContainerFacts.streaks

    def streaks(facts):
        looked.append(facts._path)
        return look(facts)

    def observe(event):
        if event.kind is EventKind.JUMP:
            stored.append((event.data.get('way'), set(looked)))
        looked.clear()

    monkeypatch.setattr(ContainerFacts, 'streaks', streaks)
    oracle_of(machine).events.observers.append(observe)
    assert machine.execute() == 'succeeded'
    assert [way for way, _ in stored] == ['again', 'wait 0.001 s', 'from /HOME']
    assert all(paths == {'TOP', 'TOP/GET'} for _, paths in stored), stored


def test_a_way_that_ctrl_c_ends_is_stored_as_one_of_which_nobody_knows(tmp_path):
    def stopped(state, ud):
        raise KeyboardInterrupt

    path = str(tmp_path / 'robot.db')
    machine = chain_of(Scripted('aborted', stopped))
    OracleContainer.wrap(machine, name='TOP', settings={'policy': 'escalating', 'checkpoint': path})
    with pytest.raises(KeyboardInterrupt):
        machine.execute()
    with contextlib.closing(StoreFile(path, read_only=True)) as store:
        stored = read_tree(store, 1).container('TOP')
    assert [row.split()[3] for row in stored.ways['A']['ways']['results']] == ['-']


def test_a_state_that_was_interrupted_has_tried_nothing_yet(tmp_path):
    def begin(pick):
        machine = Watched(
            chain_of(Scripted(pick)),
            settings={
                'policy': 'escalating',
                'checkpoint': str(tmp_path / 'robot.db'),
                'checkpoint_synchronous': 'OFF',
                'on_resume': 'recover',
            },
        )
        machine.run()
        return [event.data['streak'] for event in machine.of(EventKind.DECISION)]

    assert in_a_process(lambda: begin(lambda state, ud: os.kill(os.getpid(), 9))) is None
    assert begin('ok') == [{'tried': (), 'attempts': 0, 'minutes': 0.0, 'moved': ''}]
