"""Learned rates: the estimators, and the file that keeps them across runs."""

import json
import os
import random
import signal
import stat
import subprocess
import sys
import time

import pytest
from machines import Scripted, Watched, chain_of, watched

from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.decision.failure_rate import (
    ExponentialFailureRate,
    FailureClass,
    FailureRate,
    classify,
    make_estimator,
)
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records import rates_format
from smach_oracle.oracle.settings.failure_rule import rule_in

HERE = os.path.dirname(os.path.abspath(__file__))


def test_the_rate_starts_at_the_prior_and_each_result_pushes_one_share_of_it_out():
    rate = FailureRate(memory=10, prior=0.1)
    rates = []
    for _ in range(8):
        rate.add(True)
        rates.append(round(rate.rate, 9))
    assert FailureRate(10, 0.1).rate == pytest.approx(0.1)
    assert rates == [0.19, 0.28, 0.37, 0.46, 0.55, 0.64, 0.73, 0.82]


def test_only_the_last_results_count():
    rate = FailureRate(memory=3, prior=0.5)
    for failed in (True, True, True, False, False):
        rate.add(failed)
    assert rate.rate == pytest.approx(1 / 3)
    assert (rate.successes, rate.failures) == (2, 3)


def test_the_window_agrees_with_its_formula_whatever_comes():
    random.seed(1)
    for memory in (1, 2, 7):
        rate, results = FailureRate(memory, 0.3), []
        for _ in range(200):
            if random.random() < 0.3:
                count = random.randrange(20)
                rate.add_successes(count)
                results += [False] * count
            else:
                results.append(random.random() < 0.5)
                rate.add(results[-1])
            window = results[-memory:]
            assert rate.rate == pytest.approx((sum(window) + 0.3 * (memory - len(window))) / memory)
            assert (rate.failures, rate.successes) == (sum(results), len(results) - sum(results))


@pytest.mark.parametrize('kind', ['window', 'exponential'])
@pytest.mark.parametrize('memory', [1, 2, 5])
def test_a_failure_can_be_taken_back_as_if_it_had_not_been(kind, memory):
    random.seed(memory)
    rate = make_estimator(kind, memory, 0.3)
    for _ in range(100):
        before = rate.snapshot(), rate.rate
        rate.add(True)
        rate.take_back_failure()
        assert (rate.snapshot(), rate.rate) == before
        rate.add(random.random() < 0.5)


def test_the_exponential_estimator_agrees_on_the_first_result_and_forgets_gradually():
    window, mean = FailureRate(10, 0.1), ExponentialFailureRate(10, 0.1)
    for rate in (window, mean):
        rate.add(True)
    assert window.rate == pytest.approx(mean.rate)
    assert (window.recent, mean.recent) == ((1, 1), (0, 0)), 'a mean knows no single results'
    mean.add_successes(1000)
    assert 0 < mean.rate < 1e-9
    one_by_one = ExponentialFailureRate(10, 0.1)
    one_by_one.add(True)
    for _ in range(1000):
        one_by_one.add(False)
    assert one_by_one.rate == pytest.approx(mean.rate)


@pytest.mark.parametrize(
    'rate, failure_class',
    [
        (0.0, FailureClass.LOW),
        (0.39, FailureClass.LOW),
        (0.4, FailureClass.MODERATE),
        (0.1 + 0.3, FailureClass.MODERATE),
        (0.74, FailureClass.MODERATE),
        (0.75, FailureClass.HIGH),
        (1.0, FailureClass.HIGH),
    ],
)
def test_classes_begin_at_their_thresholds(rate, failure_class):
    assert classify(rate, 0.4, 0.75) is failure_class


def test_a_rate_that_only_rounding_keeps_from_a_threshold_has_reached_it():
    above = 0.5 + 1e-9
    assert classify(0.5, above, 0.75) is FailureClass.MODERATE
    assert classify(0.5, 0.4, above) is FailureClass.HIGH


@pytest.mark.parametrize('estimator', [FailureRate, ExponentialFailureRate])
@pytest.mark.parametrize(
    'memory, prior', [(0, 0.1), (-1, 0.1), (1.5, 0.1), (True, 0.1), (3, -0.1), (3, 1.1), (3, None)]
)
def test_what_is_no_memory_or_prior_is_refused(estimator, memory, prior):
    with pytest.raises(SettingsError, match='memory|prior'):
        estimator(memory, prior)


def test_an_unknown_estimator_is_refused():
    with pytest.raises(SettingsError, match='exponential, window'):
        make_estimator('kalman', 1, 0.1)


