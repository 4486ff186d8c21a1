"""Bags over a limit go, and never one that is open, written, held or unanswered."""

import fcntl
import os
import time

import pytest
from fake_trials import FakeMachine

from smach_oracle.analysis.trials import load_trials
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.ros.disk import bag_folder
from smach_oracle.ros.disk.bag_folder import BagFolder, remove
from smach_oracle.ros.disk.disk_command import main
from smach_oracle.ros.disk.limits import Limits, planned
from smach_oracle.ros.disk.pruner import Pruner
from smach_oracle.ros.recorder import TrialRecorder
from smach_oracle.ros.recording.bag_writer import BagWriter

DAY_S = 86400.0
OLD, NEW = 40, 1  # days
ONE_MONTH = ['--keep-days', '30']


def quiet(_):
    pass


@pytest.fixture
def folder(tmp_path):
    return tmp_path / 'bags'


def record(folder, name, days, tell=None, ends=True):
    """The bag of one trial, so many days old; `tell` tells more of it."""
    recorder = TrialRecorder(str(folder), warn=quiet, say=quiet)
    before = set(folder.glob('*.bag'))

    told = []
    machine = FakeMachine(told.append)
    machine.run(3, name)
    if not ends:
        assert told.pop().kind is EventKind.TRIAL_END
    for kind, fields in tell or ():
        machine.emit(kind, **fields)
    for event in told:
        recorder(event)
    assert recorder.close(60.0)
    (bag,) = set(folder.glob('*.bag')) - before
    age(bag, days)
    return bag


def age(path, days):
    at = time.time() - days * DAY_S
    os.utime(str(path), (at, at))


def stays(folder, bag, capsys, why):
    """Whether a bag outlives the command, which says why."""
    assert main([str(folder), '--delete'] + ONE_MONTH) == 0
    said = capsys.readouterr().out
    return bag.exists() and '{}: '.format(bag) in said and why in said


def test_nothing_goes_before_it_is_asked_for(folder, capsys):
    bag = record(folder, 'old', OLD)
    assert main([str(folder)] + ONE_MONTH) == 0
    said = capsys.readouterr().out
    assert 'would go {}'.format(bag) in said and '40.0 days old' in said
    assert 'nothing was removed' in said and bag.exists()
    assert main([str(folder), '--delete']) == 2 and bag.exists(), 'no limit, nothing goes'


def test_what_is_older_goes_after_it_was_named(folder, capsys, monkeypatch):
    old, new = record(folder, 'old', OLD), record(folder, 'new', NEW)
    said_before = []
    unlink = os.unlink
    monkeypatch.setattr(
        os, 'unlink', lambda path: (said_before.append(capsys.readouterr().out), unlink(path))
    )
    assert main([str(folder), '--delete'] + ONE_MONTH) == 0
    assert not old.exists() and new.exists()
    assert 'removes {}'.format(old) in said_before[0]


def test_the_oldest_go_until_the_rest_is_small_enough(folder):
    bags = [record(folder, 'trial-{}'.format(days), days) for days in (9, 5, 7)]
    limit = (os.path.getsize(str(bags[1])) + os.path.getsize(str(bags[2])) + 10) / 1e9
    assert main([str(folder), '--delete', '--keep-gb', str(limit)]) == 0
    assert [bag.exists() for bag in bags] == [False, True, True]


def test_what_remains_is_counted_as_before(folder):
    record(folder, 'old', OLD)
    kept = record(folder, 'new', NEW)
    before = [trial for trial in load_trials([str(folder)]).trials if trial.trial_id == 'new']
    rates = folder / 'rates.json'
    rates.write_text('{}')
    age(rates, OLD)
    assert main([str(folder), '--delete'] + ONE_MONTH) == 0
    assert load_trials([str(folder)]).trials == before
    assert sorted(folder.iterdir()) == sorted([kept, rates]), 'rates are in no bag'


# -- never


def test_never_a_trial_that_has_not_ended(folder, capsys):
    bag = record(folder, 'stopped', OLD, ends=False)
    assert stays(folder, bag, capsys, 'trial stopped has not ended')


@pytest.mark.parametrize('data', [{'ended_by': 'stopped', 'can_go_on': True}, {'ended_by': 'kept'}])
def test_never_a_stored_trial_that_may_be_resumed(folder, capsys, data):
    tell = [(EventKind.TRIAL_END, {'data': data})]
    bag = record(folder, 'a', OLD, tell, ends=False)
    assert stays(folder, bag, capsys, 'trial a has not ended')
    # the program that resumed it has ended it
    record(folder, 'a', OLD)
    assert main([str(folder), *ONE_MONTH, '--delete']) == 0
    assert not list(folder.glob('*.bag'))


def test_a_trial_that_was_stopped_and_is_in_no_store_goes(folder):
    tell = [(EventKind.TRIAL_END, {'data': {'ended_by': 'stopped'}})]
    record(folder, 'a', OLD, tell, ends=False)
    assert main([str(folder), *ONE_MONTH, '--delete']) == 0
    assert not list(folder.glob('*.bag'))


def test_never_a_trial_whose_question_is_open(folder, capsys):
    opened = (EventKind.QUERY_OPENED, {'state': 'PICK', 'query_id': 'q'})
    end = (EventKind.TRIAL_END, {'outcome': 'aborted'})
    bag = record(folder, 'asked', OLD, [opened, end], ends=False)
    assert stays(folder, bag, capsys, 'has a question open')


