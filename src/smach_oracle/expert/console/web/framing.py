"""Refuses requests whose end is in doubt, and finds the client of those that a proxy passes on.

A proxy and the console must agree where a request ends. Else the rest of one person's request is
read as the beginning of another's (request smuggling). Tornado 6.2 reads `Content-Length: +5` and
`1_0` as numbers, and takes a request with an unknown Transfer-Encoding for one without a body. No
page of ours sends a body in chunks, so that all of these are refused before a body is read.
"""

import re
from typing import Any, Awaitable, Optional, Union

import tornado.httputil

from .proxies import TrustedProxies

_TOKEN = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+")
_DIGITS = re.compile(r'[0-9]{1,18}')
_CONTROL = re.compile(r'[\x00-\x08\x0a-\x1f\x7f]')
_REFUSAL = b'HTTP/1.1 400 Bad Request\r\nConnection: close\r\nContent-Length: 0\r\n\r\n'
_StartLine = Union[tornado.httputil.RequestStartLine, tornado.httputil.ResponseStartLine]


def is_framed_well(headers: tornado.httputil.HTTPHeaders) -> bool:
    """Whether everybody who reads these headers finds the same end of the request. Pure."""
    if 'Transfer-Encoding' in headers:
        return False
    lengths = headers.get_list('Content-Length')
    if len(lengths) > 1 or not all(_DIGITS.fullmatch(length) for length in lengths):
        return False
    return all(
        _TOKEN.fullmatch(name) and not _CONTROL.search(value) for name, value in headers.get_all()
    )


class FramedRequest(tornado.httputil.HTTPMessageDelegate):
    """Stands before the application, for one request."""

    def __init__(
        self,
        inner: tornado.httputil.HTTPMessageDelegate,
        connection: tornado.httputil.HTTPConnection,
        proxies: TrustedProxies,
    ) -> None:
        self._inner = inner
        self._connection: Any = connection
        self._proxies = proxies

    def headers_received(
        self, start_line: _StartLine, headers: tornado.httputil.HTTPHeaders
    ) -> Optional[Awaitable[None]]:
        """Pass them on, or answer 400 and close. Nothing behind them is read then."""
        if not is_framed_well(headers):
            stream = self._connection.detach()
            stream.write(_REFUSAL)
            stream.close()
            return None
        context = self._connection.context
        peer, protocol = context.remote_ip, context.protocol
        if self._proxies.trusts(peer):
            context.remote_ip = self._proxies.client(headers.get('X-Forwarded-For', ''), peer)
            context.protocol = headers.get('X-Forwarded-Proto', protocol).lower()
        try:
            return self._inner.headers_received(start_line, headers)
        finally:  # the request has taken them over. The next one has its own
            context.remote_ip, context.protocol = peer, protocol

    def data_received(self, chunk: bytes) -> Optional[Awaitable[None]]:
        """Pass it on."""
        return self._inner.data_received(chunk)

    def finish(self) -> None:
        """Pass it on."""
        self._inner.finish()

    def on_connection_close(self) -> None:
        """Pass it on."""
        self._inner.on_connection_close()
