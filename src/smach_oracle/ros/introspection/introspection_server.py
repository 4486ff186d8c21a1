"""The ROS side of the smach viewer: what a machine is and does, and where it starts.

One thread and two publishers serve a whole tree of containers, of our engine or of upstream's. The
thread ends with the process: those of upstream's server, two for each container, keep it alive.
"""
import collections
import functools
import threading
import time
from typing import Any, Callable, Deque, Dict, List, NamedTuple, Optional, Set, Tuple

import rospy

import smach
from smach_msgs.msg import (
    SmachContainerInitialStatusCmd,
    SmachContainerStatus,
    SmachContainerStructure,
)

from .container_watch import ContainerTree, ContainerWatch
from .plain_pickle import RefusedDataError, decode_userdata, encode_userdata
from .viewer_jump import send_running, sender_of

STATUS_TOPIC = '/smach/container_status'
INIT_TOPIC = '/smach/container_init'
STRUCTURE_TOPIC = '/smach/container_structure'
HEARTBEAT_S = 2.0
LONGEST_BACKLOG = 5000
"""Status changes that may wait to be published; beyond it the oldest are dropped (and the log says
so).
"""
SUBSCRIBER_QUEUE = 5000
LARGE_DATA = 10000
BACKLOG_BYTES = 32 * 1024 * 1024
"""With that much waiting for a subscriber that does not read, statuses leave out userdata of
LARGE_DATA characters.
"""


class _Change(NamedTuple):
    """A status as it was in the executing thread."""
    watch: ContainerWatch
    info: str
    active_states: List[str]
    data: Dict[str, Any]
    stamp: Any


class _Greeter(rospy.SubscribeListener):
    """Sends a new subscriber everything at once."""

    def __init__(self, make_messages: Any) -> None:
        super().__init__()
        self._make_messages = make_messages

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        try:
            for message in self._make_messages():
                peer_publish(message)
        except Exception as err:
            # An error here would cost rospy the connection; the next heartbeat tries again.
            smach.logdebug('Introspection could not greet a subscriber: %r' % err)


