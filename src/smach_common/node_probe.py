"""Asking a ROS node, behind its topics, whether it still lives."""

import http.client
import threading
import xmlrpc.client
from typing import Callable, Dict, Tuple, Union

ALIVE = 'alive'
GONE = 'gone'
NO_ANSWER = 'no answer'

CALL_LIMIT_S = 5.0  # a node that hangs must not hang its caller forever
PROBE_LIMIT_S = 1.5


class TimedTransport(xmlrpc.client.Transport):
    """XML-RPC over a connection with a time limit, in s."""

    def __init__(self, limit_s: float = CALL_LIMIT_S) -> None:
        super().__init__()
        self._limit_s = limit_s

    def make_connection(
        self, host: Union[str, Tuple[str, Dict[str, str]]]
    ) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = self._limit_s
        return connection


def probe_node(node_uri: str, caller_id: str) -> str:
    """Ask the slave API at `node_uri` for its process id.

    :returns: ALIVE if something answered, GONE if nobody listens there any more, NO_ANSWER if the
        host or the process keeps silent (frozen, busy, or cut off from the network).
    """
    try:
        with xmlrpc.client.ServerProxy(node_uri, TimedTransport(PROBE_LIMIT_S)) as node:
            node.getPid(caller_id)
        return ALIVE
    except ConnectionRefusedError:
        return GONE
    except (OSError, http.client.HTTPException):
        return NO_ANSWER
    except xmlrpc.client.Error:
        return ALIVE


def probe_in_background(node_uri: str, caller_id: str, answer: Callable[[str], None]) -> None:
    """Probe from a short-lived thread, and hand the verdict to `answer`."""
    threading.Thread(
        target=lambda: answer(probe_node(node_uri, caller_id)),
        name='probe %s' % node_uri,
        daemon=True,
    ).start()
