"""Settings: what is allowed, and errors that name the key, the value and what is allowed."""

import dataclasses
import re
from pathlib import Path

import pytest
import yaml

from smach_oracle.oracle.errors import OracleError, SettingsError
from smach_oracle.oracle.settings.interfaces import InterfaceOffer, InterfaceStart
from smach_oracle.oracle.settings.preconditions import parse_preconditions
from smach_oracle.oracle.settings.settings import Settings
from smach_oracle.oracle.settings.written import WrittenFloat, WrittenInt, plain

ROOT = Path(__file__).resolve().parents[3]


def test_nobody_changes_settings_in_place():
    settings = Settings.from_dict({})
    for each in (settings, settings.for_state('', 'ANY')):
        for field in dataclasses.fields(each):
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(each, field.name, None)


def test_preconditions_that_were_checked_before_are_taken_and_no_other_tuple():
    checked = parse_preconditions('preconditions', ['LOOK'])
    assert parse_preconditions('preconditions', checked) is checked
    with pytest.raises(SettingsError, match='a list of preconditions'):
        parse_preconditions('preconditions', ('LOOK',))


def test_the_defaults_are_those_of_the_design():
    settings = Settings.from_dict({})
    state = settings.for_state('', 'ANY')
    assert (
        state.memory,
        state.prior,
        state.moderate_from,
        state.high_from,
        state.max_recoveries,
    ) == (10, 0.1, 0.4, 0.75, 5)
    assert (settings.policy, settings.userdata, settings.on_no_answer) == (
        'prose',
        None,
        ('stop', ''),
    )
    assert settings.still_running_factor == 10
    assert settings.failing_outcomes is None, 'by the words of their names'
    assert settings.deadline_s > 0, 'never an endless wait unless asked for'
    assert Settings.from_dict(None) == settings


@pytest.mark.parametrize('action', ['hand', '/hand/', '/1robot//hand', '~hand', '~/hand', 'a/b'])
def test_an_action_may_have_each_name_that_ros_resolves(action):
    settings = Settings.from_dict({'interfaces': {'hand': {'action': action}}})
    assert settings.interfaces[0][0].action == action


def test_the_file_that_shows_the_settings_has_their_defaults():
    lines = (ROOT / 'launch/oracle.yaml').read_text(encoding='utf-8').splitlines()
    keys = '\n'.join(line[2:] for line in lines if re.match('# +([a-z_]+:|#)', line))
    shown = yaml.safe_load(keys.partition('\nstates:')[0])
    del shown['expert']['interfaces']  # an example
    assert len(shown) > 20 and Settings.from_dict(shown) == Settings.from_dict({})


