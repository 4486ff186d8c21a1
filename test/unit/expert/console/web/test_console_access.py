"""Roles, tokens, hosts, origins and limits of the console, each tried as an attacker would."""

import os
import socket
import stat

import pytest

from smach_oracle.expert.console import server
from smach_oracle.expert.console.web.access import (
    AccessTokens,
    AllowedHosts,
    ClientRateLimits,
    Identity,
    RateLimit,
    is_loopback,
    load_tokens,
    may,
)
from smach_oracle.expert.console.web.settings import read_settings
from smach_oracle.oracle.errors import SettingsError

TOKEN = 'abcdefghijklmnopqrstuvwxyz'


@pytest.mark.parametrize(
    'host',
    ['localhost', 'localhost:8090', 'LOCALHOST:1', '127.0.0.1:8090', '[::1]:8090', '127.0.0.5'],
)
def test_this_machine_is_called_by_its_loopback_names(host):
    assert AllowedHosts([], addresses=False).allows(host)


@pytest.mark.parametrize(
    'host',
    [
        '',
        'evil.example',
        'localhost.evil.example',
        'localhost@evil.example',
        '10.0.0.1:8090',
        '127.0.0.1.evil.example',
        'evil.example:8090',
        'localhost/evil',
        'a b',
        '[::1',
        'localhost:port',
        '127.0.0.1#evil',
        '0x7f.1',
    ],
)
def test_any_other_name_is_refused_so_that_dns_cannot_be_rebound(host):
    assert not AllowedHosts([], addresses=False).allows(host)


def test_names_and_addresses_can_be_admitted():
    hosts = AllowedHosts(['Robot.lan'], addresses=True)
    assert (
        hosts.allows('robot.lan:8090')
        and hosts.allows('10.0.0.1:8090')
        and not hosts.allows('evil.example')
    )


@pytest.mark.parametrize(
    'origin, allowed',
    [
        ('http://localhost:8090', True),
        ('HTTP://LOCALHOST:8090', True),
        ('http://localhost:8091', False),
        ('https://localhost:8090', False),
        ('http://evil.example', False),
        ('null', False),
        ('', False),
        ('http://localhost:8090.evil.example', False),
        ('http://evil.example/http://localhost:8090', False),
    ],
)
def test_a_request_must_come_from_the_console_s_own_page(origin, allowed):
    assert (
        AllowedHosts([], addresses=False).allows_origin(origin, 'localhost:8090', 'http') is allowed
    )


def test_a_page_and_a_host_that_agree_with_each_other_are_not_enough():
    assert not AllowedHosts([], addresses=False).allows_origin(
        'http://evil.example', 'evil.example', 'http'
    )


def test_a_token_says_the_role_and_perhaps_the_name():
    tokens = AccessTokens(
        '# tokens\nviewer {0}1\n\noperator {0}2 Ann Lee  # at the desk\n'.format(TOKEN), 'file'
    )
    assert tokens.identify(TOKEN + '1') == Identity('viewer', '')
    assert tokens.identify(TOKEN + '2') == Identity('operator', 'Ann Lee')
    assert (
        tokens.identify(TOKEN) is None
        and tokens.identify('') is None
        and tokens.identify('\ud800') is None
    )


@pytest.mark.parametrize(
    'text, problem',
    [
        ('', 'no token'),
        ('# none\n', 'no token'),
        ('root {}'.format(TOKEN), 'line 1'),
        ('viewer short', '20 or more'),
        ('viewer', '20 or more'),
    ],
)
def test_a_bad_token_file_is_refused_by_line(text, problem):
    with pytest.raises(SettingsError, match=problem):
        AccessTokens(text, 'file')


def test_no_token_is_told_by_an_error():
    with pytest.raises(SettingsError) as error:
        AccessTokens('viewer secretbutshort', 'file')
    assert 'secretbutshort' not in str(error.value)


