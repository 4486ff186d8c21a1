"""A machine whose states follow each other in the order in which they were added."""

from typing import Any, Mapping, Optional
from typing import Sequence as Sequence_

import smach
from smach.state import State
from smach.state_machine import StateMachine

__all__ = ['Sequence']


class Sequence(StateMachine):
    """A StateMachine in which each state's connector outcome leads to the state added next.

    A transition given explicitly for the connector outcome stays. The connector outcome of the last
    state falls through to the outcome of the same name.
    """

    def __init__(
        self,
        outcomes: Sequence_[str],
        connector_outcome: str,
        input_keys: Sequence_[str] = (),
        output_keys: Sequence_[str] = (),
    ) -> None:
        StateMachine.__init__(self, outcomes, input_keys, output_keys)
        self._connector_outcome = connector_outcome
        self._last_added_seq_label: Optional[str] = None

    @staticmethod
    def add(
        label: str,
        state: State,
        transitions: Optional[Mapping[str, Optional[str]]] = None,
        remapping: Optional[Mapping[str, str]] = None,
        constants: Optional[Mapping[str, Any]] = None,
    ) -> State:
        """Add a state to the innermost open sequence and return it. See
        :meth:`StateMachine.add`.
        """
        sequence = Sequence._currently_opened_container()
        StateMachine.add(label, state, transitions, remapping, constants)
        sequence._connect(label)
        return state

    def _connect(self, label: str) -> None:
        if self._last_added_seq_label is not None:
            transitions = self._transitions[self._last_added_seq_label]
            if self._connector_outcome not in transitions:
                smach.logerr(
                    "State '%s' of the sequence is followed by '%s' once it has registered the "
                    "outcome '%s'; "
                    'now it has only %s.'
                    % (
                        self._last_added_seq_label,
                        label,
                        self._connector_outcome,
                        list(transitions),
                    )
                )
            if transitions.get(self._connector_outcome) is None:
                transitions[self._connector_outcome] = label
        self._last_added_seq_label = label
