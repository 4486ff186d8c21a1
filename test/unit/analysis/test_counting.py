"""Many bags: kept counts and several processes give what one process gives that reads them all."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from smach_oracle.analysis.bag_events import EventReader, RecordedCause
from smach_oracle.analysis.counting import bag_counts, kept_counts
from smach_oracle.analysis.counting.kept_counts import FILE, KEPT_DAYS
from smach_oracle.analysis.counting.summary_text import shared_by, summaries_in_all, text_of
from smach_oracle.analysis.counting.trial_summary import TrialSummary
from smach_oracle.analysis.trial_counter import TrialEnding
from smach_oracle.analysis.trials import load_by_state, load_trials
from smach_oracle.oracle.settings.failure_rule import FailureRule

BAGS = 8
LONG_AGO_S = 1_600_000_000


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """The file of kept counts, with limits that a few bags reach."""
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    for limit, value in (('KEPT_FROM', 1), ('SHARED_FROM', 1), ('GROUP', 3)):
        monkeypatch.setattr(bag_counts, limit, value)
    return tmp_path / 'cache' / 'smach_oracle' / FILE


@pytest.fixture
def folder(record):
    """Bags that nobody has changed for long."""
    place = record('bags', BAGS)
    for bag in bags_of(place):
        os.utime(str(bag), (LONG_AGO_S, LONG_AGO_S))
    return place


@pytest.fixture
def read(monkeypatch):
    """The bags that are read in this process, in their order."""
    paths, real = [], EventReader.read

    def noted(self, path):
        paths.append(path)
        return real(self, path)

    monkeypatch.setattr(EventReader, 'read', noted)
    return paths


def bags_of(place):
    return sorted(Path(place).glob('*.bag'))


def rows_in(cache):
    connection = sqlite3.connect(str(cache))
    try:
        return connection.execute('SELECT * FROM counts').fetchall()
    finally:
        connection.close()


def test_bags_that_did_not_change_are_not_read_again(cache, folder, read):
    first = load_trials([folder])
    assert len(read) == BAGS and len(first.trials) == BAGS
    read.clear()
    assert load_trials([folder]) == first
    assert not read


def test_a_folder_of_another_name_has_the_same_bags(cache, folder, read):
    first = load_trials([folder])
    read.clear()
    os.rename(folder, folder + '_2')
    again = load_trials([folder + '_2'])
    assert not read
    assert [trial.trial_id for trial in again.trials] == [each.trial_id for each in first.trials]
    assert {trial.replicate for trial in again.trials} == {folder + '_2'}


def test_another_content_of_the_same_size_and_date_is_read(cache, folder):
    load_trials([folder])
    bag = bags_of(folder)[0]
    bag.write_bytes(b'x' + bag.read_bytes()[1:])
    os.utime(str(bag), (LONG_AGO_S, LONG_AGO_S))
    found = load_trials([folder])
    assert [item.path for item in found.skipped] == [str(bag)]
    assert len(found.trials) == BAGS - 1


def test_a_bag_that_was_written_just_now_is_not_kept(cache, folder, read):
    bag = bags_of(folder)[0]
    os.utime(str(bag))
    load_trials([folder])
    read.clear()
    load_trials([folder])
    assert read == [str(bag)]


def test_a_bag_that_cannot_be_used_is_tried_each_time(cache, folder, read):
    bag = bags_of(folder)[0]
    bag.write_bytes(b'no bag')
    os.utime(str(bag), (LONG_AGO_S, LONG_AGO_S))
    first = load_trials([folder])
    read.clear()
    assert load_trials([folder]) == first
    assert read == [str(bag)]


def test_each_rule_has_counts_of_its_own(cache, folder, read):
    by_record = load_trials([folder])
    read.clear()
    by_list = load_trials([folder], FailureRule(('succeeded',)))
    assert len(read) == BAGS
    assert {each.rule for each in by_list.trials} != {each.rule for each in by_record.trials}
    assert {each.ending for each in by_list.trials} != {each.ending for each in by_record.trials}
    read.clear()
    assert load_trials([folder], FailureRule(('succeeded',))) == by_list
    assert not read


def test_another_version_of_the_package_counts_anew(cache, folder, read, monkeypatch):
    load_trials([folder])
    read.clear()
    monkeypatch.setattr(kept_counts, '_version', lambda: 'another')
    load_trials([folder])
    assert len(read) == BAGS


def test_the_version_is_that_of_the_files_that_count(tmp_path, monkeypatch):
    counting = (
        'analysis/counting/a.py',
        'oracle/records/b.py',
        'bag_format.py',
        'trial_counter.py',
    )
    for name in (*counting, 'ros/c.py'):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text('')
    assert all((kept_counts._PACKAGE / part).exists() for part in kept_counts._COUNTS)
    monkeypatch.setattr(kept_counts, '_PACKAGE', tmp_path)
    before = kept_counts._version()
    (tmp_path / 'ros/c.py').write_text('import os')
    assert kept_counts._version() == before
    for name in counting:
        (tmp_path / name).write_text('import os')
        assert kept_counts._version() != before
        before = kept_counts._version()


@pytest.mark.parametrize('content', [b'no database', b''])
def test_a_damaged_file_is_made_anew(cache, folder, read, content):
    first = load_trials([folder])
    cache.write_bytes(content)
    assert load_trials([folder]) == first
    load_trials([folder])
    read.clear()
    assert load_trials([folder]) == first
    assert not read


def test_a_damaged_page_does_no_harm(cache, folder):
    first = load_trials([folder])
    data = bytearray(cache.read_bytes())
    data[4096:] = os.urandom(len(data) - 4096)
    cache.write_bytes(bytes(data))
    for _ in range(3):
        assert load_trials([folder]) == first


def test_a_text_that_is_none_of_ours_is_counted_anew(cache, folder, read):
    first = load_trials([folder])
    connection = sqlite3.connect(str(cache))
    connection.execute("UPDATE counts SET text = '[[1, 2]]'")
    connection.commit()
    connection.close()
    read.clear()
    assert load_trials([folder]) == first
    assert len(read) == BAGS


def test_without_a_folder_to_write_in_nothing_is_kept(tmp_path, cache, folder, read, monkeypatch):
    (tmp_path / 'file').write_text('')
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'file'))
    assert load_trials([folder]) == load_trials([folder])
    assert len(read) == 2 * BAGS


def test_a_file_that_another_count_writes_is_waited_for_shortly(cache, folder, monkeypatch):
    first = load_trials([folder])
    monkeypatch.setattr(kept_counts, '_BUSY_S', 0.01)
    connection = sqlite3.connect(str(cache), isolation_level=None)
    connection.execute('BEGIN EXCLUSIVE')
    assert load_trials([folder]) == first
    connection.execute('ROLLBACK')
    connection.close()
    assert len(rows_in(cache)) == BAGS


def test_a_text_that_bags_share_and_that_is_gone_has_them_read_again(cache, folder, read):
    first = load_trials([folder])
    connection = sqlite3.connect(str(cache))
    assert connection.execute('DELETE FROM shared').rowcount == 1
    connection.commit()
    connection.close()
    read.clear()
    assert load_trials([folder]) == first
    assert len(read) == bag_counts.GROUP  # which keeps it again
    read.clear()
    assert load_trials([folder]) == first
    assert not read


def test_what_is_old_is_dropped(cache, folder, monkeypatch):
    load_trials([folder])
    now = time.time()
    monkeypatch.setattr(kept_counts.time, 'time', lambda: now + (KEPT_DAYS + 1) * 86400)
    bag = bags_of(folder)[0]
    os.utime(str(bag), (LONG_AGO_S + 1, LONG_AGO_S + 1))
    load_trials([folder])
    assert len(rows_in(cache)) == 1


def test_few_bags_leave_no_file(cache, folder, monkeypatch):
    monkeypatch.setattr(bag_counts, 'KEPT_FROM', BAGS + 1)
    load_trials([folder])
    assert not cache.exists()


def test_a_trial_in_two_bags_is_counted_once(cache, folder, tmp_path):
    bag = bags_of(folder)[0]
    copy = tmp_path / 'bags' / 'copy.bag'
    copy.write_bytes(bag.read_bytes())
    os.utime(str(copy), (LONG_AGO_S, LONG_AGO_S))
    first = load_trials([folder])
    assert load_trials([folder]) == load_trials([folder], None, 2) == first
    assert len(first.trials) == BAGS
    assert {str(bag), str(copy)} in [set(trial.bags) for trial in first.trials]


def test_several_processes_give_the_same(cache, folder):
    bag = bags_of(folder)[4]
    bag.write_bytes(b'no bag')
    one, one_by_state = load_trials([folder]), load_by_state([folder])
    cache.unlink()
    assert load_trials([folder], None, 3) == one
    assert load_trials([folder], None, 3) == one  # by what the others counted, and is kept
    assert load_by_state([folder], None, 3) == one_by_state


def test_a_process_that_dies_costs_nothing(cache, folder, monkeypatch):
    whole, here = load_trials([folder]), os.getpid()
    cache.unlink()
    real = EventReader.read

    def dies_elsewhere(self, path):
        if os.getpid() != here and path == str(bags_of(folder)[3]):
            os.kill(os.getpid(), signal.SIGKILL)
        return real(self, path)

    monkeypatch.setattr(EventReader, 'read', dies_elsewhere)
    assert load_trials([folder], None, 2) == whole


def test_without_other_processes_this_one_counts(cache, folder, monkeypatch):
    whole = load_trials([folder])
    cache.unlink()

    def no_fork():
        raise BlockingIOError('no more processes')

    before = len(os.listdir('/proc/self/fd'))
    monkeypatch.setattr(os, 'fork', no_fork)
    assert load_trials([folder], None, 3) == whole
    assert len(os.listdir('/proc/self/fd')) == before


WHILE_IT_READS = """
real = EventReader.read
def slow(self, path):
    os.write(1, b'.')
    time.sleep(1.0)
    return real(self, path)
