"""Asking a ROS node, behind its topics, whether it still lives."""

import http.client
import threading
import xmlrpc.client
from typing import Callable

ALIVE = 'alive'
GONE = 'gone'
NO_ANSWER = 'no answer'

ANSWER_WITHIN_S = 1.5


class _ProbeTransport(xmlrpc.client.Transport):
    """XML-RPC over HTTP that gives up after ``ANSWER_WITHIN_S``."""

    def make_connection(self, host):  # type: ignore[no-untyped-def]
        connection = super().make_connection(host)
        connection.timeout = ANSWER_WITHIN_S
        return connection


def probe_node(node_uri: str, caller_id: str) -> str:
    """Ask the slave API at ``node_uri`` for its pid.

    Returns ALIVE if something answered, GONE if nobody listens there any more, NO_ANSWER if the
    host or the process keeps silent (frozen, busy, or cut off from the network).
    """
    try:
        with xmlrpc.client.ServerProxy(node_uri, transport=_ProbeTransport()) as node:
            node.getPid(caller_id)
        return ALIVE
    except ConnectionRefusedError:
        return GONE
    except (OSError, http.client.HTTPException):
        return NO_ANSWER
    except xmlrpc.client.Error:
        return ALIVE


def probe_in_background(node_uri: str, caller_id: str, answer: Callable[[str], None]) -> None:
    """Probe from a short-lived thread and hand the verdict to ``answer``."""
    threading.Thread(
        target=lambda: answer(probe_node(node_uri, caller_id)),
        name='probe %s' % node_uri,
        daemon=True,
    ).start()
