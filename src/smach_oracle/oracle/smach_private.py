"""SMACH's private names: the one file of the executive that uses them on another object.

Upstream's engine and our own have the same names, which public scripts and tools use too. Where
they differ, the docstring says so. A class of ours that extends one of SMACH's reads its own by
`self`. On Python 3.11 a call of one of these costs 15 ns, a seventieth of a wrapped transition.
"""

import threading
from typing import (
    Any,
    Collection,
    Dict,
    List,
    Mapping,
    MutableMapping,
    Optional,
    Set,
    Tuple,
    Type,
    Union,
    cast,
)

import smach

from .identity import own_attributes, own_mark

Labels = Tuple[str, ...]
Transitions = Dict[str, Optional[str]]
HasStates = Union[smach.StateMachine, smach.Concurrence]


# -- the mark of an oracle: all of ours that is set on a user's machine


def mark_on(machine: Any) -> Any:
    """Return the mark of a machine that is known to have one."""
    return machine._oracle


def mark_of(thing: object) -> object:
    """Return the mark of an object, None where it has none. Its `__getattr__` is not asked."""
    return own_mark(thing, '_oracle')


def set_mark(machine: object, node: object) -> None:
    """Mark a machine, whatever its class says of `__setattr__`."""
    own_attributes(machine)['_oracle'] = node


def remove_mark(machine: object) -> None:
    """Take the mark away."""
    del own_attributes(machine)['_oracle']


# -- the states of a container, and what lies between them


def states_of(container: HasStates) -> Dict[str, smach.State]:
    """Return the states of a StateMachine or a Concurrence by label, in the author's order."""
    return container._states


def transitions_of(machine: smach.StateMachine) -> Dict[str, Transitions]:
    """Return where each outcome leads, by the label of the state. None leads nowhere."""
    return machine._transitions


def remappings_of(container: HasStates) -> Dict[str, Mapping[str, str]]:
    """Return the container's names of its states' keys, by the label of the state."""
    return container._remappings


def constants_of(machine: smach.StateMachine, label: str) -> Mapping[str, object]:
    """Return what is written into the userdata before each visit of a state."""
    return machine._constants.get(label) or {}


def keys_of(state: smach.State) -> Tuple[Set[str], Set[str]]:
    """Return the sets of a state's input and output keys themselves.

    A state that registers a key gets new sets.
    """
    return state._input_keys, state._output_keys


class KeptParts:
    """What a state's view of the userdata was made of, to be compared at its next visit."""

    __slots__ = ('state', 'userdata', 'remapping', 'input_keys', 'output_keys')
    state: Optional[smach.State]  # None: made for one visit
    userdata: smach.UserData
    remapping: Mapping[str, str]
    input_keys: Set[str]
    output_keys: Set[str]

    def snapshot(
        self, state: smach.State, userdata: smach.UserData, remapping: Mapping[str, str]
    ) -> Optional[Dict[str, object]]:
        """Return the values of the userdata now, None where a part was exchanged.

        The short way of a plain success makes this one call in each step.
        """
        if (
            self.state is state
            and self.userdata is userdata
            and self.remapping is remapping
            and self.input_keys is state._input_keys
            and self.output_keys is state._output_keys
        ):
            return userdata._data.copy()
        return None


def data_of(userdata: smach.UserData) -> Dict[str, object]:
    """Return the values of userdata by key, to read and to write."""
    data: Dict[str, object] = userdata._data
    return data


def hold_data(userdata: smach.UserData, data: MutableMapping[str, object]) -> None:
    """Have userdata keep its values in another mapping."""
    held: Any = userdata
    held._data = data


def opened_container() -> Optional[smach.Container]:
    """Return the container of the innermost `with` block."""
    container: Optional[smach.Container] = smach.StateMachine._currently_opened_container()
    return container


def transition_callbacks(container: smach.Container) -> List[Tuple[Any, Any]]:
    """Return the transition callbacks of a container, each with its arguments."""
    return container._transition_cbs


