"""A pulse that shows which nodes live: it asks each for its process id, again and again.

A node that was killed stays registered at the master, and one that is stopped keeps its
connections. Neither answers.
"""

import threading
import time
import xmlrpc.client
from http.client import HTTPException
from typing import Any, Callable, Collection, Dict, Optional

import rosgraph
import rospy

from smach_common.node_probe import TimedTransport
from smach_oracle.oracle.errors import OracleError

PERIOD_S = 1.5
MOST_NODES = 200
NO_ANSWER = (OSError, xmlrpc.client.Error, HTTPException)


class NodeUnknownError(OracleError):
    """The master knows no node of this name."""


class NodeLink:
    """Asks one node. Its address is looked up at the master, and kept while it answers."""

    def __init__(self, node: str) -> None:
        self._node = node
        self._uri = ''

    def ask(self) -> None:
        """Wait until the node has answered.

        :raises OSError, xmlrpc.client.Error, http.client.HTTPException, NodeUnknownError: where it
            has not.
        """
        try:
            if not self._uri:
                self._uri = self._look_up()
            _proxy(self._uri).getPid(rospy.get_name())
        except NO_ANSWER:
            self._uri = ''  # it may have been started again, with another address
            raise

    def _look_up(self) -> str:
        code, message, uri = _proxy(rosgraph.get_master_uri()).lookupNode(
            rospy.get_name(), self._node
        )
        if code != 1:
            raise NodeUnknownError('{}: {}'.format(self._node, message))
        return str(uri)


class NodePulse:
    """Asks nodes, each in a thread of its own: one that is stopped holds up no other."""

    def __init__(self, link: Callable[[str], Any] = NodeLink, period_s: float = PERIOD_S) -> None:
        """`link`: makes what asks a node, as NodeLink does."""
        self._link = link
        self._period_s = period_s
        self._heard_s: Dict[str, float] = {}
        self._stops: Dict[str, threading.Event] = {}

    def follow(self, nodes: Collection[str]) -> None:
        """Ask these nodes and no others from now on. One thread calls it."""
        wanted = sorted(nodes)[:MOST_NODES]
        for node in wanted:
            if node not in self._stops:
                self._stops[node] = stop = threading.Event()
                threading.Thread(
                    target=self._run, args=(node, stop), name='pulse ' + node, daemon=True
                ).start()
        for node in set(self._stops) - set(wanted):
            self._stops.pop(node).set()

    def heard_s(self, node: str) -> Optional[float]:
        """Return when it answered last, by the monotonic clock, or None where it never has."""
        return self._heard_s.get(node)

    def _run(self, node: str, stop: threading.Event) -> None:
        link = self._link(node)
        while not stop.is_set() and not rospy.is_shutdown():
            asked_s = time.monotonic()
            try:
                link.ask()
                self._heard_s[node] = asked_s
            except (*NO_ANSWER, NodeUnknownError) as err:
                rospy.logdebug('%s does not answer: %s', node, err)
            stop.wait(self._period_s)
        self._heard_s.pop(node, None)


def _proxy(uri: str) -> Any:
    # a new one each time: a kept connection does not outlive what it leads to
    return xmlrpc.client.ServerProxy(uri, transport=TimedTransport())
