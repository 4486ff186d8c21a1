"""The hidden machine of one branch: a plain state of a Concurrence or an Iterator, alone."""

from typing import Mapping

import smach


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
