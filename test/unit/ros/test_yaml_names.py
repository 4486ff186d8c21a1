"""Labels and outcomes in a file are what is written there, although YAML reads ON as true."""

import pytest

from smach_oracle.expert.scripted_expert import load_rules
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.settings import Settings
from smach_oracle.ros.loaded_settings import LoadedSettings, load_settings
from smach_oracle.ros.reading.yaml_files import read_yaml

# texts that YAML 1.1 reads as something else
WORDS = [
    'ON',
    'OFF',
    'YES',
    'NO',
    'on',
    'n',
    'Y',
    'true',
    'False',
    '2',
    '017',
    '1_000',
    '0x1F',
    '1.0',
    '1e3',
    '.inf',
    '1:30',
    'null',
    '~',
    'Null',
    '2026-01-01',
    '2026-01-01 10:00:00',
    '=',
]


@pytest.fixture
def read(tmp_path):
    """The settings of a file, checked."""

    def read_settings(text):
        path = tmp_path / 'oracle.yaml'
        path.write_text(text)
        loaded = load_settings(str(path))
        try:
            return Settings.from_dict(loaded)
        except SettingsError as err:
            raise loaded.located(err) from err

    return read_settings


EVERYWHERE = """
failing_outcomes: [{0}]
failure_outcomes: [{0}]
deep_copy_keys: [{0}]
tree: {{nested: [{0}]}}
checkpoint: {{map: {{{0}: {0}}}}}
oracle_label: {0}
states:
  {0}:
    failure_outcomes: [{0}]
    preconditions: [{0}, {{check: {0}, achieve: {0}}}]
expert:
  on_no_answer: {{goto: {0}}}
  interfaces:
    {0}: {{action: hand, description: {0}, states: [{0}]}}
"""


@pytest.mark.parametrize('word', WORDS)
def test_a_name_is_taken_as_it_is_written_wherever_a_name_is_expected(read, word):
    settings = read(EVERYWHERE.format(word))
    ((name, given),) = settings.states.items()
    ((offer, states),) = settings.interfaces
    single, pair = given['preconditions']
    found = [
        name,
        *given['failure_outcomes'],
        single.target,
        *pair.labels(),
        single.name,
        offer.name,
        offer.description,
        *states,
        *settings.failing_outcomes,
        *settings.defaults.failure_outcomes,
        *settings.deep_copy_keys,
        settings.on_no_answer[1],
        *settings.nested,
        *settings.resume_map,
        *settings.resume_map.values(),
        settings.oracle_label,
    ]
    assert found == [word] * len(found)
    assert {type(each) for each in found} == {str}


@pytest.mark.parametrize('word', [word for word in WORDS if word.isalpha()])
def test_the_name_of_an_action_is_taken_as_it_is_written(read, word):
    ((offer, _),) = read('expert: {{interfaces: {{hand: {{action: {}}}}}}}'.format(word)).interfaces
    assert offer.action == word and type(offer.action) is str


@pytest.mark.parametrize(
    'text, number',
    [
        ('1e3', 1000),
        ('1E+3', 1000),
        ('1.5e1', 15),
        ('1e-1', 0.1),
        ('.5e1', 5),
        ('300', 300),
        ('0x10', 16),
        ('1_000', 1000),
        ('1:30', 90),
        ('2.5', 2.5),
    ],
)
def test_a_number_is_read_where_a_number_is_expected(read, text, number):
    assert read('expert: {{deadline_s: {}}}'.format(text)).deadline_s == number


def test_a_whole_number_may_have_an_exponent(read):
    assert read('expert: {history_length: 1e3}').history_length == 1000
    with pytest.raises(SettingsError, match='history_length'):
        read('expert: {history_length: 1e-3}')


@pytest.mark.parametrize(
    'text, flag',
    [('true', True), ('ON', True), ('yes', True), ('No', False), ('off', False), ('FALSE', False)],
)
def test_true_and_false_are_read_where_they_are_expected(read, text, flag):
    settings = read(
        'tree: {{escalate: {0}, nested: {0}}}\nhealthy: {{topic: /on, equals: {0}}}'.format(text)
    )
    assert (settings.escalate, settings.nested, settings.healthy[0].equals) == (flag,) * 3


def test_nothing_is_read_where_nothing_is_expected(read):
    settings = read('budget: {recoveries: ~}\nstates: null\nhealthy:\ntime_limit_s: Null\n')
    assert settings == Settings()


