"""The number of connections that the console holds, before a token and with one.

Each takes one of the files that the process may open, and the ROS side needs files, too. Who has
not come with a token is turned away first, and nobody can take the place of who has.
"""

import resource
from collections import Counter, OrderedDict
from typing import Any, Dict, Optional

import rospy
import tornado.httpserver
import tornado.httputil
import tornado.iostream

from .access import RateLimit, network_of
from .framing import FramedRequest
from .proxies import TrustedProxies

MOST_STRANGERS = 192  # connections that have shown no token, in all
MOST_OF_A_NETWORK = 32  # of these from one address
MOST_KNOWN = 320  # with a token, in all
SPARED = 8  # of one address, as long as others have more. A browser opens six
MOST_OF_A_SESSION = 64  # of these from one browser
KEPT_FILES = 256  # for the ROS side, bags and the console itself


class OpenConnections:
    """The open connections. For the thread of the loop that serves them.

    Where there are too many strangers, the one goes that has asked for nothing for the longest
    time, of the addresses that have many: a person who comes among very many idle ones gets in.
    """

    def __init__(
        self, most_files: Optional[int] = None, proxies: Optional[TrustedProxies] = None
    ) -> None:
        """
        :param most_files: that this process may open, by default as the system says.
        :param proxies: they limit the connections of their clients by themselves.
        """
        self._proxies = proxies or TrustedProxies()
        files = most_files or resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        # a new file has the lowest number that is free: one above means that the files run out
        self._highest_file = max(files // 2, files - KEPT_FILES)
        self._warnings = RateLimit(1.0 / 60.0, 1.0)
        # address by connection, in the order of their last requests
        self._strangers: 'OrderedDict[tornado.iostream.IOStream, str]' = OrderedDict()
        self._known: Dict[tornado.iostream.IOStream, str] = {}  # session

    def admit(self, stream: tornado.iostream.IOStream, address: str) -> bool:
        """Whether a new connection may stay. It or another one may be closed."""
        if self._proxies.trusts(address):
            return self._admit_proxy(stream)
        network = self._strangers[stream] = network_of(address)
        if stream.socket.fileno() >= self._highest_file:
            self._forget_closed()
            self._close_one()
        if self._is_over(network):
            self._forget_closed()
        if self._of(network) > MOST_OF_A_NETWORK:
            self._close(next(each for each, of in self._strangers.items() if of == network))
        elif len(self._strangers) > MOST_STRANGERS:
            self._close_one()
        return not stream.closed()

    def _admit_proxy(self, stream: tornado.iostream.IOStream) -> bool:
        """Whether a connection of a proxy may stay: the requests on it are of many people."""
        if len(self._known) >= MOST_KNOWN:
            self._forget_closed()
        if len(self._known) >= MOST_KNOWN:
            stream.close()
        else:
            self._known[stream] = ''
        return not stream.closed()

    def heard(self, request: tornado.httputil.HTTPServerRequest, session: str) -> bool:
        """Whether a request may go on. `session`: who has come with a token, '' for a stranger."""
        stream = _stream_of(request)
        if stream is None or stream in self._known:
            return True
        if stream in self._strangers:
            self._strangers.move_to_end(stream)
        if not session:
            return True
        if self._has_no_room(session):
            self._forget_closed()
            if self._has_no_room(session):
                return False
        self._strangers.pop(stream, None)
        self._known[stream] = session
        return True

    def _has_no_room(self, session: str) -> bool:
        return (
            len(self._known) >= MOST_KNOWN
            or sum(1 for each in self._known.values() if each == session) >= MOST_OF_A_SESSION
        )

    def _is_over(self, network: str) -> bool:
        return len(self._strangers) > MOST_STRANGERS or self._of(network) > MOST_OF_A_NETWORK

    def _of(self, network: str) -> int:
        return sum(1 for each in self._strangers.values() if each == network)

    def _close_one(self) -> None:
        counts = Counter(self._strangers.values())
        greedy = [each for each, network in self._strangers.items() if counts[network] > SPARED]
        self._close(next(iter(greedy or self._strangers)))

    def _close(self, stream: tornado.iostream.IOStream) -> None:
        network = self._strangers.pop(stream)
        stream.close()
        if self._warnings.take():
            rospy.logwarn(
                'Too many connections without a token, among them some from %s: those '
                'that ask for nothing are closed.',
                network,
            )

    def _forget_closed(self) -> None:
        for streams in (self._strangers, self._known):
            for stream in [each for each in streams if each.closed()]:
                del streams[stream]


class LimitedServer(tornado.httpserver.HTTPServer):
    """A server that admits only so many connections."""

    connections: OpenConnections  # to be set before it is given sockets
    proxies = TrustedProxies()

    def start_request(
        self, server_conn: object, request_conn: tornado.httputil.HTTPConnection
    ) -> tornado.httputil.HTTPMessageDelegate:
        """Begin to read a request."""
        inner = super().start_request(server_conn, request_conn)
        return FramedRequest(inner, request_conn, self.proxies)

    def handle_stream(self, stream: tornado.iostream.IOStream, address: Any) -> None:
        """Begin to serve a connection."""
        if self.connections.admit(stream, address[0]):
            super().handle_stream(stream, address)


def _stream_of(request: tornado.httputil.HTTPServerRequest) -> Optional[tornado.iostream.IOStream]:
    return getattr(request.connection, 'stream', None)