# -- a machine that executes. Its thread alone writes


def lock_of(machine: smach.StateMachine) -> 'threading.RLock':
    """Return the lock of a machine, which is free while a state executes."""
    return machine._state_transitioning_lock


def is_executing(machine: smach.StateMachine) -> bool:
    """Whether it is being executed, whatever its class says of `is_running`."""
    return machine._is_running


def set_executing(machine: smach.StateMachine, is_running: bool) -> None:
    """Have the engine go on, or stop, at the next step."""
    machine._is_running = is_running


def current_label_of(machine: smach.StateMachine) -> str:
    """Return the label of the current state, '' where none is."""
    return machine._current_label or ''


def current_state_of(machine: smach.StateMachine) -> Optional[smach.State]:
    """Return the current state."""
    return machine._current_state


def set_current_label(machine: smach.StateMachine, label: Optional[str]) -> None:
    """Make a state the current one, with its transitions. None means none."""
    machine._set_current_state(label)


def step_once(cls: Type[smach.StateMachine], machine: smach.StateMachine) -> Optional[str]:
    """Execute the current state and go on, as a class of machines does. The lock is held.

    See `OracleContainer._update_once`.
    """
    return cls._update_once(machine)


def state_ended(
    cls: Any, machine: smach.StateMachine, outcome: object, error: Optional[Exception]
) -> Optional[str]:
    """Go on behind the current state, which was executed, as a class of machines does.

    See `OracleContainer._state_ended`.
    """
    ended: Optional[str] = cls._state_ended(machine, outcome, error)
    return ended


# -- its preempt


def has_preempt_flag(state: smach.State) -> bool:
    """Whether it has a request, whatever its class says of `preempt_requested`."""
    return state._preempt_requested


def set_preempt_flag(machine: smach.StateMachine, is_requested: bool) -> None:
    """Have a request, or none, without passing it on to the current state."""
    machine._preempt_requested = is_requested


def preempted_state_of(machine: smach.StateMachine) -> Optional[smach.State]:
    """Return the state to which a request was passed on last, until it was seen to obey."""
    return machine._preempted_state


def set_preempted_state(
    machine: smach.StateMachine, state: Optional[smach.State], label: Optional[str]
) -> None:
    """Note to which state a request was passed on. None means none."""
    machine._preempted_state, machine._preempted_label = state, label


def note_passed_on(machine: smach.StateMachine) -> None:
    """Tell our engine that a request was passed on.

    A thread that has made it, and now waits for the lock, does not pass it on once more.
    Upstream's engine never reads that.
    """
    machine._is_preempt_passed_on = True


# -- Concurrences and Iterators


def outcome_map_of(concurrence: Any) -> Mapping[str, Mapping[str, str]]:
    """Return which outcomes of its states a Concurrence maps to which of its own."""
    return concurrence._outcome_map


def final_outcomes_of(iterator: Any) -> Mapping[str, str]:
    """Return which outcome of the last item an Iterator maps to which of its own."""
    return iterator._final_outcome_map


def loop_outcomes_of(iterator: Any) -> Collection[str]:
    """Return the outcomes after which an Iterator goes on. If there are none, all not to break."""
    return iterator._loop_outcomes


def break_outcomes_of(iterator: Any) -> Collection[str]:
    """Return the outcomes after which an Iterator ends."""
    return iterator._break_outcomes


def items_of(iterator: Any) -> Any:
    """Return what an Iterator was given to iterate over: an iterable, or a function of one."""
    return iterator._items


def iterated_label_of(iterator: smach.Iterator) -> str:
    """Return the label of the state that an Iterator executes, '' while it has none."""
    return iterator._state_label


def set_items(iterator: Any, items: object, state: Optional[smach.State]) -> None:
    """Have an Iterator iterate over other items, and execute another state."""
    iterator._items, iterator._state = items, state


