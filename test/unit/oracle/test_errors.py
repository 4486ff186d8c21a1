"""What the error of a setting tells, and how a source of settings says more of it."""

import pytest

from smach_oracle.oracle import errors
from smach_oracle.oracle.errors import SettingsError

PLAIN = SettingsError('prior', 2, 'a rate', problem='is odd')
IN_WORDS = SettingsError('prior', 2, 'a rate', 'prior: given twice')


def told(error):
    return str(error), error.key, error.value, error.allowed


def test_it_names_the_key_the_value_and_what_is_allowed():
    assert told(PLAIN) == ('prior: 2 is odd; allowed: a rate', 'prior', 2, 'a rate')
    assert told(IN_WORDS) == ('prior: given twice', 'prior', 2, 'a rate')
    assert str(SettingsError('prior', 2, 'a rate')) == 'prior: 2 is not allowed; allowed: a rate'


def test_a_source_puts_its_place_before_it():
    said = 'file line 3: prior: 2 is odd; allowed: a rate'
    assert told(PLAIN.set_at('file line 3')) == (said, 'file line 3: prior', 2, 'a rate')
    assert str(IN_WORDS.set_at('file')) == 'file: prior: given twice'


def test_the_same_may_be_said_of_another_key_or_with_more_that_is_allowed():
    for changed in (PLAIN.called('rate').allowing(' or none'), PLAIN.allowing(' or none')):
        assert str(changed) == changed.key + ': 2 is odd; allowed: a rate or none'
    assert (PLAIN.called('rate').key, str(IN_WORDS.called('rate'))) == ('rate', str(IN_WORDS))
    assert str(IN_WORDS.allowing(' or none')) == str(IN_WORDS)


def test_it_has_its_former_name_still_with_a_warning():
    with pytest.warns(FutureWarning, match='now called SettingsError') as warned:
        assert errors.ConfigError is SettingsError
    assert [each.filename for each in warned] == [__file__]
    with pytest.raises(AttributeError, match='NoSuchError'):
        _ = errors.NoSuchError
