"""The hidden machine of one branch: a plain state of a Concurrence or an Iterator, alone."""

from typing import Mapping, Optional

import smach

from ..machine.execution import Execution
from ..machine.tree_node import WrappedMachine
from ..recovery.endings import outcome_of_early_end

COULD_NOT = 'Could not execute state '  # how a machine begins to pass on what a state has raised


class BranchMachine(smach.StateMachine):
    """A machine of one state, which stays the user's own object. Nobody sees the machine.

    It is stepped like any wrapped machine. Its userdata is that of the Concurrence or Iterator
    itself, so that what a branch writes is seen by the others at once. Its outcomes are those of
    the state.
    """

    def __init__(self, label: str, is_alone: bool) -> None:
        """`is_alone`: whether no other branch runs at the same time, as in an Iterator."""
        smach.StateMachine.__init__(self, outcomes=[])
        self._branch_label = label
        # the userdata may be written by others while the state, or its recovery, runs
        self.shares_userdata = not is_alone
        # the state gets the userdata itself, as an Iterator hands it over
        self.hands_on_userdata = is_alone
        self._initial_state_label = label

    def take(
        self, state: smach.State, userdata: smach.UserData, remapping: Mapping[str, str]
    ) -> None:
        """Have this state, with the outcomes that it has now."""
        label = self._branch_label
        outcomes = state.get_registered_outcomes()
        self.userdata = userdata
        self._states[label] = state
        self._remappings[label] = remapping
        if set(self._outcomes) != set(outcomes) or label not in self._transitions:
            self._outcomes = set(outcomes)
            self._transitions[label] = dict.fromkeys(outcomes)


def run_branch(machine: WrappedMachine, pending_preempt: bool) -> Optional[str]:
    """Execute a branch, through its oracle where it fails, and return the outcome of its state.

    `pending_preempt`: whether a preempt is under way already. It raises what the state has raised
    where its oracle gives up.
    """
    node = machine._oracle
    run = Execution(node, is_whole=False)
    if not run.look_around():
        smach.logwarn(
            '{}: a branch does not begin, as {}'.format(node.path, node.why_left_behind())
        )
        return outcome_of_early_end(node, None)
    outcome = node.tree.resumed.take_outcome(node)
    if outcome is not None:
        return outcome
    error: Optional[BaseException] = None
    run.begin()
    try:
        return outcome_of_early_end(node, _step_to_end(machine, pending_preempt))
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


def _step_to_end(machine: WrappedMachine, pending_preempt: bool) -> Optional[str]:
    with machine._state_transitioning_lock:
        machine._is_running = True
        machine._preempt_requested = pending_preempt
        machine._preempted_label = machine._preempted_state = None
        machine._set_current_state(machine._initial_state_label)
        try:
            outcome = machine._update_once()
            while outcome is None and machine._is_running and not smach.is_shutdown():
                outcome = machine._update_once()
            return outcome
        finally:
            machine._is_running = False
            machine._current_state = None