@pytest.mark.parametrize(
    'given, key, value, allowed',
    [
        ({'polisy': 'prose'}, 'polisy', 'prose', 'policy'),
        (
            {'policy': 'guess'},
            'policy',
            'guess',
            'algorithm1, always_ask, any_way, escalating, ladder, learned, prose, random, restart, '
            'retry, step_back',
        ),
        ({'memory': 0}, 'memory', 0, 'whole number'),
        ({'memory': 2.5}, 'memory', 2.5, 'whole number'),
        ({'memory': True}, 'memory', True, 'whole number'),
        ({'prior': 1.1}, 'prior', 1.1, '0 to 1'),
        ({'prior': float('nan')}, 'prior', None, '0 to 1'),
        ({'moderate_from': 0.9}, 'moderate_from', 0.9, 'high_from'),
        ({'estimator': 'mean'}, 'estimator', 'mean', 'exponential, window'),
        ({'max_recoveries': -1}, 'max_recoveries', -1, 'from 0'),
        ({'on_retry': 'ask'}, 'on_retry', 'ask', 'allow, confirm, never'),
        ({'states': {'POUR': {'on_retry': True}}}, 'states.POUR.on_retry', True, 'allow, confirm'),
        ({'failing_outcomes': 'aborted'}, 'failing_outcomes', 'aborted', 'list of strings'),
        ({'failure_outcomes': ['']}, 'failure_outcomes', '', 'none of them empty'),
        ({'author_recoveries': 'drop'}, 'author_recoveries', 'drop', 'keep, override'),
        ({'userdata': 'forget'}, 'userdata', 'forget', 'restore, keep'),
        ({'time_limit_s': -1}, 'time_limit_s', -1, 'seconds'),
        ({'time_limit_s': '1'}, 'time_limit_s', '1', 'seconds'),
        ({'grace_period_s': None}, 'grace_period_s', None, 'seconds'),
        ({'deadline_s': -1}, 'deadline_s', -1, '0 waits without end'),
        ({'on_no_answer': 'panic'}, 'on_no_answer', 'panic', 'stop'),
        ({'on_no_answer': {'goto': ''}}, 'on_no_answer', {'goto': ''}, 'goto'),
        ({'escalate': 'yes'}, 'escalate', 'yes', 'true or false'),
        ({'history_length': 0}, 'history_length', 0, 'from 1'),
        ({'oracle_label': ''}, 'oracle_label', '', 'not empty'),
        ({'rates_file': 5}, 'rates_file', 5, 'string'),
        ({'rates_file': '\ud800'}, 'rates_file', '\ud800', 'the path of a file'),
        ({'checkpoint': {'file': '~\0'}}, 'checkpoint.file', '~\0', 'the path of a file'),
        ({'states': ['A']}, 'states', ['A'], 'mapping'),
        ({'states': {5: {}}}, 'states', 5, 'strings'),
        ({'states': {'PICK': {'memory': 'ten'}}}, 'states.PICK.memory', 'ten', 'whole number'),
        ({'states': {'PICK': {'memroy': 1}}}, 'states.PICK.memroy', 1, 'memory'),
        ({'states': {'PICK': {'policy': 'prose'}}}, 'states.PICK.policy', 'prose', 'prior'),
        (
            {'states': {'PICK': {'high_from': 0.2}}},
            'states.PICK.high_from',
            0.2,
            'moderate_from, which is 0.4',
        ),
        (
            {'states': {'PICK': {'moderate_from': 0.8}}},
            'states.PICK.moderate_from',
            0.8,
            'high_from, which is 0.75',
        ),
        ({'deadline_s': 10**400}, 'deadline_s', 10**400, 'seconds'),
        ({'grace_period_s': float('inf')}, 'grace_period_s', float('inf'), 'seconds'),
        ({'history_length': 10**30}, 'history_length', 10**30, 'to 1000000'),
        ({'states': {'PICK': {'preconditions': 'A'}}}, 'states.PICK.preconditions', 'A', 'list'),
        ({'interfaces': {'hand': {}}}, 'interfaces.hand.action', None, 'SharedAutonomy'),
        (
            {'interfaces': {'hand': {'action': 'bad name!'}}},
            'interfaces.hand.action',
            'bad name!',
            'the name of an action, such as /hand',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'state': []}}},
            'interfaces.hand.state',
            [],
            'states',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'states': 'A'}}},
            'interfaces.hand.states',
            'A',
            'list',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'args': []}}},
            'interfaces.hand.args',
            [],
            'launch or node',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'node': 'p t', 'launch': 'p/f.launch'}}},
            'interfaces.hand.node',
            'p t',
            'not both',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'launch': '/tmp/f.launch'}}},
            'interfaces.hand.launch',
            '/tmp/f.launch',
            'PACKAGE/FILE.launch',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'launch': 'p/../f.launch'}}},
            'interfaces.hand.launch',
            'p/../f.launch',
            'PACKAGE/FILE.launch',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'node': 'p t; rm'}}},
            'interfaces.hand.node',
            'p t; rm',
            'PACKAGE TYPE',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'node': 'p t', 'args': 'x'}}},
            'interfaces.hand.args',
            'x',
            'list',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'launch': 'p/f.launch', 'args': {'x': [1]}}}},
            'interfaces.hand.args.x',
            [1],
            'launch argument',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'launch': 'p/f.launch', 'args': {'x y': 1}}}},
            'interfaces.hand.args.x y',
            1,
            'launch argument',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'launch': '../f.launch'}}},
            'interfaces.hand.launch',
            '../f.launch',
            'PACKAGE/FILE.launch',
        ),
        (
            {'interfaces': {'hand': {'action': 'a', 'node': 'p t', 'start_limit_s': 0}}},
            'interfaces.hand.start_limit_s',
            0,
            'seconds',
        ),
        ('prose', 'settings', 'prose', 'mapping'),
    ],
)
def test_an_error_names_the_key_the_value_and_what_is_allowed(given, key, value, allowed):
    with pytest.raises(SettingsError) as raised:
        Settings.from_dict(given)
    assert raised.value.key == key
    if value is not None:
        assert raised.value.value == value
    assert allowed in raised.value.allowed
    assert key in str(raised.value) and allowed in str(raised.value)
    assert isinstance(raised.value, (OracleError, ValueError))


