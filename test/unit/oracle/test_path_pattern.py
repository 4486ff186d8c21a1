"""Patterns of states."""

import pytest

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.names import PathPattern


@pytest.mark.parametrize(
    'pattern, path, label, meant',
    [
        ('PICK', 'TOP', 'PICK', True),
        ('PICK', 'TOP/NAV', 'PICK', True),
        ('PICK', 'TOP/PICK', 'GRASP', False),
        ('PICK_*', 'TOP', 'PICK_CUP', True),
        ('pick', 'TOP', 'PICK', False),
        ('TOP/NAV/DRIVE', 'TOP/NAV', 'DRIVE', True),
        ('/TOP/NAV/DRIVE', 'TOP/NAV', 'DRIVE', True),
        ('NAV/DRIVE', 'TOP/NAV', 'DRIVE', True),
        ('NAV/DRIVE', 'TOP/OTHER/NAV', 'DRIVE', False),
        ('NAV/*', 'TOP/NAV', 'DRIVE', True),
        ('NAV/*', 'TOP/NAV/INNER', 'DRIVE', False),
        ('NAV/**', 'TOP/NAV/INNER', 'DRIVE', True),
        ('**/DRIVE', 'TOP/NAV/INNER', 'DRIVE', True),
        ('**/DRIVE', 'TOP', 'DRIVE', True),
        ('**', 'TOP', 'ANY', True),
        ('*/A?', 'TOP', 'A1', True),
        ('TOP/NAV/DRIVE/ON', 'TOP/NAV', 'DRIVE', False),
        ('**/DRIVE/ON', 'TOP', 'DRIVE', False),
        ('**/DRIVE', 'TOP/NAV', 'TURN', False),
        ('TOP/**/NAV/DRIVE', 'TOP/ONE/TWO/NAV', 'DRIVE', True),
        ('TOP/**/NAV/DRIVE', 'TOP/ONE/NAV', 'DRIVE', True),
    ],
)
def test_which_states_are_meant(pattern: str, path: str, label: str, meant: bool) -> None:
    assert PathPattern(pattern).matches(path, label) is meant


@pytest.mark.parametrize('text', ['', '/', 'A//B', None, 3])
def test_what_is_no_pattern_is_refused(text: object) -> None:
    with pytest.raises(SettingsError, match='LABEL or PATH/LABEL'):
        PathPattern(text)  # type: ignore[arg-type]
