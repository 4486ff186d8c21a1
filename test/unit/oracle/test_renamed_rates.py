"""A machine that was renamed goes on with its rates; one that lives keeps its own to itself."""

import contextlib
import gc
import json
import os
import subprocess
import sys

import pytest
from machines import Scripted, Watched, chain_of

import smach
from smach_oracle.oracle.records import folder_locks, rates_file

HERE = os.path.dirname(os.path.abspath(__file__))
PROGRAM = """
import os, sys
sys.path[:0] = {path!r}
import smach
smach.set_loggers(*[lambda text: None] * 4)
said = []
smach.set_loggers(said.append, said.append, said.append, said.append)
from machines import Scripted, Watched, chain_of
path, name, runs = sys.argv[1], sys.argv[2], int(sys.argv[3])
state = Scripted()
machine = Watched(chain_of(state), name=name, settings={{'rates_file': path}})
rate = machine.rate('A')
print(rate.successes, rate.failures, sum('is new there' in text for text in said), flush=True)
for _ in range(runs):
    state.script = ['aborted']
    machine.run()
if 'fork' in sys.argv and not os.fork():
    os.close(1)
    sys.stdin.readline()  # it outlives its parent
    os._exit(0)
if 'fork' not in sys.argv:
    print('has run', flush=True)
    sys.stdin.readline()
"""


