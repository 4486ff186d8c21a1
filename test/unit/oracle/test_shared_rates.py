"""Machines that have one rates file, in one process and in several."""

import contextlib
import json
import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from killed_machines import KilledMachine
from killed_trees import flat
from machines import FakeExpert, Scripted, Watched, chain_of, supersede

from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.decision.failure_rate import ESTIMATORS, base_of, merged
from smach_oracle.oracle.machine import container_records
from smach_oracle.oracle.records import folder_locks as lock_module
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.folder_locks import folder_lock

HERE = os.path.dirname(os.path.abspath(__file__))


def machine(path, name, *scripts, **settings):
    return Watched(
        chain_of(*[Scripted(*script) for script in scripts]),
        name=name,
        settings=dict(settings, rates_file=str(path)),
    )


def learned(path, name, label='A', place=''):
    told = json.loads(path.read_text())['machines'][name][place][label]
    return told['successes'], told['failures']


def test_two_machines_keep_what_both_have_learned(tmp_path):
    path = tmp_path / 'rates.json'
    pick, place = machine(path, 'PICK', ['aborted']), machine(path, 'PLACE', [], ['aborted'])
    for each in (pick, place, pick):
        each.run()
    assert learned(path, 'PICK') == (2, 1)
    assert (learned(path, 'PLACE'), learned(path, 'PLACE', 'B')) == ((1, 0), (1, 1))
    again = machine(path, 'PICK', [])
    assert (again.rate('A').successes, again.rate('A').failures) == (2, 1)


def test_a_machine_that_was_built_under_an_oracle_reads_the_file_as_its_trial_begins(tmp_path):
    rates = []
    for _ in range(2):
        built = OracleContainer(['done', 'aborted'], settings={'rates_file': str(tmp_path / 'r')})
        with built:
            built.add('A', Scripted('aborted', outcomes=('ok', 'aborted')), {'ok': 'done'})
        built.events.observers.append(
            lambda event: rates.append(event.rate) if event.kind is EventKind.FAILURE else None
        )
        assert built.execute() == 'done'
    assert rates[0] < rates[1], 'the second one knows of the failure of the first one'


@pytest.mark.parametrize('settings', [{}, {'estimator': 'exponential'}, {'memory': 3}])
def test_two_objects_of_one_machine_add_what_each_has_learned(tmp_path, settings):
    path = tmp_path / 'rates.json'
    one, two = (machine(path, 'TASK', ['aborted', 'ok'], **settings) for _ in range(2))
    for each in (one, two, one, two, two):
        each.run()
    assert learned(path, 'TASK') == (5, 2)
    assert (two.rate('A').successes, two.rate('A').failures) == (5, 2), 'each learns of the other'
    single = machine(path, 'TASK', [], **settings)
    assert single.rate('A').rate == pytest.approx(two.rate('A').rate)


def test_of_another_estimator_the_totals_alone_are_added():
    own, theirs = (ESTIMATORS[kind](5, 0.2) for kind in ('exponential', 'window'))
    for failed in (True, False, False):
        own.add(failed)
        theirs.add(failed)
    found = merged(own.snapshot(), {}, theirs.snapshot(), 5)
    assert found == dict(own.snapshot(), successes=4, failures=2)


def test_a_file_that_is_set_later_replaces_what_was_learned_and_gets_what_is_new(tmp_path):
    path = tmp_path / 'rates.json'
    for _ in range(3):
        machine(path, 'TASK', []).run()
    later = Watched(chain_of(Scripted('aborted')), name='TASK')
    later.run()
    OracleContainer.wrap(later.machine, name='TASK', settings={'rates_file': str(path)})
    later.run()
    assert (later.rate('A').successes, later.rate('A').failures) == (4, 0)
    assert learned(path, 'TASK') == (4, 0)


def test_another_file_gets_all_that_was_learned(tmp_path):
    first, second = tmp_path / 'first.json', tmp_path / 'second.json'
    task = machine(first, 'TASK', ['aborted'])
    task.run()
    OracleContainer.wrap(task.machine, name='TASK', settings={'rates_file': str(second)})
    task.run()
    assert (learned(first, 'TASK'), learned(second, 'TASK')) == ((1, 1), (2, 1))


def test_another_file_gets_all_that_was_learned_also_where_others_have_come_first(tmp_path):
    first, second = tmp_path / 'first.json', tmp_path / 'second.json'
    task = machine(first, 'TASK', ['aborted'])
    task.run()
    OracleContainer.wrap(task.machine, name='TASK', settings={'rates_file': str(second)})
    machine(second, 'TASK', ['aborted']).run()
    task.run()
    assert learned(second, 'TASK') == (3, 2)


