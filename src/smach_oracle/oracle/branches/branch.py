"""A branch: a plain state of a Concurrence or an Iterator, under an oracle of its own."""

import threading
import traceback
from typing import Dict, Mapping, Optional, Protocol, Sequence, Tuple, cast

import smach

from ..machine.execution import ends_program, runs_around
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..recovery.verdict import outcome_of_early_end
from ..smach_private import Transitions, data_of, remapping_of, state_ended, step_once

COULD_NOT = 'Could not execute state '  # how a machine begins to pass on what a state has raised
End = Tuple[object, Optional[Exception]]  # of a state: its outcome, and what it has raised


class ItemPort(Protocol):
    """The Iterator around a branch."""

    at_item: Optional[Dict[str, object]]  # the userdata as the item under way began

    def begin_item(self) -> None:
        """Note that an item begins."""


class Branch(smach.Container):
    """Executes a plain state in its place, and is the container that its oracle recovers.

    The Concurrence or Iterator executes it in place of the state. To the oracle it is a container
    of that one state, whose outcomes are the state's own. Its userdata is that of the Concurrence
    or Iterator itself, so that what a branch writes is seen by the others at once.

    A branch that ends plainly costs what `execute` shows, as a plain success of a machine does in
    container.py. All else goes by `_run`.
    """

    _oracle: TreeNode
    _constants: Dict[str, Mapping[str, object]] = {}  # none, never written
    _pause_requested = False
    _is_preempt_passed_on = False

    def __init__(self, label: str, is_alone: bool) -> None:
        """`is_alone`: whether no other branch runs at the same time, as in an Iterator."""
        smach.Container.__init__(self, outcomes=[])
        # the userdata may be written by others while the state, or its recovery, runs
        self.shares_userdata = not is_alone
        # the state gets the userdata itself, as an Iterator hands it over
        self.hands_on_userdata = is_alone
        self._initial_state_label = label
        self._states: Dict[str, smach.State] = {}
        self._transitions: Dict[str, Transitions] = {}
        self._remappings: Dict[str, Mapping[str, str]] = {}
        self._be_at_rest()

    def _be_at_rest(self) -> None:
        self._state_transitioning_lock = threading.RLock()
        self._execution_number = 1  # of the container
        self._under_way_in = 0  # that execution, 0 while it is not under way
        self._preempt_requested = False
        self._item: Optional[ItemPort] = None
        self._record: Optional[StateRecord] = None
        self._be_idle()

    def _be_idle(self) -> None:
        self._is_running = False
        self._set_current_state(None)
        self._preempted_state: Optional[smach.State] = None

    def take(self, container: smach.Container, state: smach.State) -> None:
        """Have this state of the Concurrence or Iterator, with the outcomes that it has now."""
        label, outcomes = self._initial_state_label, state.get_registered_outcomes()
        self.userdata = container.userdata
        self.state = self._states[label] = state
        self._remappings[label] = remapping_of(container, label)  # none in an Iterator
        self._outcomes = set(outcomes)
        self._transitions[label] = dict.fromkeys(outcomes)

    def begin(self, item: Optional[ItemPort]) -> None:
        """Begin an execution of the Concurrence, for which there is no `item`, or Iterator."""
        node = self._oracle
        self._item = item
        # a thread of an earlier execution may have been left behind in it
        self._execution_number += 1
        # the same for all items
        self._is_watched = bool(node.in_force.limits_autonomy or runs_around(node))
        self._find_record()

    def _find_record(self) -> None:
        by_label = self._oracle.records.by_label
        self._record = None if self._is_watched else by_label.get(self._initial_state_label)

    def _is_under_way(self) -> bool:
        return self._under_way_in == self._execution_number

    def end(self) -> None:
        """Note that an execution of the container is over: another thread may have one, too."""
        if not self._is_under_way():
            self._be_idle()

    def execute(self, userdata: smach.UserData) -> object:
        """Execute the state, and recover where it fails. Return its outcome."""
        state, number = self.state, self._execution_number
        if self._under_way_in == number:  # in another thread
            return state.execute(userdata)
        self._preempt_requested = False
        self._under_way_in = number  # from now on it takes the requests itself
        try:
            record, node = self._record, self._oracle
            tree, execution = node.tree, node.execution
            control, early_end = tree.control, tree.early_end
            if (
                record is None
                or record.special
                or node.events.observers
                or tree.workers.abandoned
                or control.is_set
                or early_end.why is not None
                or execution.departure is not None
                or execution.unrecovered
                or state.preempt_requested()
            ):
                return self._run(None)
            record.snapshot = snapshot = data_of(self.userdata).copy()
            if self._item is not None:
                self._item.at_item = snapshot
            if self._current_state is not state:
                # a request reaches it from now on
                self._set_current_state(record.label)
                self._is_running = True
                if self._preempt_requested:  # nobody has passed that on
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
                self._preempt_requested
                or control.is_set
                or early_end.is_near()
                or execution.departure is not None
                or smach.is_shutdown()
            ):
                return self._run((outcome, None))
            edge.count += 1
            node.records.history.visits.append(edge.visit)
            record.snapshot = None
            if self._item is None:
                self._be_idle()
            return outcome
        except (SystemExit, KeyboardInterrupt) as err:
            if ends_program(err):
                self._oracle.tree.early_end.of_program = err
            self._oracle.records.drop_snapshots()
            self._be_idle()
            raise
        finally:
            if self._under_way_in == number:
                self._under_way_in = 0

    def _run(self, end: Optional[End]) -> Optional[str]:
        """Execute the state, through the oracle where it fails, and return its outcome.

        `end`: of the state, where it was executed already. It raises what the state has raised
        where the oracle gives up.
        """
        node = self._oracle
        if end is None:
            if self.state.preempt_requested():
                self._preempt_requested = True
            if self._item is not None:
                self._item.begin_item()
        error: Optional[BaseException] = None
        try:
            if not node.execution.begin_branch(has_ended=end is not None):
                smach.logwarn(
                    '{}: a branch does not begin, as {}'.format(node.path, node.why_left_behind())
                )
                return outcome_of_early_end(node)
            outcome = node.tree.resumed.take_outcome(node.records) if end is None else None
            if outcome is None:
                outcome = self._step_to_end(end)
            return outcome_of_early_end(node) if outcome is None else outcome
        except smach.InvalidUserCodeError as err:
            error = raised = err
        except BaseException as err:
            error = err
            raise
        finally:
            node.execution.end(None, error)
            self._be_idle()
            self._find_record()
        if raised.__cause__ is not None and str(raised).startswith(COULD_NOT):
            raise raised.__cause__  # as bare: the container says what state it was
        raise raised

    def _step_to_end(self, end: Optional[End]) -> Optional[str]:
        """Step as any wrapped machine does."""
        step, machine = self._oracle.tree.container_class, cast('smach.StateMachine', self)
        with self._state_transitioning_lock:
            self._is_running = True
            if end is None:
                self._set_current_state(self._initial_state_label)
                outcome = step_once(step, machine)
            else:
                outcome = state_ended(step, machine, *end)
            while outcome is None and self._is_running and not smach.is_shutdown():
                outcome = step_once(step, machine)
            return outcome

    # -- preempt requests

    def request_preempt(self) -> None:
        """Preempt the state, or its recovery."""
        if not self._is_under_way():
            self.state.request_preempt()
        if self._is_under_way():  # it may have begun meanwhile, without a look at the request
            self._is_preempt_passed_on = False
            self._preempt_requested = True
            with self._state_transitioning_lock:
                if not self._is_preempt_passed_on and self._current_state is not None:
                    self._preempt_requested = True
                    self._pass_preempt_on(self._current_state)
            self._oracle.tree.scope.wake()

    def _pass_preempt_on(self, state: smach.State) -> None:
        """Preempt the current state, unless it was asked before and has not obeyed yet."""
        asked = self._preempted_state
        if asked is state and state.preempt_requested():
            return
        if asked is not None:
            asked.recall_preempt()
        self._preempted_state = state
        self._is_preempt_passed_on = True
        try:
            state.request_preempt()
        except Exception:
            smach.logerr(
                'Preempting state {!r} raised:\n{}'.format(
                    self._current_label, traceback.format_exc()
                )
            )

    def recall_preempt(self) -> None:
        """Take a request back."""
        self.state.recall_preempt()
        smach.Container.recall_preempt(self)

    # -- the container of one state

    def get_children(self) -> Dict[str, smach.State]:
        """Return the state, and ORACLE."""
        return self._states

    def is_running(self) -> bool:
        """Whether it is being executed."""
        return self._is_running

    def set_initial_state(self, initial_states: Sequence[str], userdata: object = None) -> None:
        """Do nothing: it begins in its only state."""

    def _set_current_state(self, state_label: Optional[str]) -> None:
        self._current_label = state_label
        label = state_label or ''
        self._current_state = self._states.get(label)
        self._current_transitions = self._transitions.get(label)

    # -- pickling and copying

    def __getstate__(self) -> Dict[str, object]:
        """Leave out the lock. A copy of a branch is at rest."""
        state = dict(self.__dict__)
        del state['_state_transitioning_lock']
        return state

    def __setstate__(self, state: Dict[str, object]) -> None:
        self.__dict__.update(state)
        self._be_at_rest()
