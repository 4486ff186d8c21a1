"""Rules of access: roles, tokens, hosts and origins that are answered, limits on rates. Pure."""

import hashlib
import hmac
import ipaddress
import os
import secrets
import stat
import time
from collections import OrderedDict
from pathlib import Path
from typing import Callable, Iterable, List, NamedTuple, Optional
from urllib.parse import urlsplit

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.paths import path_of

ROLES = ('viewer', 'operator', 'teleoperator')  # each may do what those before it may
SHORTEST_TOKEN = 20  # characters
MOST_KEYS = 1000
RESERVE = 0.1  # of a client's share


class Identity(NamedTuple):
    """Role and name of the person at a browser."""

    role: str
    name: str = ''  # '' where the person may choose


class _AccessToken(NamedTuple):
    digest: bytes
    identity: Identity


class AccessTokens:
    """The tokens of a file, kept as digests only.

    One a line, `ROLE TOKEN [NAME]`. `#` begins a comment.
    """

    def __init__(self, text: str, where: str) -> None:
        """:raises SettingsError: naming file and line of what is no such entry."""
        self._entries: List[_AccessToken] = []
        key = hashlib.sha256(b'smach_oracle console cookie')
        for number, line in enumerate(text.splitlines(), 1):
            words = line.split('#')[0].split(None, 2)
            if words:
                self._entries.append(_entry(words, '{} line {}'.format(where, number)))
                key.update(self._entries[-1].digest)
        if not self._entries:
            raise SettingsError(where, 'no token', 'at least one line: ROLE TOKEN [NAME]')
        # another set of tokens ends all sessions. A restart ends none
        self.cookie_secret = key.hexdigest()

    def identify(self, token: str) -> Optional[Identity]:
        """Return whose token this is. It takes the same time for every wrong one."""
        digest = _digest(token)
        found = None
        for entry in self._entries:
            if hmac.compare_digest(entry.digest, digest):
                found = entry.identity
        return found


def load_tokens(path: str) -> AccessTokens:
    """Return the tokens of a file, which is made where it is missing.

    A new file has one fresh token a role, readable by its owner alone.

    :raises SettingsError: where others may read it, it cannot be read or made, or holds something
        else.
    """
    file = Path(path_of(path))
    try:
        if not file.exists():
            _write_tokens(file)
        mode = file.stat().st_mode
        text = file.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as err:
        raise SettingsError(
            '~token_file', path, 'a file that can be read or made ({})'.format(err)
        ) from err
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise SettingsError(
            '~token_file', path, 'a file that its owner alone may read: chmod 600 {}'.format(path)
        )
    return AccessTokens(text, str(file))


class AllowedHosts:
    """The names by which this console may be called.

    A page elsewhere whose name is made to lead here (DNS rebinding) sends its own name, and is
    refused.
    """

    def __init__(self, names: Iterable[str], addresses: bool) -> None:
        """`addresses`: IP addresses are allowed, too. They need no name to be resolved."""
        self._names = {name.lower().rstrip('.') for name in names} | {'localhost'}
        self._addresses = addresses

    def allows(self, host: str) -> bool:
        """Whether a Host header, with or without a port, names this console."""
        try:
            parts = urlsplit('//' + host)
            name = parts.hostname or ''
            # the port raises where it is no number
            if parts.netloc != host or '@' in host or (parts.port or 1) < 1:
                return False
        except ValueError:
            return False
        if name.rstrip('.') in self._names:
            return True
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            return False
        return address.is_loopback or self._addresses

    def allows_origin(self, origin: str, host: str, scheme: str) -> bool:
        """Whether a request came from a page of this very console."""
        return self.allows(host) and origin.lower() == '{}://{}'.format(scheme, host).lower()


class RateLimit:
    """Lets `burst` events pass at once, and `rate` a second in the long run."""

    def __init__(
        self, rate: float, burst: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._rate = rate
        self._burst = burst
        self._clock = clock
        self._level = burst
        self._seen_s = clock()

    def take(self) -> bool:
        """Whether one more may pass now."""
        now_s = self._clock()
        self._level = min(self._burst, self._level + (now_s - self._seen_s) * self._rate)
        self._seen_s = now_s
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True


class _ClientRateLimit(NamedTuple):
    """The limits of one client."""

    all: RateLimit
    reserve: RateLimit  # the part of it that others cannot use up


class ClientRateLimits:
    """One limit a client, for as many clients as are remembered, and one for all strangers.

    A client that asks for little has it, however much others ask for: a tenth of its share is its
    own, and does not count for that of all.
    """

    def __init__(
        self, rate: float, burst: float, for_all: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`for_all`: how many times one client's share all strangers together may have."""
        self._make = lambda factor: RateLimit(rate * factor, burst * factor, clock)
        self._all = self._make(for_all)
        self._by_key: 'OrderedDict[str, _ClientRateLimit]' = OrderedDict()

    def take(self, key: str, known: bool = False) -> bool:
        """Whether one more of this client may pass now.

        :param known: it has come with a token: the limit for all together is for strangers.
        """
        if key not in self._by_key:
            self._by_key[key] = _ClientRateLimit(self._make(1.0), self._make(RESERVE))
            if len(self._by_key) > MOST_KEYS:
                self._by_key.popitem(last=False)
        self._by_key.move_to_end(key)
        own = self._by_key[key]
        return own.all.take() and (known or own.reserve.take() or self._all.take())


class SocketRateLimits(NamedTuple):
    """The limits of one socket."""

    commands: RateLimit
    driving: RateLimit  # commands of a page that drives
    unruly: RateLimit  # how often the others may be exceeded before the socket is closed


def network_of(address: str) -> str:
    """Return the network for whose limits an address counts.

    With IPv6 it is a whole /64, all of which one machine has.
    """
    try:
        given = ipaddress.ip_address(address.split('%')[0])
    except ValueError:
        return address
    if given.version == 4:
        return str(given)
    mapped = given.ipv4_mapped
    return str(mapped or ipaddress.ip_network((int(given) >> 64 << 64, 64)))


def may(role: str, needed: str) -> bool:
    """Whether a role includes another."""
    return role in ROLES and ROLES.index(role) >= ROLES.index(needed)


def is_loopback(address: str) -> bool:
    """Whether nobody but this machine can reach an address to listen on."""
    if address == 'localhost':
        return True
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False


def _entry(words: List[str], where: str) -> _AccessToken:
    if words[0] not in ROLES:
        raise SettingsError(where, words[0], ', '.join(ROLES) + ' in front of the token')
    if len(words) < 2 or len(words[1]) < SHORTEST_TOKEN:
        raise SettingsError(
            where,
            'a token of {} characters'.format(len(words[1]) if len(words) > 1 else 0),
            '{} or more'.format(SHORTEST_TOKEN),
        )
    return _AccessToken(
        _digest(words[1]), Identity(words[0], words[2].strip() if len(words) > 2 else '')
    )


def _digest(token: str) -> bytes:
    return hashlib.sha256(token.encode('utf-8', 'backslashreplace')).digest()


def _write_tokens(file: Path) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    lines = ['# Tokens of the operator console: ROLE TOKEN [NAME]']
    lines += ['{} {}'.format(role, secrets.token_urlsafe(24)) for role in ROLES]
    descriptor = os.open(str(file), os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, 'w', encoding='utf-8') as out:
        out.write('\n'.join(lines) + '\n')
