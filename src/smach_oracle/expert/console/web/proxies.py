"""The reverse proxies that are trusted, and the address by which people reach the console. Pure."""

import ipaddress
from typing import FrozenSet, Iterable, NamedTuple, Optional, Union
from urllib.parse import urlsplit

from smach_oracle.oracle.errors import SettingsError

_PORTS = {'http': 80, 'https': 443}
_ALLOWED = 'http:// or https:// with a name and perhaps a port, such as https://robots.example.org'


class PublicAddress(NamedTuple):
    """The address of the console as people open it: in links, and behind a proxy."""

    scheme: str  # http or https
    host: str  # without its port, in lower case, an IPv6 address in brackets
    port: int

    @classmethod
    def parse(cls, name: str, text: str) -> 'PublicAddress':
        """Read the address from a setting.

        :param name: of the setting.
        :raises SettingsError: where it is no such address, or has a path.
        """
        try:
            parts = urlsplit(text)
            host, port = parts.hostname or '', parts.port
        except ValueError:
            raise SettingsError(name, text, _ALLOWED) from None
        if parts.scheme not in _PORTS or not host or '@' in parts.netloc or text != text.strip():
            raise SettingsError(name, text, _ALLOWED)
        if parts.path not in ('', '/') or parts.query or parts.fragment:
            raise SettingsError(name, text, _ALLOWED + ', and no path')
        shown = '[{}]'.format(host) if ':' in host else host
        return cls(parts.scheme, shown, port or _PORTS[parts.scheme])

    @property
    def origin(self) -> str:
        """Return what browsers send as Origin: without the port that its scheme has anyway."""
        port = '' if self.port == _PORTS[self.scheme] else ':{}'.format(self.port)
        return '{}://{}{}'.format(self.scheme, self.host, port)

    def is_host(self, header: str) -> bool:
        """Whether a Host header names this address."""
        wanted = self.origin.split('://')[1]
        with_port = '{}:{}'.format(self.host, self.port)
        return header.lower() in (wanted, with_port)


class TrustedProxies:
    """The addresses whose X-Forwarded-For and X-Forwarded-Proto are believed."""

    def __init__(self, addresses: Iterable[str] = ()) -> None:
        """:raises SettingsError: naming what is no address."""
        self._addresses: FrozenSet[str] = frozenset(map(_trusted, addresses))

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._addresses)

    def trusts(self, address: str) -> bool:
        """Whether a connection from this address comes from one of them."""
        return bool(self._addresses) and _plain(address) in self._addresses

    def client(self, forwarded_for: str, proxy: str) -> str:
        """Return the address that the nearest proxy has seen, the proxy's own where it says none.

        Entries further left are what the client itself may have sent.
        """
        for entry in reversed(forwarded_for.split(',')):
            address = _plain(entry.strip())
            if not address:
                return proxy
            if address not in self._addresses:
                return address
        return proxy


def _plain(address: str) -> str:
    """Return an address in its shortest form, '' for any other text."""
    found = _address(address)
    mapped = found.ipv4_mapped if isinstance(found, ipaddress.IPv6Address) else None
    return str(mapped or found or '')


def _address(text: str) -> Optional[Union[ipaddress.IPv4Address, ipaddress.IPv6Address]]:
    try:
        return ipaddress.ip_address(text)
    except ValueError:
        return None


def _trusted(text: str) -> str:
    plain = _plain(text)
    if not plain:
        raise SettingsError(
            '~trusted_proxy', text, 'IP addresses of reverse proxies, such as 127.0.0.1'
        )
    return plain
