"""Settings of the console, from the node's private parameters."""
import os
import socket
from typing import Any, Callable, List, NamedTuple, Optional, Tuple

from ...oracle.errors import ConfigError
from ...oracle.paths import path_of
from .access import Hosts, TokenBook, is_loopback, load_tokens

NONE = 'none'
DEFAULT_PORT = 8090


class ConsoleSettings(NamedTuple):
    """What the console was started with."""

    address: str
    port: int  # 0: any free one
    tokens: Optional[TokenBook]  # None: whoever can reach this machine's loopback is an operator
    hosts: Hosts
    certificate: str  # '' without TLS
    private_key: str
    bags: Tuple[str, ...] = ()  # folders

    @property
    def scheme(self) -> str:
        """http or https."""
        return 'https' if self.certificate else 'http'


def read_settings(get: Callable[[str, Any], Any]) -> ConsoleSettings:
    """Read and check them all.

    :param get: gives a parameter by its name, or the default.
    :raises ConfigError: naming the parameter, its value and what is allowed.
    """
    address = _text(get, 'address', '127.0.0.1')
    token_file = _path(get, 'token_file')
    remote = not is_loopback(address)
    if remote and get('allow_remote', False) is not True:
        raise ConfigError('~address', address, 'a loopback address, unless ~allow_remote is true')
    if remote and not token_file:
        raise ConfigError('~token_file', NONE, 'a file of tokens where others can reach the console; one that is not '
                                               'there yet is made')
    certificate, key = _path(get, 'certificate'), _path(get, 'private_key')
    if bool(certificate) != bool(key):
        raise ConfigError('~certificate', certificate or NONE, 'together with ~private_key')
    return ConsoleSettings(address, _port(get('port', DEFAULT_PORT)), load_tokens(token_file) if token_file else None,
                           Hosts(_hosts(get, remote), addresses=remote), certificate, key, _folders(get('bags', [])))


def _hosts(get: Callable[[str, Any], Any], remote: bool) -> List[str]:
    value = get('hosts', [])
    names = value.split() if isinstance(value, str) else value
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ConfigError('~hosts', value, 'names separated by spaces, or a list of names')
    names = [name for name in names if name != NONE]
    own = socket.gethostname()
    return names + ([own, own.split('.')[0], own.split('.')[0] + '.local'] if remote else [])


def _folders(value: Any) -> Tuple[str, ...]:
    folders = value.split(os.pathsep) if isinstance(value, str) else value
    if not isinstance(folders, list) or not all(isinstance(folder, str) for folder in folders):
        raise ConfigError('~bags', value, 'folders separated by {}, or a list of folders'.format(os.pathsep))
    return tuple(os.path.abspath(path_of(folder)) for folder in folders if folder not in ('', NONE))


def _port(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 65536:
        raise ConfigError('~port', value, '0 (any free one) to 65535')
    return value


def _path(get: Callable[[str, Any], Any], name: str) -> str:
    value = _text(get, name, NONE)
    return '' if value in ('', NONE) else path_of(value)


def _text(get: Callable[[str, Any], Any], name: str, default: str) -> str:
    value = get(name, default)
    if not isinstance(value, str):
        raise ConfigError('~' + name, value, 'a string')
    return value
