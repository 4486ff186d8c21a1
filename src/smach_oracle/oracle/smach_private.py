"""SMACH's private names: the one file of the executive that uses them on another object.

Upstream's engine and our own have the same names, which public scripts and tools use too. Where
they differ, a docstring says so. A class of ours that extends one of SMACH's reads its own by
`self`. Most of what only reads a name is an `attrgetter`: that costs half of a function of ours,
and the short way of a plain success calls two.
"""

import threading
from operator import attrgetter
from typing import (
    Any,
    Callable,
    Collection,
    Dict,
    List,
    Mapping,
    MutableMapping,
    NamedTuple,
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

# of a StateMachine or a Concurrence: the states by label, in the author's order
states_of: Callable[[HasStates], Dict[str, smach.State]] = attrgetter('_states')
# where each outcome leads, by the label of the state. None leads nowhere
transitions_of: Callable[[smach.StateMachine], Dict[str, Transitions]] = attrgetter('_transitions')
# the container's names of its states' keys, by the label of the state
remappings_of: Callable[[HasStates], Dict[str, Mapping[str, str]]] = attrgetter('_remappings')
# the sets of a state's input and output keys themselves. One that registers a key gets new sets
keys_of: Callable[[smach.State], Tuple[Set[str], Set[str]]] = attrgetter(
    '_input_keys', '_output_keys'
)
# the values of userdata by key, to read and to write
data_of: Callable[[smach.UserData], Dict[str, object]] = attrgetter('_data')
# the transition callbacks of a container, each with its arguments
transition_callbacks: Callable[[smach.Container], List[Tuple[Any, Any]]] = attrgetter(
    '_transition_cbs'
)


def constants_of(machine: smach.StateMachine, label: str) -> Mapping[str, object]:
    """Return what is written into the userdata before each visit of a state."""
    return machine._constants.get(label) or {}


def hold_data(userdata: smach.UserData, data: MutableMapping[str, object]) -> None:
    """Have userdata keep its values in another mapping."""
    held: Any = userdata
    held._data = data


def opened_container() -> Optional[smach.Container]:
    """Return the container of the innermost `with` block."""
    container: Optional[smach.Container] = smach.StateMachine._currently_opened_container()
    return container


# -- a machine that executes. Its thread alone writes

# the lock of a machine, which is free while a state executes
lock_of: Callable[[smach.StateMachine], 'threading.RLock'] = attrgetter('_state_transitioning_lock')
# whether it is being executed, whatever its class says of `is_running`
is_executing: Callable[[smach.StateMachine], bool] = attrgetter('_is_running')
current_state_of: Callable[[smach.StateMachine], Optional[smach.State]] = attrgetter(
    '_current_state'
)


def set_executing(machine: smach.StateMachine, is_running: bool) -> None:
    """Have the engine go on, or stop, at the next step."""
    machine._is_running = is_running


def current_label_of(machine: smach.StateMachine) -> str:
    """Return the label of the current state, '' where none is."""
    return machine._current_label or ''


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

# whether it has a request, whatever its class says of `preempt_requested`
has_preempt_flag: Callable[[smach.State], bool] = attrgetter('_preempt_requested')
# the state to which a request was passed on last, until it was seen to obey
preempted_state_of: Callable[[smach.StateMachine], Optional[smach.State]] = attrgetter(
    '_preempted_state'
)


def set_preempt_flag(machine: smach.StateMachine, is_requested: bool) -> None:
    """Have a request, or none, without passing it on to the current state."""
    machine._preempt_requested = is_requested


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

# which outcomes of its states a Concurrence maps to which of its own
outcome_map_of: Callable[[Any], Mapping[str, Mapping[str, str]]] = attrgetter('_outcome_map')
# what a Concurrence asks, as a state ends, whether others are to stop
child_termination_cb_of: Callable[[Any], Optional[Callable[[Any], Any]]] = attrgetter(
    '_child_termination_cb'
)
# the outcomes of its states while it executes, None of one that has not ended
outcomes_so_far: Callable[[Any], Mapping[str, Optional[str]]] = attrgetter('_child_outcomes')
# which outcome of the last item an Iterator maps to which of its own
final_outcomes_of: Callable[[Any], Mapping[str, str]] = attrgetter('_final_outcome_map')
# the outcomes after which an Iterator goes on. If there are none, all not to break
loop_outcomes_of: Callable[[Any], Collection[str]] = attrgetter('_loop_outcomes')
# the outcomes after which it ends
break_outcomes_of: Callable[[Any], Collection[str]] = attrgetter('_break_outcomes')
# what it was given to iterate over: an iterable, or a function of one
items_of: Callable[[Any], Any] = attrgetter('_items')
# the state that it executes, and its label, '' while it has none
iterated_state_of: Callable[[smach.Iterator], Optional[smach.State]] = attrgetter('_state')
iterated_label_of: Callable[[smach.Iterator], str] = attrgetter('_state_label')


def set_items(iterator: Any, items: object, state: Optional[smach.State]) -> None:
    """Have an Iterator iterate over other items, and execute another state."""
    iterator._items, iterator._state = items, state


def set_states(concurrence: Any, states: Mapping[str, smach.State]) -> None:
    """Have a Concurrence execute other states."""
    concurrence._states = states


# -- of any container, empty where it has none


def items_label_of(container: object) -> Optional[str]:
    """Return the key of an Iterator's userdata that has the item, None for other containers."""
    label = own_mark(container, '_items_label')
    return None if label is None else cast('str', label)


def initial_label_of(container: object) -> str:
    """Return the label of the state in which a container begins."""
    return cast('str', own_mark(container, '_initial_state_label') or '')


def transitions_in(container: object, label: str) -> Transitions:
    """Return where the outcomes of a state lead."""
    tables = cast('Dict[str, Optional[Transitions]]', own_mark(container, '_transitions') or {})
    return tables.get(label) or {}


def remapping_of(container: object, label: str) -> Mapping[str, str]:
    """Return the container's names of a state's keys."""
    tables = cast('Dict[str, Mapping[str, str]]', own_mark(container, '_remappings') or {})
    return tables.get(label) or {}


class ClassSteps(NamedTuple):
    """The way in which the machines of a class step.

    `cls`: the class, which is kept. `once`: what it does for a step. `is_asked`: whether it answers
    itself whether there is a preempt request. `tells_transitions`: whether it wants every
    transition told. `is_smachs`: whether nobody but SMACH and this package has a say in it.
    """

    cls: type
    once: object
    is_asked: bool
    tells_transitions: bool
    is_smachs: bool


class KnownClasses(Dict[int, ClassSteps]):
    """The way in which machines step, by the id of their class.

    It is looked up once in a trial, as a user may patch a class between two trials.
    """

    def steps_of(self, cls: Any) -> ClassSteps:
        """Return that of a class. What a user's metaclass says of equality does not matter."""
        steps = self.get(id(cls))
        if steps is None:
            steps = self[id(cls)] = ClassSteps(
                cls,
                getattr(cls, '_update_once', None),
                cls.preempt_requested is not smach.State.preempt_requested,
                cls.call_transition_cbs is not smach.Container.call_transition_cbs,
                all(
                    each.__module__.partition('.')[0] in ('smach', 'smach_oracle')
                    for each in cls.__mro__
                    if 'execute' in vars(each) or '_update_once' in vars(each)
                ),
            )
        return steps


class EngineProbe:
    """Finds out how the SMACH engine steps, when an execution comes to its first state.

    `lock_is_held`: whether the engine holds the machine's lock around a step. `attentive`: whether
    a step begins with a closer look at preempt requests and at what an operator wants.
    `stays_attentive`: whether it does so in any case. `tells_transitions`: whether the machine's
    class wants every transition told. `has_own_loop`: whether the engine itself calls for the next
    step, and no class of a user's. `stepped`: whether this execution has come to a state.
    """

    def __init__(self) -> None:
        self.begin_execution()

    def ring(self) -> None:
        """Look closely from now on: a state around the machine was abandoned."""
        self.attentive = True

    def begin_execution(self) -> None:
        """Forget what was seen: the next step looks again."""
        self.stepped = False
        self.attentive = True

    def look(
        self, machine: smach.StateMachine, stays_attentive: bool, classes: KnownClasses
    ) -> None:
        """Find out how this engine steps. `stays_attentive`: it is to look closely in any case.

        Some engines hold the lock around a step, with a plain lock all do. Others leave it to the
        step.
        """
        self.stepped = True
        # of a re-entrant lock
        is_owned = getattr(machine._state_transitioning_lock, '_is_owned', None)
        self.lock_is_held = is_owned is None or is_owned()
        _, once, is_asked, self.tells_transitions, is_smachs = classes.steps_of(type(machine))
        self.stays_attentive = stays_attentive or is_asked
        step = getattr(machine, '_update_once', None)
        self.has_own_loop = is_smachs and getattr(step, '__func__', None) is once

    def __reduce__(self) -> Tuple[Type['EngineProbe'], Tuple[()]]:
        """A copied or pickled machine is looked at when it executes."""
        return EngineProbe, ()