def set_states(concurrence: Any, states: Mapping[str, smach.State]) -> None:
    """Have a Concurrence execute other states."""
    concurrence._states = states


def iterated_state_of(iterator: smach.Iterator) -> Optional[smach.State]:
    """Return the state that an Iterator executes."""
    return iterator._state


# -- of any container, empty where it has none


def items_label_of(container: object) -> Optional[str]:
    """Return the key of an Iterator's userdata that has the item, None for other containers."""
    label = own_mark(container, '_items_label')
    return None if label is None else str(label)


def initial_label_of(container: object) -> str:
    """Return the label of the state in which a container begins."""
    return str(own_mark(container, '_initial_state_label') or '')


def transitions_in(container: object, label: str) -> Transitions:
    """Return where the outcomes of a state lead."""
    tables = cast(Dict[str, Optional[Transitions]], own_mark(container, '_transitions') or {})
    return tables.get(label) or {}


def remapping_of(container: object, label: str) -> Mapping[str, str]:
    """Return the container's names of a state's keys."""
    tables = cast(Dict[str, Mapping[str, str]], own_mark(container, '_remappings') or {})
    return tables.get(label) or {}


class EngineProbe:
    """Finds out how the SMACH engine steps, when an execution comes to its first state.

    `lock_is_held`: whether the engine holds the machine's lock around a step. `attentive`: whether
    a step begins with a closer look at preempt requests and at what an operator wants.
    `stays_attentive`: whether it does so in any case. `tells_transitions`: whether the machine's
    class wants every transition told. `has_own_loop`: whether the engine itself calls for the next
    step, and no class of a user's. `stepped`: whether this execution has come to a state.
    """

    def __init__(self) -> None:
        self._class: Optional[type] = None  # of the machine when it was looked at last
        self._is_class_known = False
        self.stepped = False
        self.lock_is_held = False
        self.attentive = True
        self.stays_attentive = True
        self.tells_transitions = True
        self.has_own_loop = False

    def ring(self) -> None:
        """Look closely from now on: a state around the machine was abandoned."""
        self.attentive = True

    def begin_trial(self) -> None:
        """Look at the machine's class again, which may have been patched since."""
        self._is_class_known = False

    def begin_execution(self) -> None:
        """Forget what was seen: the next step looks again."""
        self.stepped = False
        self.attentive = True

    def look(self, machine: smach.StateMachine, stays_attentive: bool) -> None:
        """Find out how this engine steps. `stays_attentive`: it is to look closely in any case.

        Some engines hold the lock around a step, with a plain lock all do. Others leave it to the
        step.
        """
        self.stepped = True
        # of a re-entrant lock
        is_owned = getattr(machine._state_transitioning_lock, '_is_owned', None)
        self.lock_is_held = is_owned is None or is_owned()
        if not self._is_class_known or type(machine) is not self._class:
            cls: Any = type(machine)
            if cls is not self._class:
                self._class, self._class_steps_as_drawn = cls, _steps_as_drawn(cls)
            self._is_class_known = True
            self._class_step = getattr(cls, '_update_once', None)
            self._class_is_asked = cls.preempt_requested is not smach.State.preempt_requested
            told = cls.call_transition_cbs
            self.tells_transitions = told is not smach.Container.call_transition_cbs
        self.stays_attentive = stays_attentive or self._class_is_asked
        # nobody but SMACH and this package has a say in how the machine steps
        step = getattr(machine, '_update_once', None)
        self.has_own_loop = (
            self._class_steps_as_drawn and getattr(step, '__func__', None) is self._class_step
        )

    def __reduce__(self) -> Tuple[Type['EngineProbe'], Tuple[()]]:
        """A copied or pickled machine is looked at when it executes."""
        return EngineProbe, ()


def _steps_as_drawn(cls: type) -> bool:
    return all(
        each.__module__.partition('.')[0] in ('smach', 'smach_oracle')
        for each in cls.__mro__
        if 'execute' in vars(each) or '_update_once' in vars(each)
    )