def test_settings_of_a_state_win_over_the_machines_and_a_path_over_a_label():
    settings = Settings.from_dict(
        {'prior': 0.2, 'memory': 5, 'states': {'PICK': {'prior': 0.3}, 'LEFT/PICK': {'memory': 7}}}
    )
    assert (settings.for_state('', 'PLACE').prior, settings.for_state('', 'PICK').prior) == (
        0.2,
        0.3,
    )
    assert settings.for_state('LEFT', 'PICK').memory == 7
    assert settings.for_state('LEFT', 'PICK').prior == 0.3
    assert settings.for_state('RIGHT', 'PICK').memory == 5


@pytest.mark.parametrize(
    'given, taken',
    [
        ('stop', ('stop', '')),
        ({'goto': 'SAFE'}, ('goto', 'SAFE')),
        ('goto:SAFE', ('goto', 'SAFE')),
        ('give_up:aborted', ('give_up', 'aborted')),
        ({'give_up': 'aborted'}, ('give_up', 'aborted')),
    ],
)
def test_fallbacks(given, taken):
    assert Settings.from_dict({'on_no_answer': given}).on_no_answer == taken


@pytest.mark.parametrize('given, limit_s', [(0, None), (None, None), (2, 2.0), (0.5, 0.5)])
def test_no_time_limit_is_said_by_0_or_nothing(given, limit_s):
    assert Settings.from_dict({'time_limit_s': given}).defaults.time_limit_s == limit_s


def test_interfaces_are_offered_for_the_states_they_name_or_for_all():
    settings = Settings.from_dict(
        {
            'interfaces': {
                'all': {'action': 'a'},
                'pick': {'action': 'b', 'description': 'd', 'states': ['PICK']},
                'left': {'action': 'c', 'states': ['LEFT/PICK']},
            }
        }
    )
    assert [offer.name for offer in settings.offers_for('', 'PLACE')] == ['all']
    assert settings.offers_for('', 'PICK')[1] == InterfaceOffer('pick', 'b', 'd')
    assert [offer.name for offer in settings.offers_for('LEFT', 'PICK')] == ['all', 'pick', 'left']


def test_an_interface_may_say_how_it_is_started():
    settings = Settings.from_dict(
        {
            'interfaces': {
                'hand': {
                    'action': 'a',
                    'launch': 'my_robot/hand.launch',
                    'args': {'camera': 'head', 'clearance': False},
                },
                'eye': {
                    'action': 'b',
                    'node': 'my_robot eye.py',
                    'args': ['_rate:=5'],
                    'start_limit_s': 5,
                },
            }
        }
    )
    assert [offer.start for offer in settings.offers_for('', 'PICK')] == [
        InterfaceStart('launch', 'my_robot', 'hand.launch', ('camera:=head', 'clearance:=false')),
        InterfaceStart('node', 'my_robot', 'eye.py', ('_rate:=5',), 5.0),
    ]


def test_empty_sections_of_a_file_are_empty():
    settings = Settings.from_dict({'states': None, 'interfaces': None})
    assert settings == Settings.from_dict({})