def test_a_machine_under_another_name_goes_on_with_what_was_learned(tmp_path):
    path = tmp_path / 'rates.json'
    machine(path, 'OLD', ['aborted', 'aborted']).run()
    machine(path, 'OTHER', ['aborted'], [], []).run()
    new = machine(path, 'NEW', [])
    assert new.rate('A').failures == 2
    new.run()
    assert learned(path, 'NEW') == (2, 2)
    assert learned(path, 'OLD') == (1, 2)


def test_a_machine_that_lies_in_another_one_by_now_reads_its_own_file_no_more(tmp_path):
    path = tmp_path / 'inner.json'
    machine(path, 'TASK', []).run()
    inner = machine(path, 'TASK', [])
    outer = Watched(
        chain_of(inner.machine), name='OUTER', settings={'rates_file': str(tmp_path / 'outer.json')}
    )
    outer.run()
    inner.run()
    assert inner.rate('A').successes == 3
    assert learned(path, 'TASK') == (1, 0)


def test_a_file_of_before_is_read_and_keeps_its_states(tmp_path):
    path = tmp_path / 'rates.json'
    good = {'estimator': 'window', 'successes': 3, 'failures': 1, 'window': [0, 1, 0, 0]}
    path.write_text(
        json.dumps(
            {
                'format': 'smach_oracle rates',
                'version': 1,
                'containers': {'': {'A': good, 'GONE': good}},
            }
        )
    )
    task = machine(path, 'TASK', ['aborted'])
    assert task.rate('A').successes == 3
    task.run()
    assert learned(path, 'TASK') == (4, 2)
    assert learned(path, 'TASK', 'GONE') == learned(path, '', 'GONE') == (3, 1)
    assert json.loads(path.read_text())['containers']['']['A']['failures'] == 2


def test_rates_saved_by_hand_leave_other_machines_alone(tmp_path):
    path = tmp_path / 'rates.json'
    machine(path, 'OTHER', ['aborted']).run()
    mine = Watched(chain_of(Scripted('aborted')), name='MINE')
    mine.run()
    for _ in range(2):
        mine.machine.save_rates(str(path))
    assert (learned(path, 'OTHER'), learned(path, 'MINE')) == ((1, 1), (1, 1))


def test_what_could_not_be_written_is_written_later(tmp_path, monkeypatch, log):
    path = tmp_path / 'rates.json'
    one, two = machine(path, 'TASK', ['aborted']), machine(path, 'TASK', ['aborted'])
    monkeypatch.setattr(os, 'fsync', lambda descriptor: (_ for _ in ()).throw(OSError(28, 'full')))
    one.run()
    monkeypatch.undo()
    two.run()
    one.run()
    assert learned(path, 'TASK') == (3, 2)


def opened_in(folder):
    """What this process has open there."""
    found = []
    for each in Path('/proc/self/fd').iterdir():
        with contextlib.suppress(OSError):  # closed meanwhile
            found.append(os.readlink(str(each)))
    return [path for path in found if path.startswith(str(folder))]


def test_no_folder_stays_open_for_a_rates_file(tmp_path):
    one = machine(tmp_path / 'rates.json', 'TASK', ['aborted'])
    before = opened_in(tmp_path)
    one.run()
    assert opened_in(tmp_path) == before


def test_a_file_that_others_hold_stops_no_machine(tmp_path, monkeypatch, log):
    monkeypatch.setattr(lock_module, 'WAIT_S', 0.05)
    path = tmp_path / 'rates.json'
    task = machine(path, 'TASK', ['aborted'])
    with folder_lock(str(tmp_path)):
        assert task.run() == 'done'
    assert any('another program holds the lock' in text for level, text in log if level == 'warn')
    assert not path.exists()
    task.run()
    assert learned(path, 'TASK') == (2, 1)


def test_a_child_that_is_forked_meanwhile_does_not_keep_the_lock(tmp_path, monkeypatch):
    monkeypatch.setattr(lock_module, 'WAIT_S', 0.05)
    with folder_lock(str(tmp_path)):
        child = os.fork()
        if not child:
            signal.pause()
    try:
        with folder_lock(str(tmp_path)):
            assert os.waitpid(child, os.WNOHANG) == (0, 0), 'it lives'
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def test_a_link_leads_to_one_file(tmp_path):
    path = tmp_path / 'rates.json'
    (tmp_path / 'link.json').symlink_to(path)
    machine(tmp_path / 'link.json', 'ONE', ['aborted']).run()
    machine(path, 'TWO', ['aborted']).run()
    assert (tmp_path / 'link.json').is_symlink()
    assert {'ONE', 'TWO'} == set(json.loads(path.read_text())['machines'])


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write everywhere')
def test_a_folder_that_is_read_only_is_warned_of(tmp_path, log):
    path = tmp_path / 'rates.json'
    os.chmod(str(tmp_path), stat.S_IRUSR | stat.S_IXUSR)
    assert machine(path, 'TASK', ['aborted']).run() == 'done'
    assert any('cannot be written' in text for level, text in log if level == 'warn')