@pytest.mark.parametrize('text', ['"ON"', "'2'", '!!str null'])
def test_a_quoted_word_is_no_value(read, text):
    with pytest.raises(SettingsError, match='line 1: (escalate|deadline_s)'):
        read('escalate: {}'.format(text))
    assert list(read('states: {{{}: {{}}}}'.format(text)).states) == [text.split()[-1].strip('"\'')]


def test_a_setting_that_takes_one_of_some_words_may_take_off(read):
    assert read('checkpoint_synchronous: OFF').checkpoint_synchronous == 'OFF'


@pytest.mark.parametrize(
    'text, place',
    [
        ('memory: 3\nstates:\n  ON: {memory: many}\n', r'line 3: states\.ON\.memory'),
        ('states:\n  A: &usual\n    memory: many\n  B: *usual\n', r'line 3: states\.A\.memory'),
        (
            'states:\n  2:\n    preconditions:\n    - A\n    - {check: OFF}\n',
            r'line 5: states\.2\.preconditions\[1\]',
        ),
    ],
)
def test_an_error_names_the_line_of_such_a_key(read, text, place):
    with pytest.raises(SettingsError, match=place):
        read(text)


@pytest.mark.parametrize('text', ['states:\n  ON: {}\n  "ON": {}\n', 'states:\n  1: {}\n  "1": {}'])
def test_a_key_in_quotation_marks_is_the_same_key(read, text):
    with pytest.raises(SettingsError, match='line 3: states.*given a second time .first in line 2'):
        read(text)


@pytest.mark.parametrize(
    'given, text',
    [
        ({'failing_outcomes': [True]}, 'YAML reads ON as true: write "ON"'),
        ({'oracle_label': False}, 'YAML reads OFF as false: write "OFF"'),
        ({'on_no_answer': {'goto': True}}, "{'goto': True} is not allowed. YAML reads ON as true"),
        ({'nested': ['A', 2]}, 'nested: 2 is not allowed. YAML reads 2 as a number: write "2"'),
        ({'states': {True: {}}}, 'YAML reads ON as true'),
        (
            {'states': {'A': {'preconditions': [True]}}},
            r'preconditions[0]: True is not allowed. YAML',
        ),
        ({'interfaces': {'hand': {'action': 'x', 'states': [True]}}}, 'YAML reads ON as true'),
        (
            {'resume_map': {'A': False}},
            'resume_map.A: False is not allowed. YAML reads OFF as false',
        ),
    ],
)
def test_a_name_that_came_through_the_parameter_server_is_told_how_to_be_written(given, text):
    with pytest.raises(SettingsError) as caught:
        Settings.from_dict(given)
    assert text in str(caught.value)


def test_rules_of_an_expert_take_names_as_they_are_written(tmp_path):
    path = tmp_path / 'rules.yaml'
    path.write_text(
        'ON: {kind: goto, state: OFF}\n2: {kind: supersede, outcome: NO, delay_s: 1e0, '
        'outputs: {x: yes, y: 1e3, z: ~}}\nA: {kind: goto, state: 0, confirm: yes}\n'
    )
    rules = load_rules(None, str(path))
    assert rules.next('', 't', 'TOP', 'ON').state == 'OFF'
    answer = rules.next('', 't', 'TOP', '2')
    assert (answer.outcome, answer.delay_s) == ('NO', 1.0)
    assert answer.outputs == {'x': True, 'y': 1000, 'z': None}
    assert {type(each) for each in answer.outputs.values()} == {bool, int, type(None)}
    assert rules.next('', 't', 'TOP', 'A').state == '0'


@pytest.mark.parametrize(
    'text, why',
    [
        ('A:\n- {kind: goto, state: B}\n- {kind: jump}\n', r'rules\.yaml line 3: A\[1\]\.kind'),
        ('A: {kind: ignore}\nA: {kind: ignore}\n', 'line 2: A: given a second time'),
        ('A: [\n', 'not valid YAML'),
    ],
)
def test_an_error_in_rules_names_its_line(tmp_path, text, why):
    path = tmp_path / 'rules.yaml'
    path.write_text(text)
    with pytest.raises(SettingsError, match=why):
        load_rules(None, str(path))


def test_a_parameter_that_says_the_same_overrides_nothing(tmp_path):
    path = tmp_path / 'oracle.yaml'
    path.write_text('nested: ON\nmemory: 1e1\ntime_limit_s: ~\n')
    values, lines = read_yaml(str(path))
    settings = LoadedSettings()
    settings.put(values, 'file', lines)
    assert not settings.overridden_by({'nested': True, 'memory': 10, 'time_limit_s': None})
