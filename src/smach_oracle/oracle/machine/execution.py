"""One execution of a container: what is true from its begin to its end, and no longer."""

from typing import TYPE_CHECKING, Dict, Iterable, Optional, Protocol, Tuple

import smach
from smach_common.foreign import error_text

from ..records.events import NO_OUTCOME, EventKind, in_event
from ..scope.scope import Reason, Scope, scopes_of_thread
from ..smach_private import Labels, current_label_of, initial_label_of, set_executing, states_of

if TYPE_CHECKING:
    from .tree_node import TreeNode


class DeparturePort(Protocol):
    """A verdict that leaves containers for a level above (`execution.departure`).

    `failed_path`: that of the failed state. `is_decided_again`: after a crash on the way a policy
    comes to it again.
    """

    failed_path: str
    is_decided_again: bool

    @property
    def arrives_at(self) -> 'TreeNode':
        """The level to which it leads."""


class Execution:
    """One execution of a container: the present one, or the latest.

    `runs_around`: the watched executions inside which it takes place. `departure`: the verdict from
    below, or from here, that ends the present state. `unrecovered`: whether the oracle has given
    up, and so ended it. `was_preempted`: whether a preempt was told of it. `was_stopped`: whether
    the program has stopped a state of it alone.

    The thread of the container calls its methods, except `depart_by`, `start_of` and
    `forget_unrecovered`, which belong to the threads of other containers.
    """

    # of one that has just begun: many end before any of it is written
    runs_around: Tuple[Scope, ...] = ()
    departure: Optional[DeparturePort] = None
    unrecovered = False
    failures = 0  # so far, without those that the author has foreseen
    starts_in = ''  # '': its initial state
    starts_below: Dict[int, str] = {}  # by the id of a node in the present state. Never written to
    _is_preempt_told = was_preempted = was_stopped = False

    def __init__(self, node: 'TreeNode') -> None:
        self._node = node

    def renew(self) -> None:
        """Begin once more, as an engine may do. What is around it stays."""
        self.departure = None
        self.unrecovered = False
        self.failures = 0
        self.starts_in = ''
        self.starts_below = {}
        self._is_preempt_told = False

    # -- what is around it

    def look_around(self) -> bool:
        """Find out inside which executions this one is about to begin.

        Return whether it still may.
        """
        runs = self.runs_around = runs_around(self._node)
        for run in runs:
            run.tell(self._node.engine)
        return not self.is_left_behind()

    def is_left_behind(self) -> bool:
        """Whether the container is to stop without an outcome, as nobody waits for one.

        It executes inside a state that was abandoned, or its trial has ended early.
        """
        if self._node.tree.scope.cancelled is not None:  # it lies in no other scope
            return True
        runs = self.runs_around
        return bool(runs) and any(run.told is not None for run in runs)

    def runs_around_below(self, labels: Labels) -> Tuple[Scope, ...]:
        """Return `runs_around` of what takes place inside a state of the container.

        :param labels: lead there. Without any it takes place in the container itself.
        """
        if not labels:
            return self.runs_around
        state = states_of(self._node.machine)[labels[0]]
        run = self._node.tree.workers.under_way.get(id(state))
        return self.runs_around if run is None else (*self.runs_around, run)

    @property
    def scope_around(self) -> Scope:
        """Return the scope of what goes on around it: its trial, and states with a time limit."""
        return Scope(self._node.tree.scope, *self.runs_around)

    @property
    def scope(self) -> Scope:
        """Return the scope of what goes on in it, which a preempt of the container ends."""
        return Scope(self._node.tree.scope, *self.runs_around, look=self._look_for_preempt)

    def _look_for_preempt(self) -> Optional[Reason]:
        return Reason.PREEMPTED if self._node.machine.preempt_requested() else None

    # -- its begin and its end

    def begin(self) -> None:
        """Be the present execution of the container from now on."""
        node = self._node
        node.begin_execution(self)
        self.starts_in = node.start_from_above(take=True)
        if node.events.observers:
            entry = node.tree.resumed.entry_of(node.records)
            begins_in = self.starts_in if entry is None else entry.label
            state = begins_in or initial_label_of(node.machine)
            node.emit(EventKind.CONTAINER_START, state=state)

    def is_led(self) -> bool:
        """Whether it begins elsewhere than in its initial state."""
        node = self._node
        if not (self.starts_in or node.tree.is_resumed):
            return False
        return (
            self.starts_in in states_of(node.machine)
            or node.tree.resumed.entry_of(node.records) is not None
        )

    def end(self, outcome: Optional[str], error: Optional[BaseException]) -> None:
        """Be over, with an outcome or an error, or with neither."""
        node = self._node
        if error is not None:
            # also after what no engine cleans up after, such as Ctrl-C
            set_executing(node.machine, False)
            if ends_program(error):
                node.tree.early_end.of_program = error
        dropped = node.tree.control.leave(node.engine, node)
        if dropped is not None:
            node.warn('has ended before it could be sent to {}'.format(dropped.named()))
        node.records.streaks.end_execution()
        if node.events.observers and node.site.is_container:
            why = why_no_outcome(outcome, error)
            node.emit(EventKind.CONTAINER_END, outcome=in_event(outcome), text=why)
        self.runs_around = ()
        self.failures = 0
        node.records.drop_snapshots()

    def begin_branch(self, has_ended: bool) -> bool:
        """Begin as that of a branch, which its Concurrence or Iterator may execute several times.

        Return whether it still may.

        :param has_ended: the state was executed already. A verdict that has come is for this one.
        """
        if has_ended:
            self._is_preempt_told = False
        else:
            self.renew()
        self._node.engine.begin_execution()
        return self.look_around()

    # -- where the containers in the present state begin

    def start_below(self, places: Iterable[Tuple['TreeNode', str]]) -> None:
        """Have containers in the present state begin in these states, each once. None: no more."""
        self.starts_below = {id(node): label for node, label in places}

    def start_of(self, node: 'TreeNode', take: bool) -> str:
        """Return the state in which a container below is to begin, '' where nobody says so."""
        starts = self.starts_below
        return starts.pop(id(node), '') if take else starts.get(id(node), '')

    # -- how it goes on

    def depart_by(self, departure: Optional[DeparturePort]) -> None:
        """Have the present state end by a verdict. To be called under `departures_lock`."""
        self.departure = departure

    def give_up(self) -> None:
        """Note that the oracle ends the container: the failure has had its account."""
        self.unrecovered = True

    def forget_unrecovered(self) -> None:
        """Note that a container above goes on behind that."""
        self.unrecovered = False

    def tell_preempt(self) -> None:
        """Emit PREEMPT, once for each request."""
        if not self._is_preempt_told:
            self._is_preempt_told = self.was_preempted = True
            self._node.emit(EventKind.PREEMPT, state=current_label_of(self._node.machine))

    def note_no_preempt(self) -> None:
        """Note that a request was serviced: the next one is another."""
        self._is_preempt_told = False

    def __reduce__(self) -> Tuple[object, ...]:
        """A copied or pickled machine is not being executed."""
        return Execution, (self._node,)