@pytest.mark.parametrize('kind', ['window', 'exponential'])
def test_what_was_learned_can_be_handed_on(kind):
    rate = make_estimator(kind, 5, 0.2)
    for failed in (True, False, True):
        rate.add(failed)
    twin = make_estimator(kind, 5, 0.2)
    twin.restore(json.loads(json.dumps(rate.snapshot())))
    assert twin.rate == pytest.approx(rate.rate)
    assert twin.snapshot() == rate.snapshot()
    other = make_estimator('window' if kind == 'exponential' else 'exponential', 5, 0.2)
    other.restore(rate.snapshot())
    assert (other.rate, other.failures, other.successes) == (0.2, 2, 1)
    other.restore(dict(rate.snapshot(), rate=0.9, window=[1]))
    assert other.rate == 0.2, 'the totals alone count'


@pytest.mark.parametrize(
    'learned',
    [
        {'estimator': 'window', 'window': [2]},
        {'successes': -1},
        {'failures': 'x'},
        {'estimator': 'window', 'window': 'no'},
        {'estimator': 'window', 'window': ''},
    ],
)
def test_what_is_no_snapshot_is_refused(learned):
    with pytest.raises(ValueError):
        FailureRate(3, 0.1).restore(learned)


@pytest.mark.parametrize('rate', [-0.1, 1.1, 'x', True, None])
def test_a_rate_that_is_none_is_refused(rate):
    with pytest.raises(ValueError, match='rate: .* is not from 0 to 1'):
        make_estimator('exponential', 3, 0.1).restore({'estimator': 'exponential', 'rate': rate})


def test_states_learn_apart_by_their_own_memory_and_thresholds():
    machine = watched(
        Scripted('aborted'),
        Scripted('aborted'),
        settings={
            'states': {
                'A': {'memory': 2, 'moderate_from': 0.5, 'high_from': 0.9},
                'B': {'estimator': 'exponential'},
            }
        },
    )
    machine.run()
    a, b = machine.rate('A'), machine.rate('B')
    assert (a.failures, a.successes, a.rate) == (1, 1, pytest.approx(0.5))
    assert a.failure_class == FailureClass.MODERATE
    assert (b.failures, b.successes, b.rate) == (1, 1, pytest.approx(0.19 * 0.9))


def test_many_successes_are_learned_however_they_were_counted():
    machine = watched(Scripted(*['ok'] * 4 + ['aborted']), Scripted())
    for _ in range(5):
        machine.run()
    row = machine.rate('A')
    assert (row.successes, row.failures) == (5, 1)
    assert row.rate == pytest.approx((1 + 0.1 * 4) / 10)


# -- the file


def learned_machine(path, *script, **settings):
    return watched(Scripted(*script), settings=dict(settings, rates_file=str(path)))


def test_rates_are_kept_across_runs(tmp_path):
    path = tmp_path / 'rates.json'
    first = learned_machine(path, 'aborted', 'aborted')
    first.run()
    second = learned_machine(path)
    assert second.rate('A') == first.rate('A')._replace(recoveries=0)
    second.run()
    assert learned_machine(path).rate('A').successes == 2


def test_rates_of_nested_machines_are_kept_under_any_name_of_the_top(tmp_path):
    import smach

    def make(name):
        machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
        with machine:
            smach.StateMachine.add('INNER', chain_of(Scripted('aborted')), {'done': 'done'})
        return Watched(machine, name=name, settings={'rates_file': str(tmp_path / 'rates.json')})

    make('FIRST').run()
    assert make('SECOND').rate('A').failures == 1


def test_a_failure_is_on_disk_before_the_machine_recovers_from_it(tmp_path):
    path = tmp_path / 'rates.json'
    seen = []
    machine = watched(
        Scripted('aborted'),
        settings={'rates_file': str(path)},
        preconditions={'A': [lambda ud: seen.append(json.loads(path.read_text())) or True]},
    )
    machine.run()
    assert seen[0]['containers']['']['A']['failures'] == 1


def test_another_memory_takes_the_newest_results(tmp_path):
    path = tmp_path / 'rates.json'
    learned_machine(path, 'aborted', 'aborted').run()
    assert learned_machine(path, memory=2).rate('A').rate == pytest.approx(0.5)


@pytest.mark.parametrize(
    'content',
    [
        '',
        '{"format": "smach_ora',
        '[]',
        '{"format": "other"}',
        'null',
        '{"format": "smach_oracle rates", "version": 9, "containers": {}}',
        '{"format": "smach_oracle rates", "version": 1, "containers": 5}',
        '\udcff\udcfe',
        '[' * 100000,
    ],
)
def test_a_damaged_file_is_kept_aside_and_the_priors_count(tmp_path, log, content):
    path = tmp_path / 'rates.json'
    path.write_bytes(content.encode('utf-8', 'surrogateescape'))
    machine = learned_machine(path)
    assert machine.rate('A').rate == pytest.approx(0.1)
    assert (tmp_path / 'rates.json.damaged').exists()
    assert any('damaged' in text for level, text in log if level == 'warn')
    machine.run()
    assert learned_machine(path).rate('A').successes == 1


