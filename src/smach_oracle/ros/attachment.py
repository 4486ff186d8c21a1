"""Attaches top-level machines to their node: each process has all of this once.

The expert, the publishers, the introspection, the recorder and the watch over the master.

Started at the first execute of a machine that needs it, so that importing this package, building
machines and wrapping them cost nothing and need no ROS master.
"""

import functools
import os
import threading
import time
import types
import weakref
from contextlib import contextmanager, nullcontext
from typing import (
    Callable,
    ContextManager,
    Dict,
    Iterator,
    List,
    NamedTuple,
    Optional,
    Tuple,
    cast,
)

import rospy

import smach
from smach_common.introspection.container_watch import CALLBACK_LISTS, is_watched
from smach_common.introspection.introspection_server import IntrospectionServer
from smach_common.node_end import end_quietly
from smach_oracle.forking import in_child
from smach_oracle.msg import (
    ConsoleCommand,
    FailureFrames,
    FailureReplay,
    InterfaceOutput,
    OracleRates,
)
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.identity import WeakIdentityMap, own_mark, remove_identical
from smach_oracle.oracle.scope.scope import Waiting
from smach_oracle.oracle.settings.paths import path_of

from .diagnostics.diagnostics_publisher import DiagnosticsPublisher
from .disk.limits import NO_LIMITS, Limits
from .expert.client import OWN_SERVER, ExpertQueryClient
from .expert.failure_images import TOPIC as FRAMES_TOPIC
from .goal_tracking import track_goals_from_the_start
from .hand.hand_server import HandServer
from .health.health_port import listen_to_health
from .health.health_topics import HealthTopics
from .interfaces.starting import OUTPUT_TOPIC
from .master_watch import start_master_watch
from .parameters import private_flag, private_names, private_number, private_text
from .publishers import EventPublisher, RatesPublisher, rates_of
from .recorder import TrialRecorder, prepare_folder
from .recording.recorder_topics import MessageClass, action_topics, audit_topic, smach_topics
from .replay.failure_replays import FailureReplays, replays_of_node
from .shutdown import ShutdownGuard
from .signals.latch import start_thread
from .stored import prepare_store
from .trials.trials_publisher import TrialsPublisher
from .waiting.service_waiting import ServiceWaiting
from .waiting.work_clock import MachineTimeWaiting, WorkClock, clock_of_work

# for trials to tell their end, before their bags are closed under them. Roslaunch gives a node 15 s
TRIAL_END_WAIT_S = 10.0
CLOSE_S = 1.0


class RecordingOptions(NamedTuple):
    """The options of the process. They override the private parameters of the same names."""

    record: str = ''  # folder, '' where `~record` decides
    record_topics: Tuple[str, ...] = ()


class _RecordingPlan(NamedTuple):
    folder: str
    topics: List[str]
    types: Dict[str, MessageClass]
    keep: Limits = NO_LIMITS


class _BegunTrial(NamedTuple):
    machine: smach.StateMachine  # a top-level one, or one nested in it, by itself
    thread: int


