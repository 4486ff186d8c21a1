"""The ROS side of the smach viewer: what a machine is and does, and where it starts.

One thread and two publishers serve a whole tree of containers, of our engine or of upstream's. The
thread ends with the process: those of upstream's server, two for each container, keep it alive.
"""

import collections
import functools
import threading
import time
from typing import (
    Any,
    Callable,
    Counter,
    Deque,
    Dict,
    List,
    NamedTuple,
    Optional,
    Sequence,
    Set,
    Tuple,
)

import rospy

import smach
from smach_msgs.msg import (
    SmachContainerInitialStatusCmd,
    SmachContainerStatus,
    SmachContainerStructure,
)

from ..connections import sender_of
from ..foreign import text_of, type_name
from .container_watch import ContainerTree, ContainerWatch
from .heartbeat_rounds import HeartbeatRounds
from .plain_pickle import RefusedDataError, decode_userdata, encode_userdata
from .viewer_jump import send_running
from .wire_topic import LatestMessages, WireMessage, WireTopic, waiting_bytes

STATUS_TOPIC = '/smach/container_status'
INIT_TOPIC = '/smach/container_init'
STRUCTURE_TOPIC = '/smach/container_structure'
LONGEST_BACKLOG = 5000
"""Status changes that may wait to be published; beyond it the oldest are dropped (and the log says
so).
"""
LARGE_DATA = 10000
BACKLOG_BYTES = 32 * 1024 * 1024
"""With that much waiting for a subscriber that does not read, statuses leave out userdata of
LARGE_DATA characters.
"""


class _Change(NamedTuple):
    """A status as it was in the executing thread."""

    watch: ContainerWatch
    paths: Sequence[str]
    info: str
    active_states: List[str]
    data: Dict[str, Any]
    stamp: Any