def test_one_state_that_makes_no_sense_costs_only_itself(tmp_path, log):
    path = tmp_path / 'rates.json'
    good = {'estimator': 'window', 'successes': 1, 'failures': 0, 'window': [0]}
    path.write_text(
        json.dumps(
            {
                'format': rates_format.FORMAT,
                'version': 1,
                'containers': {'': {'A': 5, 'B': good, 'GONE': good}},
            }
        )
    )
    machine = watched(Scripted(), Scripted(), settings={'rates_file': str(path)})
    assert (machine.rate('A').successes, machine.rate('B').successes) == (0, 1)
    (warned,) = [text for level, text in log if level == 'warn']
    assert warned.startswith("Rates file {}: 'A' of SM_ROOT cannot be used: ".format(path))
    machine.run()
    assert 'GONE' in json.loads(path.read_text())['containers'][''], (
        'a state that comes back has its rate back'
    )


@pytest.mark.parametrize('where', ['no/such/folder/rates.json', 'file/rates.json'])
def test_where_nothing_can_be_written_the_machine_goes_on_and_says_so(tmp_path, log, where):
    (tmp_path / 'file').write_text('')
    machine = learned_machine(tmp_path / where, 'aborted')
    assert machine.run() == 'done'
    assert any('cannot be written' in text for level, text in log if level == 'warn')


def test_a_full_disk_leaves_the_old_file_and_no_litter(tmp_path, monkeypatch, log):
    path = tmp_path / 'rates.json'
    learned_machine(path).run()
    before = path.read_text()

    def full(descriptor):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(os, 'fsync', full)
    machine = learned_machine(path, 'aborted')
    assert machine.run() == 'done'
    assert path.read_text() == before
    assert os.listdir(tmp_path) == ['rates.json']
    assert any('No space left' in text for level, text in log if level == 'warn')


def test_a_file_that_anybody_may_read_is_synced_as_a_whole_and_then_its_folder(
    tmp_path, monkeypatch
):
    path, synced, fsync = tmp_path / 'rates.json', [], os.fsync

    def noting(descriptor):
        found = os.fstat(descriptor)
        synced.append('folder' if stat.S_ISDIR(found.st_mode) else found.st_size)
        fsync(descriptor)

    monkeypatch.setattr(os, 'fsync', noting)
    learned_machine(path).run()
    written = path.stat()
    assert synced[-2:] == [written.st_size, 'folder']
    assert stat.S_IMODE(written.st_mode) == 0o644


WRITER = """
import sys
sys.path[:0] = {path!r}
import smach
smach.set_loggers(*[lambda text: None] * 4)
from machines import Scripted, watched
states = [Scripted() for _ in range(20)]
machine = watched(*states, settings={{'rates_file': sys.argv[1], 'history_length': 1}})
while True:
    states[0].script = ['aborted']
    machine.events.clear()
    machine.run()
    print('.', flush=True)
"""


def test_a_writer_killed_at_any_moment_leaves_a_whole_file(tmp_path):
    path = tmp_path / 'rates.json'
    code = WRITER.format(path=[HERE] + sys.path)
    random.seed(3)
    counts = []
    for _ in range(8):
        writer = subprocess.Popen([sys.executable, '-c', code, str(path)], stdout=subprocess.PIPE)
        try:
            assert writer.stdout.readline() == b'.\n'
            time.sleep(random.random() * 0.05)  # any moment will do
        finally:
            writer.send_signal(signal.SIGKILL)
            writer.wait(10)
            writer.stdout.close()
        content = json.loads(path.read_text())
        counts.append(content['containers']['']['A']['failures'])
    assert counts == sorted(counts) and counts[0] >= 1, 'nothing learned is ever lost'
    machine = watched(*[Scripted() for _ in range(20)], settings={'rates_file': str(path)})
    assert machine.rate('A').failures == counts[-1]


