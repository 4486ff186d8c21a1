"""Settings of the console, from the node's private parameters."""

import os
import socket
from types import MappingProxyType
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks
from smach_oracle.oracle.settings.paths import path_of

from .access import AccessTokens, AllowedHosts, is_loopback, load_tokens
from .proxies import PublicAddress, TrustedProxies
from .shifts import DEFAULT_SHIFTS, Shifts

# a parameter by its name, or the default
GetParameter = Callable[[str, object], object]
NONE = 'none'
DEFAULT_PORT = 8090
DEFAULT_IDLE_S = 45.0
_idle_s = checks.number(0.0, 86400.0, '0 (never) to 86400 s')
_port = checks.whole(0, '0 (any free one) to 65535', 65535)


class ConsoleSettings(NamedTuple):
    """The settings with which the console was started."""

    address: str
    port: int  # 0: any free one
    tokens: Optional[AccessTokens]  # None: everybody on this machine's loopback is a teleoperator
    hosts: AllowedHosts
    certificate: str  # '' without TLS
    private_key: str
    bags: Tuple[str, ...] = ()  # folders
    stores: Tuple[str, ...] = ()  # files in which programs keep where their machines stand
    # by robot: topics, or names above them
    cameras: Mapping[str, Tuple[str, ...]] = MappingProxyType({})
    idle_s: float = DEFAULT_IDLE_S  # without a press of the holder. 0: nobody is idle
    public: Optional[PublicAddress] = None  # by which people reach it
    proxies: TrustedProxies = TrustedProxies()
    on_call: str = ''  # file that says who is reached, '' where nobody is
    shift_file: str = ''  # file that keeps notes and times, '' where nothing does
    shifts: Shifts = Shifts()

    @property
    def scheme(self) -> str:
        """Return http or https."""
        return 'https' if self.certificate else 'http'


def read_settings(get: GetParameter) -> ConsoleSettings:
    """Read and check them all.

    :param get: gives a parameter by its name, or the default.
    :raises SettingsError: naming the parameter, its value and what is allowed.
    """
    address = _text(get, 'address', '127.0.0.1')
    token_file = _path(get, 'token_file')
    remote = not is_loopback(address)
    if remote and get('allow_remote', False) is not True:
        raise SettingsError('~address', address, 'a loopback address, unless ~allow_remote is true')
    if remote and not token_file:
        raise SettingsError(
            '~token_file',
            NONE,
            'a file of tokens where others can reach the console; one that is not '
            'there yet is made',
        )
    certificate, key = _path(get, 'certificate'), _path(get, 'private_key')
    if bool(certificate) != bool(key):
        raise SettingsError('~certificate', certificate or NONE, 'together with ~private_key')
    public, proxies = _public(get), TrustedProxies(_names(get, '~trusted_proxy', 'IP addresses'))
    if proxies and public is None:
        raise SettingsError(
            '~public_address', NONE, 'the address by which browsers reach ~trusted_proxy'
        )
    if proxies and not token_file:
        raise SettingsError(
            '~token_file', NONE, 'a file of tokens where a proxy lets others reach the console'
        )
    on_call = _path(get, 'on_call')
    if on_call and public is None:
        raise SettingsError(
            '~public_address', NONE, 'the address of this page, for the links that ~on_call sends'
        )
    own = [public.host.strip('[]')] if public else []
    return ConsoleSettings(
        address,
        _port('~port', get('port', DEFAULT_PORT)),
        load_tokens(token_file) if token_file else None,
        AllowedHosts(own + _hosts(get, remote), addresses=remote),
        certificate,
        key,
        _paths('~bags', get('bags', []), 'folders'),
        _paths('~stores', get('stores', []), 'files'),
        _cameras(get('cameras', {})),
        _idle_s('~idle_s', get('idle_s', DEFAULT_IDLE_S)),
        public,
        proxies,
        on_call,
        _path(get, 'shift_file'),
        Shifts(_text(get, 'shifts', DEFAULT_SHIFTS)),
    )


def _public(get: GetParameter) -> Optional[PublicAddress]:
    text = _text(get, 'public_address', NONE)
    return None if text in ('', NONE) else PublicAddress.parse('~public_address', text)


def _hosts(get: GetParameter, remote: bool) -> List[str]:
    names = _names(get, '~hosts', 'names')
    own = socket.gethostname()
    return names + ([own, own.split('.')[0], own.split('.')[0] + '.local'] if remote else [])


def _names(get: GetParameter, name: str, what: str) -> List[str]:
    value = get(name[len('~') :], [])
    names = value.split() if isinstance(value, str) else value
    if not isinstance(names, list) or not all(isinstance(each, str) for each in names):
        raise SettingsError(
            name, value, '{} separated by spaces, or a list of {}'.format(what, what)
        )
    return [each for each in names if each != NONE]


def _paths(name: str, value: object, what: str) -> Tuple[str, ...]:
    paths = value.split(os.pathsep) if isinstance(value, str) else value
    if not isinstance(paths, list) or not all(isinstance(path, str) for path in paths):
        raise SettingsError(
            name, value, '{} separated by {}, or a list of {}'.format(what, os.pathsep, what)
        )
    return tuple(os.path.abspath(path_of(path)) for path in paths if path not in ('', NONE))


def _cameras(value: object) -> Dict[str, Tuple[str, ...]]:
    allowed = 'a dictionary of robots, each with a list of topics of its cameras'
    if value in (None, '', NONE):
        return {}
    if not isinstance(value, dict):
        raise SettingsError('~cameras', value, allowed)
    found = {}
    for robot, topics in value.items():
        names = topics.split() if isinstance(topics, str) else topics
        if (
            not isinstance(robot, str)
            or not isinstance(names, list)
            or not all(isinstance(name, str) and name.startswith('/') for name in names)
        ):
            raise SettingsError('~cameras', value, allowed + ', with their whole names')
        found['/' + robot.strip('/')] = tuple(names)
    return found


def _path(get: GetParameter, name: str) -> str:
    value = _text(get, name, NONE)
    return '' if value in ('', NONE) else path_of(value)


def _text(get: GetParameter, name: str, default: str) -> str:
    return checks.text('~' + name, get(name, default))
