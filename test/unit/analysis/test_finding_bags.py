"""Bags are found in folders and below, whatever else lies there."""

import os

from smach_oracle.analysis.bag_events import find_bags

MANY = 20000


def test_a_folder_that_may_not_be_read_has_none_and_the_others_are_searched(tmp_path, monkeypatch):
    for name in ('closed', 'open'):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'a.bag').touch()
    real = os.scandir

    def scandir(path):
        if os.path.basename(path) == 'closed':
            raise PermissionError(13, 'Permission denied', path)
        return real(path)

    monkeypatch.setattr(os, 'scandir', scandir)
    assert find_bags([str(tmp_path)]) == [str(tmp_path / 'open' / 'a.bag')]


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