def runs_around(node: 'TreeNode') -> Tuple[Scope, ...]:
    """Return the watched executions inside which a container would execute now.

    Those of its thread, and, as a Concurrence has threads of its own, those of the states above it.
    """
    runs, under_way = scopes_of_thread(), node.tree.workers.under_way
    while under_way and node.parent is not None:
        run = under_way.get(id(states_of(node.parent.machine).get(node.labels_from_parent[0])))
        if run is not None:
            runs += (run,)
        node = node.parent
    return runs


def why_no_outcome(outcome: object, error: Optional[BaseException]) -> str:
    """Return why an execution has no outcome, '' where it has one."""
    if error is not None:
        return error_text(error)
    return NO_OUTCOME if outcome is None else ''


# rospy raises it in a sleep during which /clock jumps back, and derives it from KeyboardInterrupt
_CLOCK_JUMPED = 'ROSTimeMovedBackwardsException'


def ends_program(error: Optional[BaseException]) -> bool:
    """Whether sys.exit or Ctrl-C is behind an error: the program is to end, and nothing failed.

    In a thread of a Concurrence both become an error of SMACH, which has them as its cause.
    """
    while isinstance(error, (smach.InvalidStateError, smach.InvalidUserCodeError)):
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    if any(each.__name__ == _CLOCK_JUMPED for each in type(error).__mro__):
        return False
    return isinstance(error, (SystemExit, KeyboardInterrupt))
