"""The settings `healthy` and `health_settle_s`."""

import math

import pytest

import smach
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.health import HealthCondition, HealthKind
from smach_oracle.oracle.settings.settings import Settings


def is_well():
    return True


class CalledState(smach.State):
    """A state that is a function, too."""

    def __call__(self):
        """Say that all is well."""
        return True


def healthy(given, resolver=None):
    return Settings.from_dict({'healthy': given}, resolver).healthy


@pytest.mark.parametrize(
    'given, made',
    [
        (
            {'topic': '/motors_on'},
            HealthCondition(HealthKind.TOPIC, 'motors_on', '/motors_on', equals=True),
        ),
        (
            {
                'topic': 'battery',
                'field': 'cells.0.voltage',
                'at_least': 3,
                'at_most': 4.2,
                'max_age_s': 5,
                'name': 'cell',
            },
            HealthCondition(
                HealthKind.TOPIC,
                'cell',
                'battery',
                'cells.0.voltage',
                at_least=3.0,
                at_most=4.2,
                max_age_s=5.0,
            ),
        ),
        (
            {'topic': '/gear', 'at_least': 2, 'at_most': 2},
            HealthCondition(HealthKind.TOPIC, 'gear', '/gear', at_least=2.0, at_most=2.0),
        ),
        (
            {'topic': '/mode', 'equals': 'run'},
            HealthCondition(HealthKind.TOPIC, 'mode', '/mode', equals='run'),
        ),
        (
            {'diagnostics': '/Power System'},
            HealthCondition(HealthKind.DIAGNOSTICS, 'Power System', '/Power System'),
        ),
        ({'diagnostics': '/'}, HealthCondition(HealthKind.DIAGNOSTICS, '/', '/')),
        (
            {'diagnostics': 'Power', 'worst': 'ok', 'max_age_s': 2, 'name': 'power'},
            HealthCondition(HealthKind.DIAGNOSTICS, 'power', 'Power', worst='ok', max_age_s=2.0),
        ),
        ({'function': is_well}, HealthCondition(HealthKind.FUNCTION, 'is_well', function=is_well)),
        (
            {'function': is_well, 'name': 'robot'},
            HealthCondition(HealthKind.FUNCTION, 'robot', function=is_well),
        ),
    ],
)
def test_one_condition_may_stand_alone_or_in_a_list(given, made):
    assert healthy(given) == (made,)
    assert healthy([given, given]) == (made, made)


def test_nothing_need_hold_by_default():
    assert Settings().healthy == healthy(None) == healthy([]) == ()
    assert Settings().health_settle_s == 0.5


def test_a_function_of_a_module_is_found_by_its_name():
    names = []

    def resolver(name):
        names.append(name)
        return is_well

    (made,) = healthy({'function': 'python:my_robot.health:power.ok'}, resolver)
    assert names == ['python:my_robot.health:power.ok']
    assert (made.name, made.function) == ('power.ok', is_well)


@pytest.mark.parametrize(
    'given, key, allowed',
    [
        ('/motors_on', 'healthy', 'a list of conditions, or one'),
        (['/motors_on'], 'healthy[0]', 'a mapping with one of the keys'),
        ({'field': 'data'}, 'healthy.field', 'topic, diagnostics, function'),
        ([{'topic': '/a', 'function': is_well}], 'healthy[0]', 'one of the keys'),
        ({'topic': ''}, 'healthy.topic', 'a string that is not empty'),
        ({'topic': 'motors on'}, 'healthy.topic', 'the name of a topic'),
        ({'topic': '/a//b'}, 'healthy.topic', 'the name of a topic'),
        ({'topic': '/a/'}, 'healthy.topic', 'the name of a topic'),
        ({'topic': '1st'}, 'healthy.topic', 'the name of a topic'),
        ({'topic': '/a', 'feild': 'x'}, 'healthy.feild', 'topic, field, equals, at_least'),
        ({'topic': '/a', 'field': 'a..b'}, 'healthy.field', 'a field of the message'),
        ({'topic': '/a', 'field': 3}, 'healthy.field', 'a field of the message'),
        ({'topic': '/a', 'equals': [1]}, 'healthy.equals', 'true, false, a number or a text'),
        ({'topic': '/a', 'equals': math.nan}, 'healthy.equals', 'true, false, a number or a text'),
        ({'topic': '/a', 'equals': 1, 'at_least': 1}, 'healthy.equals', 'not both'),
        ([{'topic': '/a'}, {'topic': '/a', 'at_least': 'x'}], 'healthy[1].at_least', 'a number'),
        ({'topic': '/a', 'at_least': 2, 'at_most': 1}, 'healthy.at_least', 'at_most, which is 1'),
        ({'topic': '/a', 'max_age_s': 0}, 'healthy.max_age_s', 'seconds from 0.001'),
        ({'diagnostics': 7}, 'healthy.diagnostics', 'a string that is not empty'),
        ({'diagnostics': 'a', 'worst': 'error'}, 'healthy.worst', 'ok, warn'),
        (
            {'diagnostics': 'a', 'field': 'x'},
            'healthy.field',
            'diagnostics, worst, name, max_age_s',
        ),
        ({'function': 'my_robot.health'}, 'healthy.function', 'python:module:attribute'),
        ({'function': 'python:a:b'}, 'healthy.function', 'names cannot be imported here'),
        ({'function': 7}, 'healthy.function', 'a function without arguments'),
        ({'function': dict}, 'healthy.function', 'a function without arguments'),
        ({'function': CalledState()}, 'healthy.function', 'a function without arguments'),
        ({'function': is_well, 'max_age_s': 1}, 'healthy.max_age_s', 'function, name'),
        ({'function': is_well, 'name': ''}, 'healthy.name', 'a string that is not empty'),
    ],
)
def test_a_mistake_names_its_key_and_what_is_allowed(given, key, allowed):
    with pytest.raises(SettingsError) as told:
        healthy(given)
    assert told.value.key == key
    assert allowed in told.value.allowed


def test_a_name_that_cannot_be_imported_is_a_mistake():
    def resolver(name):
        raise ImportError('no module')

    with pytest.raises(SettingsError, match='no module'):
        healthy({'function': 'python:a:b'}, resolver)


@pytest.mark.parametrize('given', [-1, 'soon', True, 61])
def test_the_settle_time_is_a_number_of_seconds(given):
    with pytest.raises(SettingsError, match='health_settle_s.* seconds from 0 to 60'):
        Settings.from_dict({'health_settle_s': given})


@pytest.mark.parametrize('topic', ['/a', 'a', '~a', '~/a', '/a_1/2/b', 'ns/a'])
def test_every_legal_name_of_a_topic_is_taken(topic):
    assert Settings.from_dict({'healthy': {'topic': topic}}).healthy[0].source == topic
