"""Settings files of version 0.1 are accepted, with the effective values that they had."""

import pytest
import readings
from held import SETTINGS, expected, lacking

HELD = expected('settings')
TOKENS = 'tokens.txt'
# defaults that have changed on purpose, as the changelog says; what a file sets itself stays
CHANGED_DEFAULTS = {
    ".failing_outcomes: it was ['aborted', 'failed', 'failure', 'error'], it is None": (
        'failing_outcomes:'
    ),
    ".userdata: it was 'restore', it is None": 'userdata:',
    '.escalate: it was True, it is False': 'escalate:',
    '.most_questions: it was 12, it is 6': 'most_questions:',
}


def test_every_file_is_read():
    assert {path.name for path in SETTINGS.iterdir()} == set(HELD)


@pytest.mark.parametrize('name', sorted(set(HELD) - {TOKENS}))
def test_a_file_has_the_effective_values_that_it_had(name, monkeypatch):
    text = (SETTINGS / name).read_text()
    wrong = [
        each
        for each in lacking(HELD[name], readings.settings(name, monkeypatch))
        if each not in CHANGED_DEFAULTS or CHANGED_DEFAULTS[each] in text
    ]
    assert not wrong


def test_the_tokens_of_the_console_have_the_owners_that_they_had(tmp_path):
    assert not list(lacking(HELD[TOKENS], readings.tokens(tmp_path)))


def test_one_of_the_files_has_no_default_value_of_the_oracle():
    usual, other = HELD['oracle_all.yaml'], HELD['oracle_other.yaml']
    assert not [key for key in usual if usual[key] == other[key]]
    of_all, of_others = (file['states']['A_STATE_THAT_IS_NOWHERE'] for file in (usual, other))
    assert [key for key in of_all if of_all[key] == of_others[key]] == ['preconditions']