def test_other_tokens_end_all_sessions_and_a_restart_ends_none():
    one, two = ('operator {}{}'.format(TOKEN, number) for number in (1, 2))
    assert (
        AccessTokens(one, 'f').cookie_secret
        == AccessTokens(one, 'f').cookie_secret
        != AccessTokens(two, 'f').cookie_secret
    )


def test_a_token_file_that_is_not_there_is_made_for_its_owner_alone(tmp_path):
    path = tmp_path / 'new' / 'tokens'
    tokens = load_tokens(str(path))
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    role, token = path.read_text().splitlines()[2].split()
    assert (role, tokens.identify(token)) == ('operator', Identity('operator'))
    assert load_tokens(str(path)).cookie_secret == tokens.cookie_secret


def test_a_token_file_that_others_may_read_is_refused(tmp_path):
    path = tmp_path / 'tokens'
    path.write_text('operator ' + TOKEN)
    os.chmod(str(path), 0o644)
    with pytest.raises(SettingsError, match='chmod 600'):
        load_tokens(str(path))


def test_each_role_may_do_what_those_before_it_may():
    assert [
        [may(role, needed) for needed in ('viewer', 'operator', 'teleoperator')]
        for role in ('viewer', 'operator', 'teleoperator', '', 'root')
    ] == [[True, False, False], [True, True, False], [True, True, True], [False] * 3, [False] * 3]


def test_a_bucket_lets_a_burst_pass_and_then_its_rate():
    now = [0.0]
    bucket = RateLimit(2.0, 3.0, lambda: now[0])
    assert [bucket.take() for _ in range(4)] == [True, True, True, False]
    now[0] = 0.5
    assert [bucket.take() for _ in range(2)] == [True, False]
    now[0] = 1000.0
    assert sum(bucket.take() for _ in range(10)) == 3


def test_one_client_cannot_use_up_another_s_share_and_many_together_are_held_too():
    buckets = ClientRateLimits(0.0, 5.0, 2.0, lambda: 0.0)
    assert sum(buckets.take('a') for _ in range(50)) == 5
    assert sum(buckets.take(str(number)) for number in range(3000)) == 5


def settings(**parameters):
    return read_settings(lambda name, default: parameters.get(name, default))


def test_it_listens_on_loopback_and_needs_no_token_there():
    found = settings()
    assert (found.address, found.tokens, found.scheme, found.port) == (
        '127.0.0.1',
        None,
        'http',
        8090,
    )
    assert not found.hosts.allows('192.168.0.1')


@pytest.mark.parametrize('address', ['0.0.0.0', '::', '192.168.0.1', 'robot.lan', ''])
def test_any_other_address_needs_the_flag_and_a_token_file(address, tmp_path):
    with pytest.raises(SettingsError, match='allow_remote'):
        settings(address=address, token_file=str(tmp_path / 'tokens'))
    with pytest.raises(SettingsError, match='token_file'):
        settings(address=address, allow_remote=True)
    found = settings(
        address=address, allow_remote=True, token_file=str(tmp_path / 'tokens'), hosts='robot.lan'
    )
    assert found.tokens is not None and found.hosts.allows('robot.lan')


@pytest.mark.parametrize(
    'parameters, problem',
    [
        ({'port': 65536}, '~port'),
        ({'port': True}, '~port'),
        ({'port': '8090'}, '~port'),
        ({'address': 1}, '~address'),
        ({'certificate': '/c.pem'}, '~certificate'),
        ({'hosts': 3}, '~hosts'),
        ({'allow_remote': 1, 'address': '::'}, 'allow'),
    ],
)
def test_a_wrong_parameter_is_named(parameters, problem):
    with pytest.raises(SettingsError, match=problem):
        settings(**parameters)


def test_loopback_is_told_by_address_not_by_looks():
    assert is_loopback('127.0.0.1') and is_loopback('::1') and is_loopback('localhost')
    assert not is_loopback('0.0.0.0') and not is_loopback('127.0.0.1.evil.example')


def test_a_port_that_is_taken_is_named():
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen(1)
        with pytest.raises(SettingsError, match='port that is free'):
            server.Console(settings(port=taken.getsockname()[1]))
