"""Whether a file can be written is known before anything runs."""

import os

import pytest

from smach_oracle.oracle.settings.paths import why_not_writable


@pytest.mark.parametrize(
    'is_there, closed, replaced, why',
    [
        (True, (), False, ''),
        (False, (), False, ''),
        (True, (), True, ''),
        (True, ('file',), False, 'it is not for this user to write'),
        (True, ('file',), True, 'it is not for this user to write'),
        (True, ('folder',), False, ''),
        (True, ('folder',), True, 'the folder {} is not for this user to write in'),
        (False, ('folder',), False, 'the folder {} is not for this user to write in'),
    ],
)
def test_a_file_and_its_folder_may_be_closed(
    tmp_path, monkeypatch, is_there, closed, replaced, why
):
    path = tmp_path / 'rates.json'
    names = {'file': str(path), 'folder': str(tmp_path)}
    if is_there:
        path.write_text('{}')
    # for root nothing is closed
    monkeypatch.setattr(
        os, 'access', lambda path, mode: path not in [names[each] for each in closed]
    )
    assert why_not_writable(str(path), replaced) == why.format(tmp_path)


def test_a_folder_is_no_file_and_a_file_needs_one(tmp_path):
    assert why_not_writable(str(tmp_path)) == 'it is a folder'
    path = tmp_path / 'nowhere/rates.json'
    assert why_not_writable(str(path)) == 'there is no folder {}'.format(path.parent)
