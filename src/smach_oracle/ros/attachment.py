"""What a process has once, and every top-level machine in it is attached to: the expert, the publishers, the
introspection, the recorder, the watch over the master.

Started at the first execute of a machine that needs it, so that importing this package, building machines and wrapping
them cost nothing and need no ROS master.
"""
import os
import sys
import threading
import time
import weakref
from typing import Any, Callable, Dict, List, MutableSet, NamedTuple, Optional, Tuple

import rospy
import smach

from smach_oracle.msg import ConsoleCommand, FailureFrames, InterfaceOutput
from smach_oracle.oracle.errors import ConfigError
from smach_oracle.oracle.paths import path_of

from .expert_client import OWN_SERVER, ExpertQueryClient
from .event_messages import rates_to_msg
from .failure_frames import TOPIC as FRAMES_TOPIC
from .interface_starting import OUTPUT_TOPIC
from .master_watch import start_master_watch
from .publishers import EventPublisher, RatesPublisher
from .recorder import TrialRecorder, prepare_folder
from .recorder_topics import action_topics, audit_topic, smach_topics

PREEMPT_WAIT_S = 1.0  # for machines to end, before their bags are closed under them


class Options(NamedTuple):
    """What the process was started with; goes over the private parameters of the same names."""

    record: str = ''  # folder, '' where `~record` decides
    record_topics: Tuple[str, ...] = ()


class _RecordingPlan(NamedTuple):
    folder: str
    topics: List[str]
    types: Dict[str, Any]


class Attachments:
    """The attachments of one process."""

    def __init__(self) -> None:
        self.options = Options()
        self._lock = threading.RLock()
        self._machines: MutableSet[Any] = weakref.WeakSet()  # all that ever ran
        self._on_ros: MutableSet[Any] = weakref.WeakSet()  # those of them that are attached to the node
        self._introspection: Dict[str, Any] = {}  # path -> our server; one holds its machine
        self._expert: Optional[ExpertQueryClient] = None
        self._events: Optional[EventPublisher] = None
        self._rates: Optional[RatesPublisher] = None
        self._recorder: Optional[TrialRecorder] = None
        self._recorder_wanted = True
        self._node_started = False

    def attach(self, machine: Any) -> None:
        """Attach a top-level machine; does nothing the second time, and little where this process is no ROS node.

        :raises OSError: where the folder for the bags cannot be made or written.
        """
        if machine in self._on_ros:
            return
        with self._lock:
            self._machines.add(machine)
            node = rospy.core.is_initialized() and not rospy.core.is_shutdown_requested()
            plan = self._plan_recording(node)  # first, since it may raise
            if node:
                self._start_node()
                self._attach_to_node(machine)
                self._on_ros.add(machine)
            self._record(machine, plan)  # last: topics that are there already are recorded from the first trial on

    def preempt(self) -> None:
        """Ask every machine that runs to stop; its question, if any, is taken back with it."""
        for machine in self._running():
            machine.request_preempt()

    def close(self, timeout_s: float) -> None:
        """Close the bags, also of trials that have not ended. Any thread, any number of times."""
        recorder = self._recorder
        if recorder is not None:
            recorder.close(timeout_s)

    def _running(self) -> List[Any]:
        return [machine for machine in list(self._machines) if machine.is_running()]

    def _start_node(self) -> None:
        if self._node_started:
            return
        self._node_started = True
        rospy.on_shutdown(self._on_shutdown)
        start_master_watch()
        self._events = EventPublisher()
        self._rates = RatesPublisher()

    def _attach_to_node(self, machine: Any) -> None:
        introspect = read_private('introspection', True)  # first, since it may raise
        face = machine._oracle.face
        if face.recovers and face.expert is None:
            face.expert = self._shared_expert()
        if self._events is not None:
            face.events.observers.append(self._events)
        if self._rates is not None:
            self._rates.watch(face)
        if introspect and not has_introspection(machine):
            self._introspect(machine)

    def _introspect(self, machine: Any) -> None:
        """Show the machine; it replaces an earlier one of its name, as where a script builds one for each trial."""
        path = machine._oracle.path
        earlier = self._introspection.pop(path, None)
        if earlier is not None:
            earlier.stop()
        self._introspection[path] = start_introspection(machine)

    def _shared_expert(self) -> ExpertQueryClient:
        if self._expert is None:
            self._expert = ExpertQueryClient(read_private('expert_query_server', ''),
                                             cameras=read_private('failure_cameras', []))
        return self._expert

    def _plan_recording(self, node: bool) -> Optional[_RecordingPlan]:
        """Folder and topics for the recorder; None where there is one already, or none is wanted."""
        if self._recorder is not None or not self._recorder_wanted:
            return None
        folder = self.options.record or (read_private('record', '') if node else '')
        plan = self._plan_for(folder, node) if folder else None
        self._recorder_wanted = not node  # without a node, `~record` may yet come
        return plan

    def _plan_for(self, folder: str, node: bool) -> _RecordingPlan:
        folder = os.path.abspath(path_of(folder))
        prepare_folder(folder)
        topics = list(self.options.record_topics)
        if node:
            topics += _topic_names(read_private('record_topics', []))
            topics += smach_topics(rospy.get_name()) + action_topics(rospy.resolve_name('~expert_query'))
            audit = audit_topic(rospy.resolve_name(read_private('expert_query_server', '') or OWN_SERVER))
            types = {audit: ConsoleCommand, rospy.resolve_name(OUTPUT_TOPIC): InterfaceOutput}
            if read_private('failure_cameras', []):
                types[rospy.resolve_name(FRAMES_TOPIC)] = FailureFrames
            return _RecordingPlan(folder, topics + list(types), types)
        return _RecordingPlan(folder, topics, {})

    def _record(self, machine: Any, plan: Optional[_RecordingPlan]) -> None:
        if plan is not None:
            self._recorder = TrialRecorder(plan.folder, plan.topics, types=plan.types)
        if self._recorder is not None:
            self._recorder.attach(machine._oracle.events, {'~oracle/rates': _rates_of(machine)})

    def _on_shutdown(self) -> None:
        """rospy's shutdown hook, often run inside a signal handler in the machine's own thread.

        So it must not wait for a lock that this thread may hold: others do the work, and it waits for them only a
        little, so that the preempt comes before rospy goes down.
        """
        preempting = threading.Thread(target=self.preempt, name='shutdown_preempt', daemon=True)
        preempting.start()
        preempting.join(0.1)
        threading.Thread(target=self._close_when_ended, name='shutdown_close', daemon=True).start()

    def _close_when_ended(self) -> None:
        until = time.monotonic() + PREEMPT_WAIT_S
        while self._running() and time.monotonic() < until:
            time.sleep(0.02)
        self.close(PREEMPT_WAIT_S)


