"""Bags are found in folders and below, whatever else lies there."""

import json
import os

import pytest

from smach_oracle.analysis import bag_statistics
from smach_oracle.analysis.bag_events import find_bags

MANY = 20000


@pytest.fixture
def closed(monkeypatch):
    """Folders called closed may not be read, and those called gone are removed meanwhile."""
    real = os.scandir

    def scandir(path):
        if os.path.basename(path) == 'closed':
            raise PermissionError(13, 'Permission denied', path)
        if os.path.basename(path) == 'gone':
            raise FileNotFoundError(2, 'No such file or directory', path)
        return real(path)

    monkeypatch.setattr(os, 'scandir', scandir)


def test_a_folder_that_may_not_be_read_is_named_and_the_others_are_searched(tmp_path, closed):
    for name in ('closed', 'open', 'open/closed', 'gone'):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'a.bag').touch()
    found = [str(tmp_path / 'open' / 'a.bag')]
    assert find_bags([str(tmp_path)]) == found
    skipped = []
    assert find_bags([str(tmp_path), str(tmp_path / 'open')], skipped) == found
    assert skipped == [
        (str(tmp_path / name), 'this folder cannot be read: Permission denied')
        for name in ('closed', 'open/closed')
    ]


def test_the_command_names_it_and_its_exit_code_tells(record, tmp_path, closed, capsys):
    folder = record('bags', 3)
    assert bag_statistics.main([folder]) == 0
    whole = capsys.readouterr().out
    (tmp_path / 'bags' / 'closed').mkdir()
    assert bag_statistics.main([folder, '--json', str(tmp_path / 'all.json')]) == 1
    out, err = capsys.readouterr()
    reason = 'this folder cannot be read: Permission denied'
    assert out == whole and err == 'Skipped {}/closed: {}\n'.format(folder, reason)
    (skipped,) = json.loads((tmp_path / 'all.json').read_text())['skipped']
    assert skipped == {'path': folder + '/closed', 'reason': reason}
    assert bag_statistics.main([folder + '/closed']) == 2
    assert reason in capsys.readouterr().err


def test_one_that_is_half_written_is_found_and_no_other_file_is(tmp_path):
    for name in ('a.bag.active', 'b.bag', 'b.orig.bag', 'c.bag.tmp', 'notes.txt'):
        (tmp_path / name).touch()
    (tmp_path / 'folder.bag').mkdir()
    found = [os.path.basename(each) for each in find_bags([str(tmp_path)])]
    assert found == ['a.bag.active', 'b.bag']


def test_a_folder_of_very_many_names_is_searched_once(tmp_path, monkeypatch):
    for number in range(MANY):
        (tmp_path / '{:06d}.bag'.format(number)).touch()
    looked, real = [], os.scandir
    monkeypatch.setattr(os, 'scandir', lambda path: looked.append(path) or real(path))
    found = find_bags([str(tmp_path)])
    assert len(found) == MANY and found == sorted(found) and len(looked) == 1
