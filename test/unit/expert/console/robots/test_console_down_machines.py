"""Machines that are down, as the console reads them in stores."""

import os

import pytest

from smach_oracle.expert.console.robots.down_machines import DownMachines
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.console.web.settings import read_settings
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.store.codecs import Codecs
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.store_file import NewTrial, StoreFile


def moment(at, *facts):
    return NewMoment(
        at,
        int(at),
        'STATE_START',
        'TASK',
        'PICK',
        tuple(Fact('TASK', name, Codecs().encode(value)) for name, value in facts),
    )


@pytest.fixture
def path(tmp_path):
    return str(tmp_path / 'robot.db')


@pytest.fixture
def store(path):
    """Of a machine that was stopped while it picked a cup."""
    opened = StoreFile(path)
    number = opened.begin_trial(NewTrial('TASK', 'abc', ('id', '{}'), 5.0))
    opened.add(number, [moment(7.0, ('at', ['PICK', 'in']), ('key:cup', '<b>red</b>'))])
    yield opened
    opened.close()


def down(machines, sections):
    machines.look()
    return sections.get('down')


def test_a_stopped_machine_is_told_with_all_that_is_stored(path, store):
    sections = PageSections()
    (row,) = down(DownMachines([path], sections), sections)
    assert (row['machine'], row['since'], row['problem']) == ('TASK', 7.0, '')
    assert row['stood'] == ['TASK/PICK was under way']
    assert row['userdata'] == [['TASK', 'cup', '"<b>red</b>"']]
    assert row['command'] == 'rosrun smach_oracle oracle_state {} show --trial 1'.format(path)


def test_one_that_a_living_process_holds_is_not_down(path, store):
    sections = PageSections()
    machines = DownMachines([path], sections)
    lock = MachineLock(path, 'TASK')
    lock.take()
    assert down(machines, sections) == []
    lock.release()
    assert len(down(machines, sections)) == 1


def test_what_is_stored_later_is_seen_and_an_ended_trial_is_not_down(path, store):
    sections = PageSections()
    machines = DownMachines([path], sections)
    assert down(machines, sections)[0]['since'] == 7.0
    store.add(1, [moment(9.0)])
    assert down(machines, sections)[0]['since'] == 9.0
    store.end_trial(1, 10.0, 'succeeded')
    assert down(machines, sections) == []


def test_a_store_that_cannot_be_read_is_told(path, store, tmp_path):
    (tmp_path / 'notes.txt').write_text('These are my notes, and no store of a machine. ' * 20)
    sections = PageSections()
    rows = down(
        DownMachines([str(tmp_path / 'none.db'), str(tmp_path / 'notes.txt'), path], sections),
        sections,
    )
    assert [bool(row['problem']) for row in rows] == [True, True, False]
    assert 'there is no such store' in rows[0]['problem']
    assert 'is damaged, or no store' in rows[1]['problem']
    assert not os.path.exists(str(tmp_path / 'none.db'))


def test_looking_leaves_the_store_as_it_is(path, store):
    store.close()
    with open(path, 'rb') as stream:
        before = stream.read()
    names = sorted(os.listdir(os.path.dirname(path)))
    sections = PageSections()
    assert down(DownMachines([path], sections), sections)
    with open(path, 'rb') as stream:
        assert stream.read() == before
    assert sorted(os.listdir(os.path.dirname(path))) == names


def test_without_stores_there_is_no_section():
    sections = PageSections()
    DownMachines([], sections).look()
    assert sections.get('down') is None


def test_stores_are_a_setting():
    given = {'stores': '/a.db:/b.db'}
    assert read_settings(given.get).stores == ('/a.db', '/b.db')
    with pytest.raises(SettingsError, match='~stores: 7 is not allowed; allowed: files'):
        read_settings({'stores': 7}.get)