@pytest.fixture
def program(tmp_path):
    """Start a program of one machine with one state, that lives until its context ends."""

    @contextlib.contextmanager
    def started(name, runs=0, *words):
        code = PROGRAM.format(path=[HERE] + sys.path)
        process = subprocess.Popen(
            [sys.executable, '-c', code, str(tmp_path / 'rates.json'), name, str(runs), *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        try:
            told = tuple(map(int, process.stdout.readline().split()))
            process.stdout.readline()  # it has run, or it has ended
            yield told
        finally:
            process.stdin.close()
            process.stdout.close()
            assert process.wait(60) == 0

    return started


def file_of(tmp_path):
    return json.loads((tmp_path / 'rates.json').read_text())


def counts(tmp_path, name):
    told = file_of(tmp_path)['machines'][name]['']['A']
    return told['successes'], told['failures']


def test_a_machine_that_lives_in_another_program_keeps_its_counts(tmp_path, program):
    with program('PICK', 3), program('PLACE', 1) as told:
        assert told == (0, 0, 0)
        assert (counts(tmp_path, 'PICK'), counts(tmp_path, 'PLACE')) == ((3, 3), (1, 1))


def test_one_that_another_program_has_taken_over_meanwhile_has_its_rates(tmp_path, monkeypatch):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    Watched(chain_of(Scripted('aborted')), name='OLD', settings=settings).run()
    gc.collect()
    lock = rates_file.folder_lock

    @contextlib.contextmanager
    def locked(folder):
        """The other program comes first: it has run once."""
        monkeypatch.setattr(rates_file, 'folder_lock', lock)
        monkeypatch.setattr(smach, 'loginfo', lambda text: None)
        Watched(chain_of(Scripted('aborted')), name='NEW', settings=settings).run()
        said.clear()
        with lock(folder):
            yield

    said = []
    monkeypatch.setattr(smach, 'logwarn', said.append)
    monkeypatch.setattr(rates_file, 'folder_lock', locked)
    machine = Watched(chain_of(Scripted()), name='NEW', settings=settings)
    assert machine.rate('A').failures == 2 and not said


def test_machines_that_live_in_one_program_keep_their_counts(tmp_path):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    pick = Watched(chain_of(Scripted('aborted')), name='PICK', settings=settings)
    pick.run()
    place = Watched(chain_of(Scripted('aborted')), name='PLACE', settings=settings)
    assert place.rate('A').failures == 0
    place.run()
    assert counts(tmp_path, 'PICK') == counts(tmp_path, 'PLACE') == (1, 1)


def test_a_machine_that_is_gone_holds_no_name_though_its_memory_is_not_free_yet(tmp_path):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    gc.disable()
    try:
        Watched(chain_of(Scripted('aborted')), name='OLD', settings=settings).run()
        assert Watched(chain_of(Scripted()), name='NEW', settings=settings).rate('A').failures == 1
    finally:
        gc.enable()


def test_a_machine_without_a_name_that_lives_keeps_its_counts(tmp_path):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    plain = Watched(chain_of(Scripted('aborted')), settings=settings)
    plain.run()
    assert Watched(chain_of(Scripted()), name='PLACE', settings=settings).rate('A').failures == 0


def test_one_that_was_renamed_inherits_once_and_the_log_says_it(tmp_path, program):
    with program('OLD', 3):
        pass
    with program('NEW', 1) as told, program('OTHER') as other:
        assert (told, other) == ((3, 3, 1), (0, 0, 0))
    assert (counts(tmp_path, 'OLD'), counts(tmp_path, 'NEW')) == ((3, 3), (4, 4))
    with program('NEW') as told:
        assert told == (4, 4, 0)
    with program('THIRD') as told:
        assert told == (4, 4, 1), 'NEW was renamed again'


def test_the_log_says_whose_rates_it_has_and_warns_where_they_may_be_anothers(tmp_path, log):
    settings = {'rates_file': str(tmp_path / 'rates.json')}

    def run(name):
        del log[:]
        Watched(chain_of(Scripted('aborted')), name=name, settings=settings).run()
        gc.collect()
        return [line for line in log if 'rates.json' in line[1] and 'is new there' in line[1]]

    assert run('') == []
    for name, level in (('FIRST', 'info'), ('SECOND', 'warn')):
        ((found, text),) = run(name)
        assert found == level and repr(name) in text


def test_one_that_never_came_to_its_last_states_hands_its_rates_on_once(tmp_path):
    settings = {'rates_file': str(tmp_path / 'rates.json'), 'max_recoveries': 2}

    def machine(name):
        states = Scripted('aborted', 'aborted'), Scripted(*['aborted'] * 40), Scripted()
        return Watched(chain_of(*states), name=name, settings=settings)

    machine('OLD').run()
    gc.collect()
    assert 'C' not in file_of(tmp_path)['machines']['OLD']['']
    alive = [machine('NEW{}'.format(number)) for number in range(3)]
    assert [each.rate('A').failures for each in alive] == [2, 0, 0]
    assert file_of(tmp_path)['renamed'] == {'OLD': 'NEW0'}


def test_one_that_has_another_state_beside_takes_nothing_over(tmp_path, program):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    with program('OLD', 3):
        pass
    more, same = (
        Watched(chain_of(*states), name=name, settings=settings)
        for name, states in (('MORE', (Scripted(), Scripted())), ('SAME', (Scripted(),)))
    )
    assert (more.rate('A').failures, same.rate('A').failures) == (0, 3)


def test_one_that_lost_a_state_before_it_was_renamed_hands_on_all_that_it_learned(tmp_path):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    for name, states in (('OLD', 3), ('OLD', 2)):
        Watched(chain_of(*[Scripted('aborted')] * states), name=name, settings=settings).run()
    gc.collect()
    new = Watched(chain_of(Scripted(), Scripted()), name='NEW', settings=settings)
    assert new.rate('A').failures > 0
    assert 'C' in file_of(tmp_path)['machines']['NEW'][''], 'a state that comes back has its rate'


def test_a_machine_without_a_name_hands_its_rates_to_each_that_has_a_state_of_it(tmp_path, log):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    Watched(chain_of(Scripted('aborted')), settings=settings).run()
    gc.collect()
    inside = smach.StateMachine(['done', 'aborted', 'preempted'])
    with inside:
        smach.StateMachine.add('INNER', chain_of(Scripted()))
    alive = [
        Watched(machine, name=name, settings=settings)
        for name, machine in (
            ('NEW', chain_of(Scripted())),
            ('OTHER', chain_of(Scripted(), Scripted())),
            ('ELSE', inside),
        )
    ]
    assert [each.rate('A').failures for each in alive] == [1, 1, 0]
    assert sum('is new there' in text for _, text in log) == 2
    assert sum('with what machines without a name have learned' in text for _, text in log) == 2
    assert 'renamed' not in file_of(tmp_path), 'it is there for the others, too'


def test_where_a_machine_without_a_name_has_learned_nothing_nothing_is_said(tmp_path, log):
    path = tmp_path / 'rates.json'
    settings = {'rates_file': str(path)}
    Watched(chain_of(Scripted('aborted')), settings=settings).run()
    gc.collect()
    content = json.loads(path.read_text())
    path.write_text(json.dumps(dict(content, machines={'': {}}, states={'': {'': ['A']}})))
    assert Watched(chain_of(Scripted()), name='NEW', settings=settings).rate('A').failures == 0
    assert not [text for _, text in log if 'is new there' in text]


def test_one_with_a_name_hands_its_rates_on_before_those_without(tmp_path):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    Watched(chain_of(Scripted('aborted', 'aborted')), name='OLD', settings=settings).run()
    Watched(chain_of(Scripted('aborted'), Scripted('aborted')), settings=settings).run()
    gc.collect()
    content = file_of(tmp_path)
    del content['failure_rules']  # as in a file of an earlier version
    (tmp_path / 'rates.json').write_text(json.dumps(content))
    assert Watched(chain_of(Scripted()), name='NEW', settings=settings).rate('A').failures == 2
    assert 'failure_rules' not in file_of(tmp_path)


def test_programs_that_know_no_names_get_the_rates_of_who_has_written_last(tmp_path):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    Watched(chain_of(Scripted(), Scripted()), name='B', settings=settings).run()
    Watched(chain_of(Scripted('aborted')), name='A', settings=settings).run()
    assert file_of(tmp_path)['containers'][''] == {
        'A': file_of(tmp_path)['machines']['A']['']['A'],
        'B': file_of(tmp_path)['machines']['B']['']['B'],
    }


def test_rates_that_are_read_by_hand_stay_in_the_file_under_their_name_alone(tmp_path, log):
    path = tmp_path / 'rates.json'
    Watched(chain_of(Scripted('aborted')), name='OLD', settings={'rates_file': str(path)}).run()
    gc.collect()
    before = path.read_text()
    reading = Watched(chain_of(Scripted()), name='NEW')
    reading.machine.load_rates(str(path))
    assert reading.rate('A').failures == 1
    assert path.read_text() == before


def test_one_that_has_its_name_back_goes_on_and_may_be_renamed_again(tmp_path, program):
    for name, wanted in (('OLD', (0, 0, 0)), ('NEW', (1, 1, 1)), ('OLD', (1, 1, 0))):
        with program(name, 1) as told:
            assert told == wanted
    assert file_of(tmp_path).get('renamed', {}) == {}


def test_programs_that_begin_at_once_inherit_once(tmp_path, program):
    with program('OLD', 3):
        pass
    with contextlib.ExitStack() as stack:
        told = [stack.enter_context(program('NEW{}'.format(number))) for number in range(3)]
    assert sorted(told) == [(0, 0, 0), (0, 0, 0), (3, 3, 1)]


def test_a_child_that_outlives_its_program_keeps_no_name(program):
    with program('OLD', 2, 'fork'):
        with program('NEW') as told:
            assert told == (2, 2, 1)


def test_where_nobody_can_say_who_lives_nothing_is_inherited(tmp_path, program, monkeypatch):
    with program('OLD', 1):
        pass
    monkeypatch.setattr(folder_locks, '_ask', lambda *_: (_ for _ in ()).throw(OSError(38, 'none')))
    new = Watched(
        chain_of(Scripted()), name='NEW', settings={'rates_file': str(tmp_path / 'rates.json')}
    )
    assert new.rate('A').failures == 0
