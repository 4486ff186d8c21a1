"""Survive a restart of the ROS master.

A node registers its topics and services once. A master that is restarted knows nothing of them:
existing connections go on, but nobody new can find the node. `MasterWatch` notices and registers
everything again.
"""

import threading
import time
import xmlrpc.client
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, Tuple

import rosgraph
import rospy
from rospy.impl.paramserver import get_param_server_cache
from rospy.impl.registration import (
    RegManager,
    get_registration_listeners,
    get_service_manager,
    get_topic_manager,
)

from smach_common.node_probe import CALL_LIMIT_S, TimedTransport
from smach_oracle.forking import in_child

POLL_S = 1.0
# rospy asks for it at each line of the log
_ROSOUT_PARAM = '/rosout_disable_topics_generation'


class MasterCallError(Exception):
    """The master answered with an error. The text names the call and the reason."""


class Registrations(NamedTuple):
    """Everything a node has at its master, by resolved names."""

    publications: Sequence[Sequence[str]]  # (topic, type)
    subscriptions: Sequence[Sequence[str]]  # (topic, type)
    services: Sequence[Tuple[str, str]]  # (service, uri)


class MasterLink:
    """The calls of the master's API that the watch needs, made in the node's own name.

    :raises OSError, xmlrpc.client.Error, http.client.HTTPException: in every method, where the
        master gives no answer.
    """

    def __init__(self, master_uri: str, caller_id: str, node_uri: str) -> None:
        self._master_uri = master_uri
        self._caller_id = caller_id
        self._node_uri = node_uri

    def identity(self) -> Tuple[int, bool]:
        """Return the master's process id, and whether it knows this node."""
        with self._proxy() as master:
            pid = master.getPid(self._caller_id)[2]
            # a node of the same name elsewhere counts as known: it has replaced this one, which is
            # being shut down
            return pid, master.lookupNode(self._caller_id, self._caller_id)[0] == 1

    def register(self, items: Registrations) -> List[Tuple[str, List[str]]]:
        """Register everything. Harmless for what the master knows already.

        Topics that others listen to come last: a node that hears from this one may call its
        services at once.

        :returns: for each subscription its topic and the URIs of the publishers that the master
            knows.
        :raises MasterCallError: naming what the master refused.
        """
        with self._proxy() as master:
            for service, uri in items.services:
                self._call(master.registerService, service, uri, self._node_uri)
            found = [
                (topic, self._call(master.registerSubscriber, topic, kind, self._node_uri))
                for topic, kind in items.subscriptions
            ]
            for topic, kind in items.publications:
                self._call(master.registerPublisher, topic, kind, self._node_uri)
            return found

    def _call(self, method: Callable[..., Any], name: str, *args: str) -> Any:
        code, message, value = method(self._caller_id, name, *args)
        if code != 1:
            raise MasterCallError('{}: {}'.format(name, message))
        return value

    def _proxy(self) -> Any:
        # a new one each time: a kept connection does not outlive the master that it leads to
        return xmlrpc.client.ServerProxy(self._master_uri, transport=TimedTransport())


class MasterWatch:
    """Polls the master and registers this node again where the master has forgotten it.

    It polls about once a second: two local calls of about a millisecond. A new master has another
    process id, or does not know this node, or could not be reached before.
    """

    def __init__(
        self,
        link: MasterLink,
        registrations: Callable[[], Registrations],
        found_publishers: Callable[[str, List[str]], None],
        poll_s: float = POLL_S,
    ) -> None:
        self._link = link
        self._registrations = registrations
        self._found_publishers = found_publishers
        self._poll_s = poll_s
        self._known_pid: Optional[int] = None
        self._lost = False
        self._heard_s: Optional[float] = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='master_watch', daemon=True)

    @property
    def heard_s(self) -> Optional[float]:
        """Return when the master answered last (monotonic clock, s), None before it has."""
        return self._heard_s

    def start(self) -> None:
        """Begin to watch. The thread ends with the process."""
        self._thread.start()

    def stop(self) -> None:
        """Watch no longer."""
        self._stop.set()

    def check(self) -> None:
        """Look once, and register again where needed."""
        try:
            asked_s = time.monotonic()
            pid, known = self._link.identity()
            self._heard_s = asked_s
            if self._known_pid is None and known:
                self._known_pid = pid
            if self._lost or not known or pid != self._known_pid:
                self._register(pid)
        except Exception as err:
            # refused, timed out, or any half answer of a master that is just dying
            self._note_loss(err)

    def _register(self, pid: int) -> None:
        items = self._registrations()
        for topic, uris in self._link.register(items):
            self._found_publishers(topic, uris)
        self._known_pid, self._lost = pid, False
        rospy.logwarn(
            'The ROS master was restarted: registered %d publishers, %d subscribers and %d '
            'services again.',
            len(items.publications),
            len(items.subscriptions),
            len(items.services),
        )

    def _note_loss(self, err: Exception) -> None:
        if not self._lost and not self._stop.is_set() and not rospy.is_shutdown():
            rospy.logwarn(
                'The ROS master does not answer (%s); looking again every %.1f s.',
                err,
                self._poll_s,
            )
        self._lost = True

    def _run(self) -> None:
        while not self._stop.wait(self._poll_s) and not rospy.core.is_shutdown_requested():
            self.check()


_watch_lock = threading.Lock()
_watch: Optional[MasterWatch] = None


def timed_master(limit_s: float = CALL_LIMIT_S) -> rosgraph.Master:
    """Return this node's master. A call of a master that hangs ends in an OSError."""
    master = rosgraph.Master(rospy.get_name())
    master.handle = xmlrpc.client.ServerProxy(master.master_uri, transport=TimedTransport(limit_s))
    return master


def start_master_watch() -> MasterWatch:
    """Watch the master on behalf of this node, one watch per process, however often called.

    From then on no line of this node's log waits for the master.

    :raises rospy.ROSInitException: before rospy.init_node.
    """
    global _watch
    if not rospy.core.is_initialized():
        raise rospy.ROSInitException('start_master_watch needs rospy.init_node first')
    with _watch_lock:
        if _watch is None:
            _keep_log_from_master()
            link = MasterLink(
                rosgraph.get_master_uri(), rospy.get_name(), rospy.core.get_node_uri()
            )
            _watch = MasterWatch(link, _own_registrations, _connect)
            _watch.start()
        return _watch


def _forget_watch() -> None:
    """Let a forked child that becomes a node have a watch of its own."""
    global _watch, _watch_lock
    _watch, _watch_lock = None, threading.Lock()


in_child(_forget_watch)


def _keep_log_from_master() -> None:
    """Let rospy remember that the parameter of its log is not set.

    It forgets, and asks the master again at each line of the log, in whichever thread. A master
    that hangs would hold up each thread that logs. A value that is set later arrives anyway: rospy
    has subscribed to the parameter.
    """
    if rospy.get_param_cached(_ROSOUT_PARAM, None) is None:
        get_param_server_cache().set(_ROSOUT_PARAM, False)


def _own_registrations() -> Registrations:
    topics = get_topic_manager()
    return Registrations(
        topics.get_publications(), topics.get_subscriptions(), get_service_manager().get_services()
    )


def _connect(topic: str, publisher_uris: List[str]) -> None:
    """Connect to publishers, as when the master announces them.

    Those already connected are left alone.
    """
    for listener in get_registration_listeners().listeners:
        if isinstance(listener, RegManager):
            listener.publisher_update(topic, publisher_uris)
