"""Bags that attack their reader: only plain files inside the folders are read, by a process with
limits, and what is refused is named.
"""

import math
import os
import resource
import shutil
import socket
import threading

import pytest
from crafted_bags import crafted_bag, event
from waiting import wait_for

from smach_oracle.analysis.bag_events import BagError, EventReader
from smach_oracle.analysis.bag_worker import BagReadError, BagRequest
from smach_oracle.expert.console.trials import bag_catalogue
from smach_oracle.expert.console.trials.bag_catalogue import BagCatalogue
from smach_oracle.expert.console.trials.bag_folders import BagFolders
from smach_oracle.expert.console.trials.bag_process import read_bags
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.oracle.records.events import EventKind

MOST_GROWTH = 200000  # KiB of this process, while it has another one read
TOO_LARGE = 'damaged, or too large: it takes more than 512 MiB of memory'


@pytest.fixture
def folder(tmp_path):
    """One that has a good bag."""
    (tmp_path / 'bags').mkdir()
    (tmp_path / 'bags' / 'good.bag').write_bytes(crafted_bag())
    return tmp_path / 'bags'


def scanned(*folders):
    """The section after a scan, which has to end."""
    sections = PageSections()
    catalogue = BagCatalogue([str(folder) for folder in folders], sections)
    scan = threading.Thread(target=catalogue.scan, daemon=True)
    scan.start()
    assert wait_for(lambda: not scan.is_alive()), 'the reader hangs'
    return sections.get('bags')


def broken_in(folder):
    """Why bags are refused, by name; the good one is read anyway."""
    section = scanned(folder)
    assert [trial['bag'] for trial in section['trials']] == ['good.bag']
    return {each['name']: each['reason'] for each in section['broken']}


def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def test_a_pipe_a_socket_and_a_folder_are_named_and_hold_nobody_up(folder):
    os.mkfifo(str(folder / 'pipe.bag'))
    os.mkfifo(str(folder / 'old.bag.active'))
    os.utime(str(folder / 'old.bag.active'), (1, 1))
    (folder / 'folder.bag').mkdir()
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(folder / 'socket.bag'))
        broken = broken_in(folder)
    assert broken == {
        'pipe.bag': 'no plain file, but a named pipe',
        'old.bag.active': 'no plain file, but a named pipe',
        'socket.bag': 'no plain file, but a socket',
    }


def test_a_file_that_has_become_a_pipe_since_it_was_found_is_not_opened(folder):
    path = folder / 'good.bag'
    path.unlink()
    os.mkfifo(str(path))
    told = []

    def read():
        with pytest.raises(BagReadError) as refused:
            read_bags(BagFolders([str(folder)]), BagRequest([str(path)], []))
        told.append(str(refused.value))

    threading.Thread(target=read, daemon=True).start()
    assert wait_for(lambda: told), 'it waits for who writes'
    assert told == ['no plain file, but a named pipe']


def test_a_link_that_leads_out_is_named_and_one_inside_is_the_bag_itself(folder, tmp_path):
    (tmp_path / 'secret.bag').write_bytes(crafted_bag(event(path='SECRET')))
    (folder / 'out.bag').symlink_to(tmp_path / 'secret.bag')
    (folder / 'device.bag').symlink_to('/dev/zero')
    (folder / 'nowhere.bag').symlink_to(tmp_path / 'nothing.bag')
    (folder / 'inside.bag').symlink_to(folder / 'good.bag')
    assert broken_in(folder) == {
        'out.bag': 'a link that leads out of the folder',
        'device.bag': 'a link that leads out of the folder',
    }


def test_a_file_that_has_become_a_link_since_it_was_found_is_not_read(folder, tmp_path):
    shutil.move(str(folder), str(tmp_path / 'elsewhere'))
    folders = BagFolders([str(folder)])
    folder.mkdir()
    for name, target in (('good.bag', 'elsewhere/good.bag'), ('deep', 'elsewhere')):
        (folder / name).symlink_to(tmp_path / target)
    for path in (folder / 'good.bag', folder / 'deep' / 'good.bag'):
        with pytest.raises(BagReadError, match='out of the folder'):
            read_bags(folders, BagRequest([str(path)], []))


