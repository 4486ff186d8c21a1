"""The userdata of a state: the container's userdata by the state's own key names."""

from typing import Iterable, Mapping, Tuple, cast

import smach

from ..identity import own_mark
from ..smach_private import (
    KeptParts,
    constants_of,
    data_of,
    keys_of,
    remapping_of,
    remappings_of,
    states_of,
)
from .snapshots import UserdataGate, behind


def write_constants(userdata: smach.UserData, constants: Mapping[str, object]) -> None:
    """Write a state's constants before it runs, as the engine does. They stay."""
    for key, value in constants.items():
        userdata[key] = value


def view_of(
    machine: smach.StateMachine, label: str, state: smach.State, userdata: smach.UserData
) -> smach.Remapper:
    """Return what a state reads and writes, by its own key names.

    `label` is '' for a state that is not in the machine.
    """
    if label and own_mark(machine, 'hands_on_userdata'):
        return cast(smach.Remapper, userdata)  # as an Iterator does
    remapping = remapping_of(machine, label) if label else {}
    return smach.Remapper(
        userdata, state.get_registered_input_keys(), state.get_registered_output_keys(), remapping
    )


def view_behind(
    gate: UserdataGate, machine: smach.StateMachine, label: str, state: smach.State
) -> smach.Remapper:
    """Return what `view_of` does for the container's userdata, behind a gate."""
    return view_of(machine, label, state, behind(gate))


def _keeps_key_sets() -> bool:
    """Whether a Remapper of this engine sees keys that a state declares later."""
    userdata, keys = smach.UserData(), {'before'}
    data_of(userdata)['after'] = None
    remapper = smach.Remapper(userdata, keys, keys, {})
    keys.add('after')
    return 'after' in remapper


_KEEPS_KEY_SETS = _keeps_key_sets()


class StateView(KeptParts):
    """A state's view of the userdata, kept for its next visit where that is safe.

    This engine and the state's class decide that.

    It may be used again while nothing that it was made of has been exchanged: the machine looks at
    each visit.
    """

    __slots__ = ('remapper',)

    def __init__(self, machine: smach.StateMachine, label: str, state: smach.State) -> None:
        self.remapping = remappings_of(machine)[label]
        self.userdata = machine.userdata
        self.state = None
        if (
            _KEEPS_KEY_SETS
            and _has_plain_keys(state)
            and not own_mark(machine, 'hands_on_userdata')
        ):
            self.state = state
            self.input_keys, self.output_keys = keys_of(state)
            self.remapper = smach.Remapper(
                machine.userdata, self.input_keys, self.output_keys, self.remapping
            )
        else:
            self.remapper = view_of(machine, label, state, machine.userdata)


def _has_plain_keys(state: smach.State) -> bool:
    """Whether the state declares its keys as `smach.State` does, in sets."""
    methods = ('get_registered_input_keys', 'get_registered_output_keys')
    return isinstance(state, smach.State) and all(
        getattr(getattr(state, name), '__func__', None) is getattr(smach.State, name)
        for name in methods
    )


def missing_keys(
    machine: smach.StateMachine, label: str, available: Iterable[str]
) -> Tuple[str, ...]:
    """Return the input keys of a state that are not among the `available` keys.

    They are named as the state names them. `available` are keys of the container.
    """
    present = set(available).union(constants_of(machine, label))
    remapping = remapping_of(machine, label)
    inputs = states_of(machine)[label].get_registered_input_keys()
    return tuple(sorted(key for key in inputs if remapping.get(key, key) not in present))