class Attachments:
    """The attachments of one process."""

    def __init__(self) -> None:
        self.options = RecordingOptions()
        # a top-level machine executes within it: what becomes of an error that it begins with
        self.refusing: Callable[[], ContextManager[object]] = nullcontext
        self._lock = threading.RLock()
        self._trials: List[_BegunTrial] = []  # from before they begin to after their last events
        # the machines that are attached to the node, with the paths by which they are shown
        self._on_ros: WeakIdentityMap[OracleContainer, str] = WeakIdentityMap()
        # our servers, by path. Each holds its machine
        self._introspection: Dict[str, IntrospectionServer] = {}
        self._shown: Dict[str, 'weakref.ref[OracleContainer]'] = {}  # by the same paths
        self._expert: Optional[ExpertQueryClient] = None
        self._events: Optional[EventPublisher] = None
        self._rates: Optional[RatesPublisher] = None
        self._told_trials: Optional[TrialsPublisher] = None
        self._hand: Optional[HandServer] = None
        self._diagnostics: Optional[DiagnosticsPublisher] = None
        # bound once: a machine listens again where it is given another one
        self._listen_to_health = functools.partial(listen_to_health, HealthTopics())
        self._recorder: Optional[TrialRecorder] = None
        self._without_node: Optional[TrialRecorder] = None  # of trials from before the node
        self._recorder_wanted = True
        self._wants_introspection = True
        self._replays: Optional[FailureReplays] = None
        self._node_started = False
        # of the work of all trials, under simulated time
        self.work_clock: Optional[WorkClock] = None
        self.guard: Optional[ShutdownGuard] = None  # its signals wait for the trials
        self.has_parents_node = False  # a forked child cannot use it
        in_child(self._let_go)

    def _let_go(self) -> None:
        """Leave a child without what its parent has, and the node to its parent."""
        self.options, self._recorder_wanted = RecordingOptions(), True
        self._recorder = self._without_node = None
        self.refusing, self.guard = nullcontext, None
        self._lock = threading.RLock()
        for server in self._introspection.values():
            server.leave_to_parent()
        self._on_ros.clear()
        self._introspection.clear()
        self._shown.clear()
        self._expert = self._events = self._rates = self._told_trials = None
        self._hand = self._diagnostics = self._replays = None
        self._node_started, self.work_clock = False, None
        self.has_parents_node = rospy.core.is_initialized()
        leave_node_to_parent()

    def has(self, machine: OracleContainer) -> bool:
        """Whether a machine is attached to the node."""
        return machine in self._on_ros

    def shows(self, machine: OracleContainer) -> bool:
        """Whether a machine is attached, and shown by the path that it has now.

        It may have another name since. Another machine of the path may have run.
        """
        path = oracle_of(machine).path
        shown = self._shown.get(path)
        return self._on_ros.get(machine) == path and (shown is None or shown() is machine)

    @contextmanager
    def trial(self, machine: smach.StateMachine) -> Iterator[None]:
        """Keep the bags open until the trial has told its end.

        While the handler of a signal waits, none begins, except within a state of one that runs.
        """
        trial = _BegunTrial(machine, threading.get_ident())
        is_inner = any(each.thread == trial.thread for each in list(self._trials))
        self._trials.append(trial)  # first: a signal from here on preempts it
        try:
            if not is_inner and self.guard is not None and self.guard.holds():
                self._leave(trial)
                self.guard.wait_for_handler()
                self._trials.append(trial)
            yield
        finally:
            self._leave(trial)
            if (
                not is_inner
                and self.guard is not None
                and (threading.current_thread() is threading.main_thread())
            ):
                self.guard.wait_for_handler()  # others may still run

    def _leave(self, trial: _BegunTrial) -> None:
        if remove_identical(self._trials, trial) and not self._trials and self.guard is not None:
            self.guard.trials_ended()

    def after_preempt_s(self) -> float:
        """Return for how long the machines that run may go on after they are preempted.

        It takes no lock: a signal's handler asks.
        """
        return max(
            (oracle_of(each.machine).settings.after_preempt_s for each in list(self._trials)),
            default=0.0,
        )

    def attach(self, machine: OracleContainer) -> None:
        """Attach a top-level machine, and show it by its path.

        Outside a ROS node it only records, where that is asked for.

        :raises OSError: where the folder for the bags cannot be made or written.
        """
        with self._lock:
            if self.has(machine):
                self._show(machine)
                return
            node = rospy.core.is_initialized() and not rospy.core.is_shutdown_requested()
            plan = self._plan_recording(node)  # first, since it may raise
            if oracle_of(machine).settings.checkpoint:
                prepare_store(node)
            if node:
                self._start_node()
                self._attach_to_node(machine)
            # last: topics that are there already are recorded from the first trial on
            self._record(machine, plan)
            if self._replays is not None:
                self._replays.watch(oracle_of(machine).events)  # behind the recorder

    def begins(self, machine: OracleContainer) -> None:
        """Have operators' commands reach a machine, as its next trial begins."""
        if self._hand is not None and self.has(machine):
            self._hand.begins(machine)

    def detach(self, machine: OracleContainer) -> None:
        """Let go of a top-level machine that has ended and is about to come out of its oracle.

        Where it is wrapped again, its first execute attaches it again.
        """
        with self._lock:
            self._hide(machine, self._on_ros.get(machine) or '')
            self._on_ros.forget(machine)
            if self._rates is not None:
                self._rates.forget(machine)
            if self._hand is not None:
                self._hand.forget(machine)
            if self._diagnostics is not None:
                self._diagnostics.forget(machine)

    def preempt(self) -> None:
        """Ask every machine that runs, or is about to, to stop, as the process goes down.

        Its question, if any, is taken back with it. It is open again where the trial is stored.
        """
        machines = [each.machine for each in list(self._trials)]
        for machine in machines:
            oracle_of(machine).note_shutdown()
        for machine in machines:
            machine.request_preempt()

    def close(self, timeout_s: float) -> None:
        """Close the bags, also of trials that have not ended. Any thread, any number of times."""
        for recorder in (self._recorder, self._without_node):
            if recorder is not None:
                recorder.close(timeout_s)

    def _start_node(self) -> None:
        if self._node_started:
            return
        self._node_started = True
        self.work_clock = clock_of_work(private_text('pass_time'))
        start_master_watch()
        end_quietly()
        log_through_rospy()
        track_goals_from_the_start()
        rospy.on_shutdown(self._on_shutdown)
        self._events = EventPublisher()
        self._rates = RatesPublisher()
        self._told_trials = TrialsPublisher()
        self._hand = HandServer()
        self._replays = replays_of_node(self._put_into_bag)
        if private_flag('diagnostics', True):
            self._diagnostics = DiagnosticsPublisher(
                rospy.resolve_name(private_text('expert_query_server') or OWN_SERVER)
            )

    def _attach_to_node(self, machine: OracleContainer) -> None:
        self._wants_introspection = private_flag('introspection', True)  # first, as it may raise
        oracle = oracle_of(machine)
        if oracle.recovers and oracle.expert is None:
            oracle.expert = self._shared_expert()
        oracle.listen_to_health(self._listen_to_health)
        self._let_time_pass(machine)
        if self._events is not None:
            oracle.events.observers.append(self._events)
        if self._rates is not None:
            self._rates.watch(machine)
        self._show(machine)
        if self._hand is not None:
            self._hand.watch(machine)
        if self._diagnostics is not None:
            self._diagnostics.watch(machine)

    def _show(self, machine: OracleContainer) -> None:
        """Show a machine by its path, and not by an earlier one."""
        oracle, before = oracle_of(machine), self._on_ros.get(machine)
        if self._told_trials is not None:
            self._told_trials.watch(oracle.path, oracle.events)
        if before is not None:
            self._hide(machine, before)
        if self._wants_introspection and not has_introspection(machine):
            self._introspect(machine)
        self._on_ros[machine] = oracle.path

    def _hide(self, machine: OracleContainer, path: str) -> None:
        """Stop the introspection of a machine by this path."""
        shown = self._shown.get(path)
        if shown is not None and shown() is machine:
            del self._shown[path]
            self._introspection.pop(path).stop()

    def _let_time_pass(self, machine: OracleContainer) -> None:
        """Have waits and work take the time of the world, where there is a simulated one."""
        oracle, clock = oracle_of(machine), self.work_clock
        pass_time = private_text('pass_time')
        by_itself = Waiting() if clock is None else MachineTimeWaiting(clock)
        if clock is not None:
            oracle.count_work_by(clock)
        if pass_time:
            oracle.waiting = ServiceWaiting(rospy.resolve_name(pass_time), by_itself)
        elif type(oracle.waiting) is Waiting:  # else the program has its own
            oracle.waiting = by_itself

    def _introspect(self, machine: OracleContainer) -> None:
        """Show the machine in place of an earlier one of its name.

        A script may build a machine for each trial.
        """
        path = oracle_of(machine).path
        earlier = self._introspection.pop(path, None)
        if earlier is not None:
            earlier.stop()
        self._introspection[path] = start_introspection(machine)
        self._shown[path] = weakref.ref(machine)

    def _shared_expert(self) -> ExpertQueryClient:
        if self._expert is None:
            self._expert = ExpertQueryClient(
                private_text('expert_query_server'), cameras=private_names('failure_cameras')
            )
        return self._expert

    def _plan_recording(self, node: bool) -> Optional[_RecordingPlan]:
        """Folder and topics for a recorder, or None where one is there or none is wanted.

        One that was made without a node knows no topics. Another takes its place once there is one.
        """
        if not self._recorder_wanted or (self._recorder is not None and not node):
            return None
        folder = self.options.record or (private_text('record') if node else '')
        plan = self._plan_for(folder, node) if folder else None
        self._recorder_wanted = not node  # without a node, `~record` may yet come
        return plan

    def _plan_for(self, folder: str, node: bool) -> _RecordingPlan:
        folder = os.path.abspath(path_of(folder))
        prepare_folder(folder)
        topics = list(self.options.record_topics)
        if node:
            topics += private_names('record_topics')
            topics += smach_topics(rospy.get_name()) + action_topics(
                rospy.resolve_name('~expert_query')
            )
            audit = audit_topic(
                rospy.resolve_name(private_text('expert_query_server') or OWN_SERVER)
            )
            types = {audit: ConsoleCommand, rospy.resolve_name(OUTPUT_TOPIC): InterfaceOutput}
            if private_names('failure_cameras'):
                types[rospy.resolve_name(FRAMES_TOPIC)] = FailureFrames
            keep = Limits(private_number('keep_days'), private_number('keep_gb'))
            return _RecordingPlan(folder, topics + list(types), types, keep)
        return _RecordingPlan(folder, topics, {})

    def _record(self, machine: OracleContainer, plan: Optional[_RecordingPlan]) -> None:
        if plan is not None:
            self._without_node, self._recorder = (
                self._recorder,
                TrialRecorder(plan.folder, plan.topics, types=plan.types, keep=plan.keep),
            )
        if self._recorder is not None:
            if self._without_node is not None:  # it goes on with trials that run
                self._without_node.detach(oracle_of(machine).events)
            if self._diagnostics is not None:
                self._diagnostics.listen_to_recorder()
            self._recorder.attach(
                oracle_of(machine).events, {'~oracle/rates': _snapshot_of_rates(machine)}
            )

    def _put_into_bag(self, trial_id: str, topic: str, message: FailureReplay) -> None:
        if self._recorder is not None:
            self._recorder.put(trial_id, topic, message)

    def _on_shutdown(self) -> None:
        """rospy's shutdown hook, often run inside a signal handler in the machine's own thread.

        So it must not wait for a lock that this thread may hold: others do the work, and it waits
        for them only a little, so that the preempt comes before rospy goes down.
        """
        start_thread(self.preempt).wait(0.1)
        start_thread(self._close_when_ended)

    def _close_when_ended(self) -> None:
        """Close the bags once the trials have told their end, or do not end at all."""
        until = time.monotonic() + TRIAL_END_WAIT_S
        while self._trials and time.monotonic() < until:
            time.sleep(0.02)
        self.close(CLOSE_S)