def read_private(name: str, default: Any) -> Any:
    """A private parameter of the node.

    :returns: the default where it is not set, or the master cannot be asked (logged).
    :raises ConfigError: where it is of another type than the default.
    """
    param = '~' + name
    try:
        value = rospy.get_param(param, default)
    except (OSError, rospy.ROSException) as err:
        rospy.logwarn('Parameter %s could not be read: %s', rospy.resolve_name(param), err)
        return default
    if not isinstance(value, type(default)):
        allowed = {bool: 'true or false', str: 'a string', list: 'a list of strings'}[type(default)]
        raise ConfigError('parameter ' + rospy.resolve_name(param), value, allowed)
    return value


def _topic_names(names: List[Any]) -> List[str]:
    for name in names:
        if not isinstance(name, str) or not name:
            raise ConfigError('parameter ' + rospy.resolve_name('~record_topics'), name, 'names of topics')
    return names


def has_introspection(machine: Any) -> bool:
    """Whether an IntrospectionServer of smach_ros already listens to this machine.

    Told by its callbacks: the server of a script that was made before the machine first ran.
    """
    callbacks: List[Tuple[Callable[..., None], Any]] = []
    for name in ('_start_cbs', '_transition_cbs', '_termination_cbs'):
        callbacks += getattr(machine, name, [])
    owners = [getattr(callback[0], '__self__', callback[0]) for callback in callbacks]
    return any(type(owner).__module__.split('.')[0] == 'smach_ros' for owner in owners)


def start_introspection(machine: Any) -> Any:
    """Show the machine, its ORACLE and its nested ones under `<node>/smach/container_*`."""
    server = _smach_ros().IntrospectionServer(rospy.get_name(), machine, '/' + machine._oracle.path)
    server.start()
    return server


def _smach_ros() -> Any:
    """The module; it sends SMACH's log to rospy when imported, which is for the program to decide, not for us."""
    if 'smach_ros' in sys.modules:
        return sys.modules['smach_ros']
    loggers = smach.loginfo, smach.logwarn, smach.logdebug, smach.logerr
    import smach_ros
    smach.set_loggers(*loggers)
    return smach_ros


def _rates_of(machine: Any) -> Callable[[], Any]:
    reference = weakref.ref(machine)

    def take() -> Any:
        alive = reference()
        if alive is None:
            return None
        face = alive._oracle.face
        return rates_to_msg(face.trial_id, face.rates(), face.transition_counts())
    return take


_attachments = Attachments()


def attachments() -> Attachments:
    """Those of this process."""
    return _attachments


def configure(options: Options) -> None:
    """Set the options of this process, before the first machine runs."""
    _attachments.options = options