class IntrospectionServer(object):
    """Publishes structure and status of a machine and of all containers in it.

    A status goes out at each start, transition and end of a container, in order, and every two
    seconds (wall time) with the structure. It costs the machine nothing while nobody subscribes.
    Userdata that cannot be pickled is left out. A command on the init topic sets where a container
    starts next, and with which userdata. A StateMachine that runs goes there at its next
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
        self._rounds = HeartbeatRounds(self._begin_round)
        self._latest_structures = LatestMessages(SmachContainerStructure)
        self._latest_statuses = LatestMessages(SmachContainerStatus)
        self._changes: Deque[_Change] = collections.deque(maxlen=LONGEST_BACKLOG)
        self._wake = threading.Event()
        self._thread: Optional[threading.Thread] = None
        self._status_pub: Optional[WireTopic] = None
        self._structure_pub: Optional[WireTopic] = None
        self._init_sub: Optional[rospy.Subscriber] = None
        self._left_out: Set[Tuple[str, str]] = set()
        self._failures: Counter[str] = collections.Counter()  # to make a message, by path
        self._dropped = 0
        self._said_heavy = False

    def start(self) -> None:
        """Begin to publish. Does nothing while already started."""
        if self._thread is not None:
            return
        name = self._server_name
        self._structure_pub = WireTopic(
            name + STRUCTURE_TOPIC, SmachContainerStructure, self._greet
        )
        self._status_pub = WireTopic(name + STATUS_TOPIC, SmachContainerStatus, self._greet)
        self._tree.add_root(self._path, self._state)
        self._init_sub = rospy.Subscriber(
            name + INIT_TOPIC, SmachContainerInitialStatusCmd, self._on_init_command
        )
        self._thread = threading.Thread(
            target=self._run, name='introspection %s' % name, daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Publish what is still to be said, then nothing more. Take callbacks and topics back."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        self._tree.clear()
        self._wake.set()
        if thread is not threading.current_thread():
            thread.join(2.0)
        for topic in (self._status_pub, self._structure_pub):
            topic.close()  # type: ignore[union-attr]
        self._init_sub.unregister()  # type: ignore[union-attr]
        self._status_pub = self._structure_pub = self._init_sub = None

    def leave_to_parent(self) -> None:
        """Show nothing on the topics of the parent. A forked child calls it."""
        self._thread = self._status_pub = None

    def clear(self) -> None:
        """Forget all containers. ``construct`` adds some again."""
        self._tree.clear()

    def construct(self, server_name: str, state: Any, path: str) -> None:
        """Show another machine too, below ``path``, on the topics of this server."""
        self._tree.add_root(path, state)

    def _is_heard(self) -> bool:
        status_pub = self._status_pub
        return status_pub is not None and status_pub.is_heard()

    def _greet(self) -> None:
        """Tell a new subscriber of everything at once."""
        self._rounds.greet()
        self._wake.set()

    def _note_change(
        self, watch: ContainerWatch, info: str, active_states: List[str], userdata: Any
    ) -> None:
        """Leave the status to the publishing thread. The executing one calls it."""
        if len(self._changes) == LONGEST_BACKLOG:
            if not self._dropped:
                smach.logwarn(
                    "Introspection '%s' cannot keep up: status messages are dropped"
                    % self._server_name
                )
            self._dropped += 1
        self._changes.append(
            _Change(
                watch,
                watch.paths,
                info,
                active_states,
                dict(getattr(userdata, '_data', {})),
                rospy.get_rostime(),
            )
        )
        self._wake.set()

    def _run(self) -> None:
        me = threading.current_thread()
        while not rospy.is_shutdown():
            self._wake.wait(self._rounds.wait_s(time.monotonic()))
            self._wake.clear()
            self._publish_changes()
            if self._thread is not me:
                return
            self._publish_heartbeats(self._rounds.due(time.monotonic()))

    def _publish_changes(self) -> None:
        while self._changes:
            change = self._changes.popleft()
            for path in change.paths:
                self._publish(self._status_pub, path, functools.partial(self._status, path, change))

    def _begin_round(self) -> List[str]:
        """Look what there is to be told of. It does nothing while nobody listens."""
        try:
            self._tree.refresh()
        except Exception as err:
            # what was found before is shown, and the thread goes on
            smach.logdebug('Introspection could not look for containers: %r' % err)
        paths = list(self._tree.by_path)
        for latest in (self._latest_structures, self._latest_statuses):
            latest.keep_only(paths)
        topics = (self._structure_pub, self._status_pub)
        return paths if any(topic is not None and topic.is_heard() for topic in topics) else []

    def _publish_heartbeats(self, paths: Sequence[str]) -> None:
        stamp, by_path = rospy.get_rostime(), self._tree.by_path
        shown = [path for path in paths if path in by_path]  # else cleared meanwhile
        for topic, make in (
            (self._structure_pub, self._structure),
            (self._status_pub, self._heartbeat),
        ):
            if topic is not None and topic.is_heard():
                made = (
                    self._made(path, functools.partial(make, path, by_path[path], stamp))
                    for path in shown
                )
                topic.send([message for message in made if message is not None], to_lagging=False)

    def _publish(
        self, topic: Optional[WireTopic], path: str, make: Callable[[], WireMessage]
    ) -> None:
        message = self._made(path, make)
        if message is not None and topic is not None:
            topic.send([message])

    def _made(self, path: str, make: Callable[[], WireMessage]) -> Optional[WireMessage]:
        """Return a message, or None for a container that cannot be shown. The others still are."""
        try:
            return make()
        except Exception as err:
            # once: a machine that grew meanwhile, twice: a container of somebody's own
            self._failures[path] += 1
            if self._failures[path] == 2:
                smach.logwarn("Introspection cannot show '%s': %r" % (path, err))
            return None

    def _status(self, path: str, change: _Change) -> WireMessage:
        initial_states = [str(label) for label in change.watch.container.get_initial_states()]
        data = encode_userdata(change.data, lambda key, err: self._tell_left_out(path, key, err))
        if len(data) > LARGE_DATA and self._waiting_bytes() > BACKLOG_BYTES:
            self._tell_heavy()
            data = encode_userdata({}, lambda key, err: None)
        return self._latest_statuses.make(
            change.stamp, path, initial_states, change.active_states, data, change.info
        )

    def _current_status(
        self, path: str, watch: ContainerWatch, info: str, stamp: Optional[rospy.Time] = None
    ) -> WireMessage:
        container = watch.container
        active = [str(label) for label in container.get_active_states()]
        data = dict(getattr(container.userdata, '_data', {}))
        return self._status(
            path, _Change(watch, (), info, active, data, stamp or rospy.get_rostime())
        )

    def _heartbeat(self, path: str, watch: ContainerWatch, stamp: rospy.Time) -> WireMessage:
        return self._current_status(path, watch, 'HEARTBEAT', stamp)

    def _structure(self, path: str, watch: ContainerWatch, stamp: rospy.Time) -> WireMessage:
        return self._latest_structures.make(stamp, path, *structure_fields(watch.container))

    def _waiting_bytes(self) -> int:
        impl = self._status_pub.impl if self._status_pub is not None else None
        return waiting_bytes(impl.connections) if impl is not None else 0

    def _tell_heavy(self) -> None:
        if not self._said_heavy:
            self._said_heavy = True
            smach.logwarn(
                "A viewer of '%s' does not keep up; large userdata is left out of its statuses"
                % self._server_name
            )

    def _tell_left_out(self, path: str, key: str, err: BaseException) -> None:
        if (path, key) not in self._left_out:
            self._left_out.add((path, key))
            smach.logwarn(
                "Userdata key '%s' of '%s' cannot be pickled and is left out of its status: %s"
                % (text_of(key), path, text_of(err) or type_name(err))
            )

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
            confirm = functools.partial(self._current_status, command.path, watch, 'REMOTE_INIT')
            self._publish(self._status_pub, command.path, confirm)


def set_initial_states(
    watch: ContainerWatch, labels: List[str], data: Dict[str, Any], by: str = ''
) -> bool:
    """Let the container start in ``labels`` with ``data`` from now on, as ``by`` has asked.

    Returns False, and logs why, where it has no such states or refuses them. A StateMachine that
    runs now goes there at its next transition, as soon as its active state has ended, or as a
    sender of viewer_jump sends it.
    """
    container = watch.container
    unknown = [label for label in labels if label not in container.get_children()]
    if unknown:
        smach.logerr(
            'Initial state %s not set: the container has only the states %s'
            % (unknown, sorted(container.get_children()))
        )
        return False
    is_machine = len(labels) == 1 and isinstance(container, smach.StateMachine)
    goes_there = is_machine and container.is_running()
    is_sent = send_running(container, labels[0], data, by) if is_machine else None
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


def structure_fields(container: Any) -> Tuple[List[str], ...]:
    """Return the graph of ``container``: the fields of SmachContainerStructure behind its path."""
    edges = [
        (str(outcome), str(source), str(target))
        for outcome, source, target in container.get_internal_edges()
    ]
    return (
        [str(label) for label in container.get_children()],
        [outcome for outcome, _, _ in edges],
        [source for _, source, _ in edges],
        [target for _, _, target in edges],
        [str(outcome) for outcome in container.get_registered_outcomes()],
    )
