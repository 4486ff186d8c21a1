"""The forms in which a setting may be given in Python, beside those of a YAML file."""

import copy
import pickle
import weakref

import pytest

import smach
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks
from smach_oracle.oracle.settings.checks import checked_prices, named_object
from smach_oracle.oracle.settings.health import HealthKind, checked_health
from smach_oracle.oracle.settings.paths import check_writable
from smach_oracle.oracle.settings.preconditions import PreconditionKind, parse_precondition
from smach_oracle.oracle.settings.settings import GROUPS, Settings, as_settings
from smach_oracle.oracle.settings.written import WrittenInt, WrittenWord, as_text, as_value

LIFTED = {'topic': '/lifted'}


def answers(name):
    """Resolve any name to this function."""
    assert name
    return answers


def test_what_stands_for_a_state_is_one_as_a_precondition():
    state = smach.State(['done'])
    spec = parse_precondition('preconditions', weakref.proxy(state))
    assert spec.kind is PreconditionKind.STATE


def test_what_may_be_left_out_may_be_none():
    check = checks.optional(checks.number(0, 1, 'from 0 to 1'))
    assert check('share', None) is None and check('share', 0.5) == 0.5


@pytest.mark.parametrize('given', [('goto', 'HOME'), {'goto': 'HOME'}, 'goto:HOME'])
def test_a_fallback_is_a_pair_a_mapping_or_a_text(given):
    assert checks.on_no_answer('on_no_answer', given) == ('goto', 'HOME')


@pytest.mark.parametrize('given', ['stop', ('stop', ''), {'stop': None}])
def test_to_stop_names_no_state(given):
    assert checks.on_no_answer('on_no_answer', given) == ('stop', '')


@pytest.mark.parametrize('given, limit', [(0, None), (None, None), (2, 2.0)])
def test_a_time_limit_of_0_is_none(given, limit):
    assert checks.time_limit('time_limit_s', given) == limit


@pytest.mark.parametrize('kind', [set, frozenset])
def test_words_of_a_set_are_sorted_and_those_of_a_list_are_as_given(kind):
    words = 'pick place look drive lift open'.split()
    assert checks.words('words', kind(words)) == tuple(sorted(words))
    assert checks.words('words', words) == tuple(words)


@pytest.mark.parametrize('given', [('goto', 'HOME', ''), ('goto', 3), 3, {}])
def test_any_other_fallback_is_refused(given):
    with pytest.raises(SettingsError, match='on_no_answer'):
        checks.on_no_answer('on_no_answer', given)


def test_a_fallback_that_yaml_reads_otherwise_says_so():
    with pytest.raises(SettingsError, match='is not allowed. YAML reads ON as true: write "ON"'):
        checks.on_no_answer('on_no_answer', {'goto': True})
    with pytest.raises(SettingsError, match="is not allowed; allowed: 'stop'"):
        checks.on_no_answer('on_no_answer', {'stop': True})


def test_prices_may_be_those_of_other_settings():
    prices = checked_prices('prices', {'expert_minute': 7})
    assert checked_prices('prices', prices) == prices
    assert prices.expert_minute == 7


def test_a_name_that_is_refused_with_a_reason_keeps_it():
    refused = SettingsError('key', 'name', 'another one')

    def refuse(name):
        raise refused

    with pytest.raises(SettingsError) as caught:
        named_object('key', 'python:a:b', 'function', refuse)
    assert caught.value is refused


def test_conditions_of_health_are_none_one_or_several():
    assert checked_health('healthy', None) == ()
    assert checked_health('healthy', WrittenWord('~', None)) == ()
    (one,) = checked_health('healthy', LIFTED)
    assert (one.kind, one.source) == (HealthKind.TOPIC, '/lifted')
    assert checked_health('healthy', [one, LIFTED]) == (one, one)


def test_what_is_no_condition_of_health_is_refused():
    with pytest.raises(SettingsError, match='healthy: .*a list of conditions'):
        checked_health('healthy', 3)
    with pytest.raises(SettingsError, match=r'healthy\[1\]'):
        checked_health('healthy', [LIFTED, 3])


def test_a_path_that_cannot_be_written_is_named(tmp_path):
    check_writable('rates_file', str(tmp_path / 'rates.json'))
    with pytest.raises(SettingsError, match='rates_file.*it is a folder'):
        check_writable('rates_file', str(tmp_path))


def test_a_precondition_may_be_checked_already_or_named():
    spec = parse_precondition('key', 'LOOK')
    assert parse_precondition('key', spec) is spec
    named = parse_precondition('key', 'python:module:answers', answers)
    assert (named.kind, named.target, named.name) == (
        PreconditionKind.CALLABLE,
        answers,
        'answers',
    )


def test_a_name_may_be_that_of_a_state():
    state = smach.State(['ok'])
    named = parse_precondition('key', 'python:module:state', lambda name: state)
    assert (named.kind, named.target) == (PreconditionKind.STATE, state)


def test_a_precondition_that_names_no_function_is_refused():
    with pytest.raises(SettingsError, match='names a value of type int'):
        parse_precondition('key', 'python:module:three', lambda name: 3)
    with pytest.raises(SettingsError, match='names cannot be imported here'):
        parse_precondition('key', 'python:module:three')


def test_preconditions_beside_the_settings_are_a_mapping():
    with pytest.raises(SettingsError, match='preconditions: .*a mapping of state labels to lists'):
        as_settings(None, ['LOOK'])
    with pytest.raises(SettingsError, match='preconditions: .*a mapping of state labels to lists'):
        as_settings(Settings(), 'LOOK')
    with pytest.raises(
        SettingsError, match='preconditions: 1 is not allowed.*names that are strings'
    ):
        as_settings(None, {1: ['A']})


@pytest.mark.parametrize(
    'copied', [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_a_word_of_a_file_keeps_what_it_means_when_it_is_copied(copied):
    word = copied(WrittenWord('ON', True))
    assert (as_text(word), as_value(word), type(as_text(word))) == ('ON', True, str)


def test_a_number_of_a_file_is_a_name_where_one_is_expected():
    number = WrittenInt(2)
    number.text = '02'
    assert (as_text(number), as_text(2), as_text('2')) == ('02', 2, '2')


def test_each_older_key_is_the_field_of_its_setting():
    older = GROUPS.older_keys()
    assert older['deadline_s'] == 'expert.deadline_s'
    assert 'checkpoint' not in older, 'a group may be given by its short form'
    for name, key in older.items():
        assert GROUPS.key_of(name) == key and hasattr(Settings(), name)
        assert name != key, 'it is no older one'
