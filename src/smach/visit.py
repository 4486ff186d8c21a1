"""The part of a state's visit that a machine keeps, so that the next one costs little."""

from typing import Any, Dict, Mapping, Optional

from smach.state import State
from smach.user_data import Remapper


class StateVisit(object):
    """The view on userdata a state is given, with everything it was made of, to be compared by
    identity later.
    """

    __slots__ = (
        'state',
        'userdata',
        'input_keys',
        'output_keys',
        'remapping',
        'remapper',
        'may_be_kept',
        'texts',
    )

    def __init__(self, state: Any, userdata: Any, remapping: Mapping[str, str]) -> None:
        # A state that computes its keys is asked for them at every visit.
        self.may_be_kept = (
            type(state).get_registered_input_keys is State.get_registered_input_keys
            and type(state).get_registered_output_keys is State.get_registered_output_keys
        )
        self.state = state
        self.userdata = userdata
        if self.may_be_kept:
            self.input_keys, self.output_keys = state._input_keys, state._output_keys
        else:
            self.input_keys = state.get_registered_input_keys()
            self.output_keys = state.get_registered_output_keys()
        self.remapping = remapping
        self.texts: Dict[Any, Any] = {}  # (target, log line of the transition to it) by outcome
        self.remapper = Remapper(userdata, self.input_keys, self.output_keys, remapping)

    def text_of(self, label: str, outcome: str, target: Optional[str]) -> str:
        """Return the log line of a transition, made once and kept."""
        text = "State machine transitioning '%s':'%s'-->'%s'" % (label, outcome, target)
        self.texts[outcome] = (target, text)
        return text