EventReader.read = slow
"""
WHILE_A_PROCESS_BEGINS = """
def begin_slowly():
    os.write(1, b'.')
    time.sleep(1.0)
os.register_at_fork(after_in_child=begin_slowly)
"""


@pytest.mark.parametrize(
    'instant', [WHILE_IT_READS, WHILE_A_PROCESS_BEGINS], ids=['it_reads', 'a_process_begins']
)
def test_ctrl_c_ends_all_processes_quietly(instant, cache, folder):
    """The signal goes to the whole group, as that of a terminal does."""
    script = f"""
import os, sys, time
from smach_oracle.analysis.bag_events import EventReader
from smach_oracle.analysis.counting import bag_counts
from smach_oracle.analysis.trials import load_trials
bag_counts.KEPT_FROM = bag_counts.SHARED_FROM = bag_counts.GROUP = 1
{instant}
try:
    load_trials(sys.argv[1:], None, 2)
except KeyboardInterrupt:
    sys.exit(130)
"""
    process = subprocess.Popen(
        [sys.executable, '-c', script, folder],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert process.stdout.read(1) == '.'
    os.killpg(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert (process.returncode, told) == (130, '')


texts = st.text(max_size=5)
numbers = st.floats(allow_nan=False)
counts = st.integers(0, 9)
plain = st.none() | st.booleans() | counts | numbers | texts
pairs = st.lists(st.tuples(texts, plain | st.lists(plain, max_size=2)), max_size=3).map(tuple)
names = st.lists(texts, max_size=2).map(tuple)
summaries = st.builds(
    TrialSummary,
    trial_id=texts,
    experiment=texts,
    recovers=st.none() | st.booleans(),
    start_time=numbers,
    duration_s=numbers,
    ending=st.sampled_from(TrialEnding),
    outcome=texts,
    failures=counts,
    recoveries=counts,
    questions=counts,
    answered=counts,
    failures_by_state=st.lists(st.tuples(texts, counts), max_size=3).map(tuple),
    lost_events=counts,
    bags=st.just(('a.bag',)),
    settings=pairs,
    cause=st.none() | st.builds(RecordedCause, counts, texts, names, names),
    truth=st.none(),
    unwell_s=numbers,
    resumed=counts,
    down_s=numbers,
    rule=st.builds(FailureRule, st.none() | names, st.integers(1, 3)),
    node=texts,
    origin=st.lists(st.tuples(texts, texts), max_size=2).map(tuple),
    inputs=pairs,
)


@given(st.lists(summaries, max_size=3))
def test_a_text_says_all_of_some_summaries(found):
    text = text_of(found)
    shared = shared_by(dict(text.shared).__getitem__)
    assert summaries_in_all({'a.bag': text.text}, shared) == {'a.bag': found}