class IntrospectionServer(object):
    """Publishes structure and status of a machine and of all containers in it.

    A status goes out at each start, transition and end of a container, in order, and every two
    seconds (wall time) with the structure. It costs the machine nothing while nobody subscribes.
    Userdata that cannot be pickled is left out. A command on the init topic sets where a container
    starts next, and with which userdata; a StateMachine that runs goes there at its next
    transition.
    """

    def __init__(self, server_name: str, state: Any, path: str) -> None:
        """
        :param server_name: the namespace of its topics, e.g. that of the node.
        :param state: the machine.
        :param path: what the machine is called, e.g. /SM_ROOT.
        """
        self._server_name = server_name
        self._state = state
        self._path = path
        self._tree = ContainerTree(self._note_change, self._is_heard)
        self._changes: Deque[_Change] = collections.deque(maxlen=LONGEST_BACKLOG)
        self._wake = threading.Event()
        self._thread: Optional[threading.Thread] = None
        self._status_pub: Optional[rospy.Publisher] = None
        self._structure_pub: Optional[rospy.Publisher] = None
        self._init_sub: Optional[rospy.Subscriber] = None
        self._left_out: Set[Tuple[str, str]] = set()
        self._dropped = 0
        self._said_heavy = False

    def start(self) -> None:
        """Begin to publish. Does nothing while already started."""
        if self._thread is not None:
            return
        name = self._server_name
        self._structure_pub = rospy.Publisher(name + STRUCTURE_TOPIC, SmachContainerStructure,
                                              subscriber_listener=_Greeter(self._structures),
                                              queue_size=SUBSCRIBER_QUEUE)
        self._status_pub = rospy.Publisher(name + STATUS_TOPIC, SmachContainerStatus,
                                           subscriber_listener=_Greeter(self._heartbeat_statuses),
                                           queue_size=SUBSCRIBER_QUEUE)
        self._tree.add_root(self._path, self._state)
        self._init_sub = rospy.Subscriber(name + INIT_TOPIC, SmachContainerInitialStatusCmd,
                                          self._on_init_command)
        self._thread = threading.Thread(target=self._run, name='introspection %s' % name,
                                        daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Publish what is still to be said, then nothing more."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        self._tree.clear()
        self._wake.set()
        if thread is not threading.current_thread():
            thread.join(2.0)
        for topic in (self._status_pub, self._structure_pub, self._init_sub):
            topic.unregister()  # type: ignore[union-attr]
        self._status_pub = self._structure_pub = self._init_sub = None

    def clear(self) -> None:
        """Forget all containers; ``construct`` adds some again."""
        self._tree.clear()

    def construct(self, server_name: str, state: Any, path: str) -> None:
        """Show another machine too, below ``path``, on the topics of this server."""
        self._tree.add_root(path, state)

    def _is_heard(self) -> bool:
        status_pub = self._status_pub
        return status_pub is not None and bool(status_pub.impl.connections)

    def _note_change(self, watch: ContainerWatch, info: str, active_states: List[str],
                     userdata: Any) -> None:
        """In the executing thread: leave the status to the publishing one."""
        if len(self._changes) == LONGEST_BACKLOG:
            if not self._dropped:
                smach.logwarn("Introspection '%s' cannot keep up: status messages are dropped" %
                              self._server_name)
            self._dropped += 1
        self._changes.append(
            _Change(watch, info, active_states, dict(getattr(userdata, '_data', {})),
                    rospy.get_rostime()))
        self._wake.set()

    def _run(self) -> None:
        me = threading.current_thread()
        heartbeat_at = time.monotonic()
        while not rospy.is_shutdown():
            self._wake.wait(max(0.0, heartbeat_at - time.monotonic()))
            self._wake.clear()
            self._publish_changes()
            if self._thread is not me:
                return
            if time.monotonic() >= heartbeat_at:
                self._publish_heartbeat()
                heartbeat_at = time.monotonic() + HEARTBEAT_S

    def _publish_changes(self) -> None:
        while self._changes:
            change = self._changes.popleft()
            self._publish(self._status_pub, functools.partial(self._status_messages, change))

    def _publish_heartbeat(self) -> None:
        self._tree.refresh()
        for topic, make_messages in ((self._structure_pub, self._structures),
                                     (self._status_pub, self._heartbeat_statuses)):
            if topic is not None and topic.get_num_connections():
                self._publish(topic, make_messages)

    def _publish(self, topic: Any, make_messages: Callable[[], List[Any]]) -> None:
        try:
            for message in make_messages():
                topic.publish(message)
        except Exception as err:
            # A machine half built, a label that is no text, a topic closed by stop(): never the end
            # of the publisher.
            smach.logdebug('Introspection could not publish: %r' % err)

    def _status_messages(self, change: _Change) -> List[SmachContainerStatus]:
        return [self._status_message(path, change) for path in change.watch.paths]

    def _status_message(self, path: str, change: _Change) -> SmachContainerStatus:
        message = SmachContainerStatus()
        message.header.stamp = change.stamp
        message.path = path
        message.initial_states = [
            str(label) for label in change.watch.container.get_initial_states()
        ]
        message.active_states = change.active_states
        message.local_data = encode_userdata(change.data,
                                             lambda key, err: self._tell_left_out(path, key, err))
        if len(message.local_data) > LARGE_DATA and _waiting_bytes(
                self._status_pub) > BACKLOG_BYTES:
            self._tell_heavy()
            message.local_data = encode_userdata({}, lambda key, err: None)
        message.info = change.info
        return message

    def _current_status(self, path: str, watch: ContainerWatch, info: str) -> SmachContainerStatus:
        container = watch.container
        active = [str(label) for label in container.get_active_states()]
        data = dict(getattr(container.userdata, '_data', {}))
        return self._status_message(path, _Change(watch, info, active, data, rospy.get_rostime()))

    def _heartbeat_statuses(self) -> List[SmachContainerStatus]:
        return [
            self._current_status(path, watch, 'HEARTBEAT')
            for path, watch in self._tree.by_path.items()
        ]

    def _structures(self) -> List[SmachContainerStructure]:
        return [
            structure_message(path, watch.container) for path, watch in self._tree.by_path.items()
        ]

    def _tell_heavy(self) -> None:
        if not self._said_heavy:
            self._said_heavy = True
            smach.logwarn(
                "A viewer of '%s' does not keep up; large userdata is left out of its statuses" %
                self._server_name)

    def _tell_left_out(self, path: str, key: str, err: Exception) -> None:
        if (path, key) not in self._left_out:
            self._left_out.add((path, key))
            smach.logwarn(
                "Userdata key '%s' of '%s' cannot be pickled and is left out of its status: %s" %
                (key, path, err))

    def _on_init_command(self, command: SmachContainerInitialStatusCmd) -> None:
        watch = self._tree.by_path.get(command.path)
        if watch is None:
            smach.logdebug("No container '%s' to set the initial state of" % command.path)
            return
        try:
            data = decode_userdata(command.local_data)
        except RefusedDataError as err:
            smach.logerr("Initial state of '%s' not set: %s" % (command.path, err))
            return
        if set_initial_states(watch, list(command.initial_states), data, sender_of(command)):
            confirmation = self._current_status(command.path, watch, 'REMOTE_INIT')
            self._publish(self._status_pub, lambda: [confirmation])


def _waiting_bytes(topic: Optional[rospy.Publisher]) -> int:
    """What rospy keeps for subscribers that have not read it yet.

    A hung one must not eat the robot's memory.
    """
    connections = topic.impl.connections if topic is not None and topic.impl is not None else ()
    return sum(
        len(data) for connection in connections for data in list(getattr(connection, '_queue', ())))


def set_initial_states(watch: ContainerWatch, labels: List[str], data: Dict[str, Any],
                       by: str = '') -> bool:
    """Let the container start in ``labels`` with ``data`` from now on, as ``by`` has asked.

    Returns False, and logs why, where it has no such states or refuses them. A StateMachine that
    runs now goes there at its next transition, as soon as its active state has ended; or as a
    sender of viewer_jump sends it.
    """
    container = watch.container
    unknown = [label for label in labels if label not in container.get_children()]
    if unknown:
        smach.logerr('Initial state %s not set: the container has only the states %s'
                     % (unknown, sorted(container.get_children())))
        return False
    goes_there = len(labels) == 1 and isinstance(
        container, smach.StateMachine) and container.is_running()
    is_sent = send_running(container, labels[0], data, by) if goes_there else None
    if is_sent is False:
        return False
    userdata = smach.UserData()
    for key, value in data.items():
        userdata[key] = value
    try:
        container.set_initial_state(labels, userdata)
    except smach.InvalidStateError as err:
        smach.logerr('Initial state %s not set: %s' % (labels, err))
        return False
    if goes_there:
        container.userdata.update(userdata)
        watch.jump_to = None if is_sent else labels[0]
    return True


def structure_message(path: str, container: Any) -> SmachContainerStructure:
    """The graph of ``container`` as it is shown under ``path``."""
    message = SmachContainerStructure()
    message.header.stamp = rospy.get_rostime()
    message.path = path
    message.children = [str(label) for label in container.get_children()]
    for outcome, source, target in container.get_internal_edges():
        message.internal_outcomes.append(str(outcome))
        message.outcomes_from.append(str(source))
        message.outcomes_to.append(str(target))
    message.container_outcomes = [str(outcome) for outcome in container.get_registered_outcomes()]
    return message
