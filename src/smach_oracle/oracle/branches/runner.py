"""Runs branches: what a Concurrence or an Iterator executes in the place of its states."""

from typing import Any, Dict, Optional, Protocol, Tuple

import smach

from ..machine.execution import Execution, runs_around
from ..machine.tree_node import marked_node
from ..recovery.verdict import outcome_of_early_end
from ..smach_private import state_ended
from .item_userdata import ItemUserdata
from .items import TrackedItems

COULD_NOT = 'Could not execute state '  # how a machine begins to pass on what a state has raised
End = Tuple[object, Optional[Exception]]  # of a state: its outcome, and what it has raised


class ItemPort(Protocol):
    """The Iterator around, as a runner sees it: it wants to know how its items end."""

    container: Any
    tracked: Optional[TrackedItems]
    item_userdata: ItemUserdata

    def begin_item(self) -> None:
        """Note that an item begins."""

    def end_item(self, outcome: object) -> None:
        """Note with which outcome of its state an item ends."""

    def finishes(self, outcome: str) -> bool:
        """Whether an item is finished by an outcome of its state."""


class Runner(Protocol):
    """Executes a state in its place, as the engine's hook wants it."""

    def execute(self, userdata: smach.UserData) -> object:
        """Execute the state, and return its outcome."""

    def request_preempt(self) -> None:
        """Preempt it."""

    def preempt_requested(self) -> bool:
        """Whether a request was not serviced."""

    def recall_preempt(self) -> None:
        """Take a request back."""

    def is_of(self, state: smach.State) -> bool:
        """Whether it executes this state."""

    def retire(self) -> None:
        """Note that an execution of the container is over."""


class ItemRunner:
    """Executes the state of an Iterator that has no oracle of its own there, such as a machine."""

    def __init__(self, state: smach.State, item: ItemPort) -> None:
        self._state = state
        self._item = item

    def execute(self, userdata: smach.UserData) -> object:
        """Execute it, and return its outcome."""
        self._item.begin_item()
        outcome = self._state.execute(userdata)
        self._item.end_item(outcome)
        return outcome

    def request_preempt(self) -> None:
        """Preempt it."""
        self._state.request_preempt()

    def preempt_requested(self) -> bool:
        """Whether a request was not serviced."""
        return bool(self._state.preempt_requested())

    def recall_preempt(self) -> None:
        """Take a request back."""
        self._state.recall_preempt()

    def is_of(self, state: smach.State) -> bool:
        """Whether it executes this state."""
        return state is self._state

    def retire(self) -> None:
        """Note that an execution of the container is over."""


