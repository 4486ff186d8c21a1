"""The parameter ~answer_delay of the scripted expert."""

import pytest

from smach_oracle.expert.scripted_expert import delay_of
from smach_oracle.oracle.errors import SettingsError


@pytest.mark.parametrize('value, seconds', [('none', None), ('15.0', 15.0), (0, 0.0)])
def test_it_is_none_or_seconds(value, seconds):
    assert delay_of(value) == seconds


@pytest.mark.parametrize('value', ['soon', -1, 'inf', 'nan', 3601, None])
def test_anything_else_is_refused(value):
    with pytest.raises(SettingsError, match='~answer_delay'):
        delay_of(value)