def test_a_key_that_is_not_known_is_answered_with_all_that_are():
    with pytest.raises(SettingsError) as raised:
        Settings.from_dict({'polcy': 'prose'})
    assert set(str(raised.value).split('one of the keys ')[1].split(', ')) == {
        'policy',
        'memory',
        'prior',
        'moderate_from',
        'high_from',
        'estimator',
        'max_recoveries',
        'failing_outcomes',
        'failure_outcomes',
        'intended_outcomes',
        'author_recoveries',
        'userdata',
        'cost',
        'deep_copy_keys',
        'time_limit_s',
        'grace_period_s',
        'on_retry',
        'autonomy',
        'budget',
        'rates_file',
        'oracle_label',
        'states',
        'healthy',
        'checkpoint',
        'after_preempt_s',
        'expert',
        'still_running',
        'tree',
    }


def test_a_map_of_states_may_be_nested_as_the_parameter_server_has_it():
    settings = Settings.from_dict({'resume_map': {'LOOK': 'SEE', 'KITCHEN': {'A': {'B': 'C/D'}}}})
    assert settings.resume_map == {'LOOK': 'SEE', 'KITCHEN/A/B': 'C/D'}


@pytest.mark.parametrize(
    'given, named',
    [
        ('LOOK=SEE', "resume_map: 'LOOK=SEE'"),
        ({'LOOK': 3}, 'resume_map.LOOK: 3'),
        ({'K': {'LOOK': ''}}, "resume_map.K/LOOK: ''"),
        ({7: 'A'}, 'resume_map: 7'),
        ({'A//B': 'A'}, "resume_map: 'A//B'"),
    ],
)
def test_a_wrong_map_of_states_is_named(given, named):
    with pytest.raises(SettingsError) as caught:
        Settings.from_dict({'resume_map': given})
    assert named in str(caught.value) and 'KITCHEN/LOOK: SEARCH' in str(caught.value)


def test_the_number_of_a_stored_moment_has_a_place_in_the_store():
    most = 1 << 62
    assert Settings.from_dict({'resume_from': most}).resume_from == most
    with pytest.raises(SettingsError, match='resume_from'):
        Settings.from_dict({'resume_from': most + 1})


def test_an_error_says_what_is_wrong_also_with_its_file_and_with_more_that_is_allowed():
    error = SettingsError('name', 'x' * 9, 'a word', problem='is too long')
    at = str(error.set_at('oracle.yaml, line 3'))
    assert at == "oracle.yaml, line 3: name: 'xxxxxxxxx' is too long; allowed: a word"
    assert str(error.allowing(' or two')).endswith('is too long; allowed: a word or two')


@pytest.mark.parametrize('word', ['later', 'state:', 'ask:A', 3, None])
def test_how_a_trial_goes_on_is_one_of_four_words(word):
    with pytest.raises(SettingsError, match='on_resume: .* is not allowed; allowed: '):
        Settings.from_dict({'on_resume': word})


def test_preconditions_belong_to_a_state():
    with pytest.raises(SettingsError, match='it belongs to a state: below states: LABEL:'):
        Settings.from_dict({'preconditions': ['LOOK']})


def test_data_of_a_file_become_plain_numbers():
    whole, part = WrittenInt(16), WrittenFloat(0.5)
    whole.text, part.text = '0x10', '.5'
    read = plain({'a': [whole], 'b': part})
    assert read == {'a': [16], 'b': 0.5}
    assert [type(read['a'][0]), type(read['b'])] == [int, float]


@pytest.mark.parametrize(
    'text, told',
    [
        ('', "robot.yaml: rates.memory: 'x' is no number; allowed: a number, or none"),
        ('all is wrong', 'robot.yaml: all is wrong'),
    ],
)
def test_an_error_says_the_same_under_another_key_and_of_a_file(text, told):
    error = SettingsError('memory', 'x', 'a number', text, 'is no number')
    error = error.called('rates.memory').set_at('robot.yaml').allowing(', or none')
    assert (str(error), error.key) == (told, 'robot.yaml: rates.memory')
    assert (error.value, error.allowed) == ('x', 'a number, or none')