class BranchRunner:
    """Executes a branch through its oracle, for one execution of the Concurrence or Iterator.

    A branch that ends plainly costs what `execute` shows, as a plain success of a machine does in
    container.py. All else goes by `run_branch`.
    """

    def __init__(
        self, state: smach.State, machine: smach.StateMachine, item: Optional[ItemPort] = None
    ) -> None:
        """`machine`: the branch's. `item`: the Iterator, None in a Concurrence."""
        self._state = state
        self._machine = machine
        self._item = item
        self._tracked = None if item is None else item.tracked
        self._is_under_way = False
        self._finishes: Dict[object, bool] = {}  # whether an item is finished, by outcome
        node = self._node = marked_node(machine)
        self._label = node.site.label
        self._record = node.records.by_label.get(self._label)
        self._observers = node.events.observers
        self._control = node.tree.control
        self._early_end = node.tree.early_end
        self._abandoned = node.tree.workers.abandoned
        # the same for all items
        self._is_watched = bool(
            node.in_force.limits_autonomy() or node.tree.resumed.concerns(node) or runs_around(node)
        )

    def execute(self, userdata: smach.UserData) -> object:
        """Execute the state, and recover where it fails. Return its outcome."""
        state, machine, node, item = self._state, self._machine, self._node, self._item
        if self._is_under_way:
            return state.execute(userdata)
        machine._preempt_requested = False
        self._is_under_way = True  # from now on the machine takes the requests
        try:
            record = self._record
            if (
                record is None
                or record.special
                or self._is_watched
                or self._observers
                or self._abandoned
                or self._control.is_set
                or self._early_end.why is not None
                or node.execution.departure is not None
                or node.execution.unrecovered
                or state.preempt_requested()
            ):
                return self._run(None)
            record.snapshot = snapshot = machine.userdata._data.copy()
            if item is not None:
                item.item_userdata.at_item = snapshot
            if machine._current_state is not state or not machine._is_running:
                self._be_current()
                if machine._preempt_requested:  # nobody has passed that on
                    return self._run(None)
            try:
                outcome = state.execute(userdata)
            except Exception as err:
                return self._run((None, err))
            try:
                edge = record.fast[outcome]
            except (KeyError, TypeError):  # seen for the first time, or no outcome at all
                return self._run((outcome, None))
            if (
                machine._preempt_requested
                or self._control.is_set
                or self._early_end.is_near
                or node.execution.departure is not None
                or smach.is_shutdown()
            ):
                return self._run((outcome, None))
            edge.count += 1
            node.records.history.visited(edge.visit, record.has_preconditions)
            record.snapshot = None
            tracked = self._tracked
            if item is None or tracked is None:
                self._rest()
            else:
                finishes = self._finishes.get(outcome)
                if finishes is None:
                    finishes = self._finishes[outcome] = item.finishes(str(outcome))
                tracked.is_finished = finishes and not item.container._preempt_requested
            return outcome
        except (SystemExit, KeyboardInterrupt) as err:
            self._early_end.of_program = err
            node.records.drop_snapshots()
            self._rest()
            raise
        finally:
            self._is_under_way = False

    def _be_current(self) -> None:
        """Make the state the current one, so that a preempt request of the machine reaches it."""
        machine = self._machine
        machine._current_label, machine._current_state = self._label, self._state
        machine._is_running = True

    def is_of(self, state: smach.State) -> bool:
        """Whether it executes this state."""
        return state is self._state

    def retire(self) -> None:
        """Note that an execution of the container is over: another thread may have one, too."""
        if not self._is_under_way:
            self._rest()

    def _rest(self) -> None:
        self._machine._is_running = False
        self._machine._current_state = None

    def _run(self, end: Optional[End]) -> object:
        """Execute the state, and go on behind its end, which is given where it has ended."""
        item, machine = self._item, self._machine
        if end is None:
            if self._state.preempt_requested():
                machine._preempt_requested = True
            if item is not None:
                item.begin_item()
        try:
            outcome = run_branch(machine, end)
        finally:
            self._rest()
            machine._preempted_label = machine._preempted_state = None
            self._record = self._node.records.by_label.get(self._label)
        if item is not None:
            item.end_item(outcome)
        return outcome

    def request_preempt(self) -> None:
        """Preempt the state, or its recovery."""
        if not self._is_under_way:
            self._state.request_preempt()
        if self._is_under_way:  # it may have begun meanwhile, without a look at the request
            self._machine.request_preempt()

    def preempt_requested(self) -> bool:
        """Whether a request was not serviced."""
        return bool(self._state.preempt_requested() or self._machine._preempt_requested)

    def recall_preempt(self) -> None:
        """Take a request back."""
        self._state.recall_preempt()
        self._machine._preempt_requested = False


def run_branch(machine: smach.StateMachine, end: Optional[End]) -> Optional[str]:
    """Execute a branch, through its oracle where it fails, and return the outcome of its state.

    `end`: of the state, where it was executed already. It raises what the state has raised where
    its oracle gives up.
    """
    node = marked_node(machine)
    run = Execution(node, is_whole=False)
    if not run.look_around() and end is None:
        smach.logwarn(
            '{}: a branch does not begin, as {}'.format(node.path, node.why_left_behind())
        )
        return outcome_of_early_end(node, None)
    outcome = node.tree.resumed.take_outcome(node) if end is None else None
    if outcome is not None:
        return outcome
    if end is not None:
        run.begin_at_the_end()
    error: Optional[BaseException] = None
    run.begin()
    try:
        return outcome_of_early_end(node, _step_to_end(machine, end))
    except smach.InvalidUserCodeError as err:
        error = raised = err
    except BaseException as err:
        error = err
        raise
    finally:
        run.end(None, error)
    if raised.__cause__ is not None and str(raised).startswith(COULD_NOT):
        raise raised.__cause__  # as bare: the container says what state it was
    raise raised


def _step_to_end(machine: smach.StateMachine, end: Optional[End]) -> Optional[str]:
    with machine._state_transitioning_lock:
        if end is None:
            machine._is_running = True
            machine._preempted_label = machine._preempted_state = None
            machine._set_current_state(machine._initial_state_label)
            outcome = machine._update_once()
        else:
            outcome = state_ended(machine, *end)
        while outcome is None and machine._is_running and not smach.is_shutdown():
            outcome = machine._update_once()
        return outcome