def test_a_folder_that_is_a_link_itself_is_read(folder, tmp_path):
    (tmp_path / 'link').symlink_to(folder)
    assert broken_in(tmp_path / 'link') == {}


def test_a_small_bag_that_unpacks_to_a_gigabyte_takes_no_memory_here(folder):
    data = crafted_bag(unpacked_zeros=90)
    assert len(data) < 20000
    (folder / 'bomb.bag').write_bytes(data)
    before = peak()
    assert broken_in(folder) == {'bomb.bag': TOO_LARGE}
    assert peak() - before < MOST_GROWTH


def test_a_file_of_zeros_takes_no_memory_here(folder):
    with open(str(folder / 'zeros.bag'), 'wb') as zeros:
        zeros.truncate(900000000)
    before = peak()
    assert broken_in(folder) == {'zeros.bag': TOO_LARGE}
    assert peak() - before < MOST_GROWTH


def test_a_bag_that_takes_too_long_is_given_up(folder):
    path = folder / 'long.bag'
    path.write_bytes(crafted_bag(listed=500000))
    folders = BagFolders([str(folder)])
    with pytest.raises(BagReadError, match='more than 1 s of computing'):
        read_bags(folders, BagRequest([str(path)], [], most_events=600000, cpu_s=1))
    with pytest.raises(BagReadError, match='more than 0.001 s'):
        read_bags(folders, BagRequest([str(folder / 'good.bag')], []), wall_limit_s=0.001)


def test_a_bag_that_tells_too_much_is_refused(folder):
    (folder / 'long.bag').write_bytes(crafted_bag(event(trial_id='x' * 2000000)))
    assert 'more than 1 MB' in broken_in(folder)['long.bag']


def test_a_bag_whose_events_have_no_time_does_not_end_the_scan(folder):
    (folder / 'timeless.bag').write_bytes(crafted_bag(event(wall_time=math.nan)))
    assert 'no time' in broken_in(folder)['timeless.bag']


def test_what_may_not_be_opened_is_named(folder, monkeypatch):
    real = os.open

    def denied(path, *more, **named):
        if str(path).endswith('good.bag'):
            raise PermissionError(13, 'Permission denied', path)
        return real(path, *more, **named)

    monkeypatch.setattr(os, 'open', denied)
    assert scanned(folder)['broken'] == [
        {'name': 'good.bag', 'reason': 'it cannot be opened: Permission denied'}
    ]


def test_the_commands_hang_at_no_pipe_either(folder):
    os.mkfifo(str(folder / 'pipe.bag'))
    with pytest.raises(BagError, match='no plain file'):
        EventReader().read(str(folder / 'pipe.bag'))


def test_very_many_bags_of_one_trial_are_bounded(folder, monkeypatch):
    monkeypatch.setattr(bag_catalogue, 'MOST_BAGS_OF_A_TRIAL', 3)
    for number in range(5):
        shutil.copy(str(folder / 'good.bag'), str(folder / '{}.bag'.format(number)))
    sections = PageSections()
    catalogue = BagCatalogue([str(folder)], sections)
    catalogue.scan()
    (trial,) = sections.get('bags')['trials']
    assert len(catalogue.find(trial['number']).summary.bags) == 3


def test_what_the_words_of_an_event_tell_comes_out_of_the_reader(folder):
    told = {'to': 'KITCHEN/PICK', 'decided_by': 'policy', 'userdata': {'secret': 1}}
    (folder / 'jump.bag').write_bytes(crafted_bag(event(kind=EventKind.JUMP, data=told)))
    reply = read_bags(
        BagFolders([str(folder)]),
        BagRequest([str(folder / 'jump.bag')], ['crafted'], shown_events=9),
    )
    assert [each.data for each in reply.events] == [{'to': 'KITCHEN/PICK', 'decided_by': 'policy'}]