def test_the_record_of_a_trial_tells_how_to_go_on_after_it(tmp_path):
    path = tmp_path / 'rates.json'
    watch = watched(
        Scripted('aborted'), settings={'rates_file': str(path), 'memory': 7, 'policy': 'algorithm1'}
    )
    watch.machine.execute()
    settings, learned = watch.events[0].data['settings'], watch.events[-1].data['learned']
    assert (settings['policy'], settings['memory'], settings['moderate_from']) == (
        'algorithm1',
        7,
        0.4,
    )
    assert learned == json.loads(path.read_text())['containers']
    rule = rule_in(watch.events[0].data)
    rates_format.write_learned(str(tmp_path / 'again.json'), learned, rule)
    assert (tmp_path / 'again.json').read_text() == path.read_text()
    (tmp_path / 'link.json').symlink_to(tmp_path / 'again.json')
    rates_format.write_learned(str(tmp_path / 'link.json'), learned, None)
    assert 'failure_rules' not in json.loads((tmp_path / 'again.json').read_text())
    plain = watched(Scripted('aborted'))
    plain.machine.execute()
    assert 'learned' not in plain.events[-1].data, 'nothing is kept, so nothing is told'


def test_rates_can_be_saved_and_loaded_by_hand(tmp_path):
    machine = watched(Scripted('aborted')).machine
    machine.execute()
    machine.save_rates(str(tmp_path / 'by_hand.json'))
    twin = OracleContainer.wrap(chain_of(Scripted()))
    twin.load_rates(str(tmp_path / 'by_hand.json'))
    assert twin.rates()[0].failures == 1
    machine.execute()
    machine.save_rates(str(tmp_path / 'by_hand.json'))
    twin.load_rates(str(tmp_path / 'by_hand.json'))
    (row,) = twin.rates()
    assert (row.successes, row.failures) == (2, 1), 'what it has learned itself is replaced'
    with pytest.raises(OSError):
        machine.save_rates(str(tmp_path / 'no' / 'folder.json'))


def test_rates_read_from_another_thread_while_the_machine_runs_are_counted_once():
    import threading

    import smach

    left = [20000]

    def laps(state, ud):
        left[0] -= 1
        return 'ok' if left[0] > 0 else 'out'

    class Lap(Scripted):
        def execute(self, ud):
            return laps(self, ud)

    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', Lap(outcomes=('ok', 'out')), {'ok': 'B', 'out': 'done'})
        smach.StateMachine.add('B', Scripted(outcomes=('ok', 'aborted')), {'ok': 'A'})
    wrapped = OracleContainer.wrap(machine)
    stop = threading.Event()
    seen = []

    def read():
        while not stop.is_set():
            seen.append([row.rate for row in wrapped.rates()])

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    assert wrapped.execute() == 'done'
    stop.set()
    reader.join(10)
    assert seen and all(0 <= rate <= 1 for rates in seen for rate in rates)
    assert {row.state: row.successes for row in wrapped.rates()} == {'A': 20000, 'B': 19999}


def test_a_record_that_a_reader_of_rates_makes_too_late_replaces_none(monkeypatch):
    from smach_oracle.oracle.machine import container_records

    wrapped = OracleContainer.wrap(chain_of(Scripted('succeeded')))
    make, outcomes = container_records.StateRecord, []

    def late(*args, **kwargs):
        record = make(*args, **kwargs)
        if not outcomes:  # of the reader, which stands here until the machine has ended
            outcomes.append('')
            outcomes[0] = wrapped.execute()
        return record

    monkeypatch.setattr(container_records, 'StateRecord', late)
    assert [row.successes for row in wrapped.rates()] == [1]
    assert outcomes == ['done']
    assert [row.successes for row in wrapped.rates()] == [1]


def test_rates_that_are_read_while_a_record_is_made_are_known_to_it(tmp_path, monkeypatch):
    from smach_oracle.oracle.machine import container_records

    path, before = str(tmp_path / 'rates.json'), watched(Scripted('aborted', 'ok', 'aborted'))
    before.run()
    before.machine.save_rates(path)
    wrapped = OracleContainer.wrap(chain_of(Scripted()))
    wrapped.load_rates(path)
    base_of, read = container_records.base_of, []

    def reads_again(learned):
        if not read:  # another thread does
            read.append(before.run())
            before.machine.save_rates(path)
            wrapped.load_rates(path)
        return base_of(learned)

    monkeypatch.setattr(container_records, 'base_of', reads_again)
    assert [row.failures for row in wrapped.rates()] == [2]
    assert read == ['done']


def test_recoveries_of_a_nested_machine_are_those_of_the_present_trial():
    import smach

    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add(
            'CHOICE',
            Scripted('inner', 'ok', outcomes=('ok', 'inner')),
            {'ok': 'done', 'inner': 'INNER'},
        )
        smach.StateMachine.add('INNER', chain_of(Scripted('aborted')), {'done': 'done'})
    machine = Watched(machine)
    machine.run()
    assert machine.rate('A').recoveries == 1
    machine.run()
    assert machine.rate('A').recoveries == 0