def leave_node_to_parent() -> None:
    """Let a forked child end without closing what its parent's node has open.

    rospy would close the connections under the parent, and unregister its topics.
    """
    core = rospy.core
    hooks = (
        (core._client_shutdown_hooks, ('smach_oracle.',)),
        (core._preshutdown_hooks, ('rospy.', 'rosgraph.')),
        (core._shutdown_hooks, ('rospy.', 'rosgraph.')),
    )
    for registered, modules in hooks:
        registered[:] = [
            each
            for each in registered
            if not str(getattr(each, '__module__', '')).startswith(modules)
        ]
    del core._shutdown_threads[:]
    if _bare_loggers:
        smach.set_loggers(*_bare_loggers)


_bare_loggers: List[Callable[..., None]] = []  # of SMACH, where rospy's are in their place


def log_through_rospy() -> None:
    """Hand rospy's loggers to SMACH, as `import smach_ros` does.

    So the levels of the node's standard services apply. Loggers of the program's own stay.
    """
    if getattr(smach.loginfo, '__module__', '').split('.')[0] == 'smach':
        _bare_loggers[:] = [smach.loginfo, smach.logwarn, smach.logdebug, smach.logerr]
        smach.set_loggers(rospy.loginfo, rospy.logwarn, rospy.logdebug, rospy.logerr)