def test_a_damaged_file_is_kept_aside_also_while_the_machine_runs(tmp_path, log):
    path = tmp_path / 'rates.json'
    task = machine(path, 'TASK', ['aborted'])
    path.write_text('{"format": "smach_ora')
    task.run()
    assert (tmp_path / 'rates.json.damaged').exists()
    assert learned(path, 'TASK') == (1, 1)


@pytest.mark.parametrize(
    'estimator, key, value',
    [
        ('window', 'failures', float('inf')),
        ('window', 'successes', '3'),
        ('window', 'window', ['x']),
        ('exponential', 'rate', float('nan')),
    ],
)
def test_what_another_program_has_written_and_nobody_can_read_is_replaced(
    tmp_path, log, estimator, key, value
):
    path = tmp_path / 'rates.json'
    running = machine(path, 'PICK', ['aborted', 'ok', 'ok'], estimator=estimator)
    running.run()
    content = json.loads(path.read_text())
    content['machines']['PICK']['']['A'].update({'successes': 9, key: value})
    path.write_text(json.dumps(content))
    running.run()
    assert learned(path, 'PICK') == (2, 1), 'as this machine has learned'
    assert any("'A' of PICK cannot be used: " in str(said) for said in log)
    again = machine(path, 'PICK', [], estimator=estimator)
    again.run()
    assert (again.rate('A').successes, again.rate('A').failures) == (3, 1)


def test_counts_that_another_program_has_made_floats_are_counts(tmp_path):
    path = tmp_path / 'rates.json'
    machine(path, 'PICK', ['aborted', 'ok']).run()
    content = json.loads(path.read_text())
    counts = content['machines']['PICK']['']['A']
    counts.update(successes=1.0, failures=1.0)
    path.write_text(json.dumps(content))
    one, two = (machine(path, 'PICK', ['aborted']) for _ in range(2))
    for each in (one, two, one):
        each.run()
    assert learned(path, 'PICK') == (4, 3)


HAMMER = """
import sys
sys.path[:0] = {path!r}
import smach
smach.set_loggers(*[lambda text: None] * 4)
from machines import FakeExpert, Scripted, Watched, chain_of, supersede
path, name, runs = sys.argv[1], sys.argv[2], int(sys.argv[3])
state = Scripted()
machine = Watched(chain_of(state), name=name, settings={{'rates_file': path}})
print('ready', flush=True)
sys.stdin.readline()
for _ in range(runs):
    state.script = ['aborted']
    machine.run()
    machine.events.clear()
"""


