"""Parameters of expert_query_server: what cannot be is refused by name, before anybody asks."""

import math

import pytest
import rospy
from roslaunch.config import load_config_default
from roslaunch.substitution_args import resolve_args

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.ros.expert.open_questions import LEASE_S
from smach_oracle.ros.expert.server import ASKER_GONE_S, SERVER_NAME, settings_from_parameters


@pytest.fixture(name='read')
def make_read(monkeypatch):
    def read(**given):
        monkeypatch.setattr(
            rospy, 'get_param', lambda key, default=None: given.get(key.lstrip('~'), default)
        )
        monkeypatch.setattr(rospy, 'resolve_name', lambda name: '/node/' + name.lstrip('~'))
        return settings_from_parameters()

    return read


@pytest.mark.parametrize(
    'given',
    [
        {'lease_s': 'x'},
        {'lease_s': -1},
        {'lease_s': math.nan},
        {'lease_s': 0},
        {'lease_s': math.inf},
        {'lease_s': True},
        {'asker_gone_s': 'x'},
        {'asker_gone_s': -3.0},
        {'asker_gone_s': math.nan},
        {'asker_gone_s': 0.0},
        {'server_name': ''},
        {'server_name': 7},
        {'server_name': 'two words'},
    ],
)
def test_what_cannot_be_is_refused_by_name(read, given):
    with pytest.raises(SettingsError, match='/node/{}: '.format(next(iter(given)))):
        read(**given)


def test_what_is_given_is_taken(read):
    assert read() == (SERVER_NAME, LEASE_S, ASKER_GONE_S)
    assert read(server_name='/desk/experts', lease_s=30, asker_gone_s=0.5) == (
        '/desk/experts',
        30.0,
        0.5,
    )


def test_what_is_launched_is_the_default_of_the_node_unless_told_otherwise():
    def launched(*arguments):
        path = resolve_args('$(find smach_oracle)/launch/expert_query_server.launch')
        params = load_config_default([(path, list(arguments))], 11311, verbose=False).params
        return [
            params['/expert_query_server/' + name].value
            for name in ('server_name', 'lease_s', 'asker_gone_s')
        ]

    assert launched() == [SERVER_NAME, LEASE_S, ASKER_GONE_S]
    assert launched('server_name:=/desk')[0] == '/desk'