def has_introspection(machine: OracleContainer) -> bool:
    """Whether a running IntrospectionServer, ours or upstream's, already listens to this machine.

    Told by its callbacks: the server of a script that was made before the machine first ran.
    """
    callbacks = [
        each[0]
        for name in CALLBACK_LISTS
        for each in cast('List[Tuple[object, ...]]', own_mark(machine, name) or [])
    ]
    return is_watched(machine) or any(_is_running_proxy(callback) for callback in callbacks)


def _is_running_proxy(callback: object) -> bool:
    """Whether this is a method of upstream's proxy of a container, and its server still runs."""
    if not isinstance(callback, types.MethodType):
        return False
    owner = callback.__self__
    return (
        type(owner).__module__ == 'smach_ros.introspection'
        and own_mark(owner, '_keep_running') is not False
    )


def start_introspection(machine: OracleContainer) -> IntrospectionServer:
    """Show the machine, its ORACLE and its nested ones under `<node>/smach/container_*`."""
    server = IntrospectionServer(rospy.get_name(), machine, '/' + oracle_of(machine).path)
    server.start()
    return server


def _snapshot_of_rates(machine: OracleContainer) -> Callable[[], Optional[OracleRates]]:
    reference = weakref.ref(machine)

    def take() -> Optional[OracleRates]:
        alive = reference()
        return None if alive is None else rates_of(alive)

    return take


_attachments = Attachments()


def attachments() -> Attachments:
    """Return the attachments of this process."""
    return _attachments


def configure(options: RecordingOptions) -> None:
    """Set the options of this process, before the first machine runs."""
    _attachments.options = options