@pytest.mark.parametrize(
    'names', [('ONE', 'TWO', 'THREE'), ('SAME', 'SAME', 'SAME'), ('SAME', 'SAME', 'OTHER')]
)
def test_processes_that_hammer_one_file_lose_nothing(tmp_path, names):
    path, runs = tmp_path / 'rates.json', 30
    code = HAMMER.format(path=[HERE] + sys.path)
    programs = [
        subprocess.Popen(
            [sys.executable, '-c', code, str(path), name, str(runs)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        for name in names
    ]
    for each in programs:
        assert each.stdout.readline() == b'ready\n'
    for each in programs:
        each.stdin.write(b'go\n')
        each.stdin.flush()
    for each in programs:
        assert each.wait(120) == 0
        each.stdin.close()
        each.stdout.close()
    for name in set(names):
        count = runs * names.count(name)
        assert learned(path, name) == (count, count)
    assert os.listdir(str(tmp_path)) == ['rates.json'], 'no lock and no other file stays'


def test_threads_of_one_process_lose_nothing(tmp_path):
    path = tmp_path / 'rates.json'
    machines = [machine(path, 'TASK', ['aborted'] * 2, memory=100) for _ in range(3)]
    threads = [threading.Thread(target=each.run) for each in machines]
    for each in threads:
        each.start()
    for each in threads:
        each.join(60)
    assert learned(path, 'TASK') == (3, 6)


def test_a_machine_that_goes_on_keeps_what_others_have_learned_meanwhile(tmp_path):
    """The file did not know the state when the program that was killed began."""
    path = tmp_path / 'rates.json'
    killed = KilledMachine(tmp_path, flat, rates_file=str(path))
    assert killed.run(kill_at=4) is None
    machine(path, 'TOP', ['aborted']).run()
    assert learned(path, 'TOP') == (1, 1)
    assert killed.run()['outcome'] == 'succeeded'
    assert learned(path, 'TOP')[0] >= 1 and learned(path, 'TOP')[1] == 1


def estimator(kind, results, memory=5):
    made = ESTIMATORS[kind](memory, 0.1)
    for failed in results:
        made.add(failed)
    return made


@pytest.mark.parametrize('kind', sorted(ESTIMATORS))
@pytest.mark.parametrize(
    'shared, theirs, own',
    [
        ('', '', '101'),
        ('110', '', ''),
        ('110', '01', ''),
        ('110', '', '0001'),
        ('1101010', '0001', '11011'),
    ],
)
def test_what_is_merged_is_what_one_would_have_learned(kind, shared, theirs, own):
    def of(text):
        return estimator(kind, [letter == '1' for letter in text]).snapshot()

    found = merged(of(shared + own), base_of(of(shared)), of(shared + theirs), 5)
    wanted = of(shared + theirs + own)
    assert {key: pytest.approx(value) for key, value in wanted.items() if key != 'estimator'} == {
        key: value for key, value in found.items() if key != 'estimator'
    }


@pytest.mark.parametrize('kind', sorted(ESTIMATORS))
def test_a_failure_that_is_taken_back_is_taken_out(kind):
    mine = estimator(kind, [False, True])
    base = base_of(mine.snapshot())
    others = estimator(kind, [False, True, False]).snapshot()
    mine.take_back_failure()
    found = merged(mine.snapshot(), base, others, 5)
    assert (found['successes'], found['failures']) == (2, 0)
    assert found.get('window', [0, 0]) == [0, 0] and found.get('rate', 0) < 0.1
    mine.add(False)
    found = merged(mine.snapshot(), base, others, 5)
    assert (found['successes'], found['failures']) == (3, 0)
    assert found.get('window', [0, 0, 0]) == [0, 0, 0]


def test_a_failure_that_the_results_of_others_have_pushed_out_is_taken_back(tmp_path):
    path = tmp_path / 'rates.json'

    def while_others_run(state, ud):
        others = machine(path, 'TASK', [], [], memory=5)
        for _ in range(5):
            others.run()
        return 'again'

    task = chain_of(
        Scripted('aborted', 'aborted'), Scripted(while_others_run, outcomes=('ok', 'again'))
    )
    task._transitions['B']['again'] = 'A'
    watched = Watched(
        task,
        name='TASK',
        expert=FakeExpert(supersede('ok'), supersede('ok')),
        settings={'rates_file': str(path), 'policy': 'always_ask', 'memory': 5},
    )
    assert watched.run() == 'done'
    assert (watched.rate('A').successes, watched.rate('A').failures) == (5, 0)
    assert learned(path, 'TASK') == (5, 0)


@pytest.fixture
def meanwhile(monkeypatch):
    """A list of what happens, once, while the record of a state with learned rates is made."""
    things, base = [], container_records.base_of

    def after_things(rates):
        while things:
            things.pop()()
        return base(rates)

    monkeypatch.setattr(container_records, 'base_of', after_things)
    return things


def test_what_others_have_learned_while_a_record_is_made_is_added_once(tmp_path, meanwhile):
    path = tmp_path / 'rates.json'
    other = machine(path, 'TASK', ['aborted'])
    other.run()
    own = machine(path, 'TASK', [])
    meanwhile += [lambda: own.machine.load_rates(str(path)), other.run]
    assert own.rate('A').successes == 2
    own.run()
    assert learned(path, 'TASK') == (3, 1) and not meanwhile


def test_a_record_that_a_reader_makes_too_late_is_forgotten_with_its_rates(tmp_path, meanwhile):
    path = tmp_path / 'rates.json'
    machine(path, 'TASK', ['aborted']).run()
    own = machine(path, 'TASK', [])
    meanwhile.append(own.run)
    assert [own.rate('A').successes for _ in range(2)] == [2, 2] and not meanwhile


@pytest.mark.parametrize('kind', sorted(ESTIMATORS))
def test_a_failure_is_taken_back_from_what_was_handed_on(kind):
    mine, other = (estimator(kind, [True, True, False, True]) for _ in range(2))
    before = mine.rate
    mine.add(True)
    other.restore(mine.snapshot())
    other.take_back_failure()
    assert (other.rate, other.failures) == (pytest.approx(before), 3)
