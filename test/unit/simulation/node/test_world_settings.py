"""The world's parameters: what cannot be used is refused by its name before anything is
simulated.
"""

import pytest

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.simulation.node.settings import read_settings


def settings_with(name, value):
    return read_settings(lambda asked, default: value if asked == name else default)


@pytest.mark.parametrize(
    'name, words',
    [
        ('nowhere/truth.jsonl', 'there is no folder .*nowhere'),
        ('.', 'it is a folder'),
        ('file/truth.jsonl', 'there is no folder'),
    ],
)
def test_a_truth_file_that_cannot_be_written_is_told_at_the_start(
    tmp_path, monkeypatch, name, words
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'file').write_text('')
    with pytest.raises(SettingsError, match='~truth_file: .*' + words):
        settings_with('~truth_file', name)


def test_a_truth_file_may_be_there_or_in_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv('HOME', str(tmp_path))
    assert settings_with('~truth_file', '~/truth.jsonl').truth_file == str(tmp_path / 'truth.jsonl')
    (tmp_path / 'truth.jsonl').write_text('')
    assert settings_with('~truth_file', str(tmp_path / 'truth.jsonl')).truth_file == str(
        tmp_path / 'truth.jsonl'
    )
    assert settings_with('~truth_file', 'none').truth_file == 'none'