def test_an_answered_question_is_none(folder):
    told = [
        (EventKind.QUERY_OPENED, {'query_id': 'q'}),
        (EventKind.QUERY_EXPIRED, {'query_id': 'q'}),
        (EventKind.TRIAL_END, {}),
    ]
    bag = record(folder, 'asked', OLD, told, ends=False)
    assert main([str(folder), '--delete'] + ONE_MONTH) == 0 and not bag.exists()


def test_never_one_that_is_being_written(folder):
    record(folder, 'old', OLD)
    recorder = TrialRecorder(str(folder), warn=quiet, say=quiet)
    recorder(Event(EventKind.TRIAL_START, 'runs', 0, 1.7e9, 'TASK'))
    deadline = time.monotonic() + 30
    while not list(folder.glob('*.active')):
        assert time.monotonic() < deadline
    (active,) = folder.glob('*.active')
    age(active, OLD)
    assert main([str(folder), '--delete'] + ONE_MONTH) == 0
    assert list(folder.iterdir()) == [active]
    recorder.close(60.0)


@pytest.mark.parametrize('suffix', ['.mending', '.damaged', '.active'])
def test_never_one_that_is_being_mended(folder, capsys, suffix):
    bag = record(folder, 'old', OLD)
    (folder / (bag.name + suffix)).write_bytes(b'')
    assert stays(folder, bag, capsys, 'being written or mended')


def test_never_one_that_is_held_by_a_lock(folder, capsys, monkeypatch):
    bag = record(folder, 'old', OLD)
    monkeypatch.setattr(bag_folder, '_open_files', set)
    with bag.open('rb') as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert stays(folder, bag, capsys, 'holds it by a lock')
    assert main([str(folder), '--delete'] + ONE_MONTH) == 0 and not bag.exists()


def test_never_one_that_a_program_has_open(folder, capsys):
    bag = record(folder, 'old', OLD)
    with bag.open('rb'):
        assert stays(folder, bag, capsys, 'a program has it open')
    assert main([str(folder), '--delete'] + ONE_MONTH) == 0 and not bag.exists()


def test_never_what_is_not_ours_or_cannot_be_read(folder, capsys):
    record(folder, 'new', NEW)
    other, broken, link = (folder / name for name in ('other.bag', 'broken.bag', 'link.bag'))
    writer = BagWriter(str(other))
    writer.close()
    broken.write_bytes(b'#ROSBAG V2.0\n')
    link.symlink_to(folder / 'nowhere.bag')
    for each in (other, broken):
        age(each, OLD)
    assert stays(folder, other, capsys, 'no events of the executive')
    assert stays(folder, broken, capsys, 'it cannot be read')
    assert link.is_symlink()


def test_a_trial_goes_or_stays_with_all_its_bags(folder):
    first = record(folder, 'cut', OLD, ends=False)
    second = record(folder, 'cut', NEW)
    assert main([str(folder), '--delete'] + ONE_MONTH) == 0
    assert first.exists() and second.exists(), 'its newest bag counts'
    age(second, OLD)
    assert main([str(folder), '--delete'] + ONE_MONTH) == 0
    assert not first.exists() and not second.exists(), 'it has ended in the second'


def test_one_that_has_changed_since_it_was_looked_at_stays(folder):
    bag = record(folder, 'old', OLD)
    plan = planned(BagFolder(str(folder)).bags(), Limits(days=30), time.time())
    with bag.open('ab') as stream:
        stream.write(b'more')
    warned = []
    assert remove(plan, quiet, warned.append) == 0
    assert bag.exists() and 'it has changed' in warned[0]


# -- the recorder


def test_a_recorder_prunes_when_a_bag_is_closed_and_says_so_before(folder):
    old = record(folder, 'old', OLD)
    said = []
    recorder = TrialRecorder(
        str(folder),
        say=lambda text: said.append((text, old.exists())),
        warn=quiet,
        keep=Limits(days=30),
    )
    FakeMachine(recorder).run(4, 'new')
    deadline = time.monotonic() + 60
    while old.exists():
        assert time.monotonic() < deadline
    recorder.close(60.0)
    line, was_there = next(each for each in said if each[0].startswith('removes '))
    assert str(old) in line and was_there
    assert [each.trial_id for each in load_trials([str(folder)]).trials] == ['new']


def test_a_recorder_keeps_all_unless_it_is_told(folder):
    old = record(folder, 'old', 4000)
    recorder = TrialRecorder(str(folder), say=quiet, warn=quiet)
    FakeMachine(recorder).run(4, 'new')
    assert recorder.close(60.0)
    assert recorder._pruner._thread is None and old.exists()


def test_no_bag_is_read_before_a_limit_is_reached(folder, monkeypatch):
    record(folder, 'new', NEW)
    monkeypatch.setattr(BagFolder, 'bags', lambda _: pytest.fail('all bags were read'))
    Pruner(str(folder), Limits(30, 1.0), pytest.fail, pytest.fail).prune()
    assert len(list(folder.iterdir())) == 1


def test_a_folder_that_is_not_there_is_told(tmp_path, capsys):
    assert main([str(tmp_path / 'nowhere')] + ONE_MONTH) == 2
    assert 'nowhere: no such folder or store' in capsys.readouterr().err


@pytest.mark.parametrize('days', ['x', '0', '-1', 'nan', 'inf'])
def test_an_amount_that_is_not_a_number_above_0_is_told(folder, capsys, days):
    with pytest.raises(SystemExit) as caught:
        main([str(folder), '--keep-days', days])
    assert caught.value.code == 2
    assert (
        '--keep-days: {} is not allowed; allowed: a number above 0'.format(days)
        in capsys.readouterr().err
    )
