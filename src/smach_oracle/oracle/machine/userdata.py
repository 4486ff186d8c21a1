"""The userdata of a container: as it is, as its states see it, and as it was.

Snapshots are restored, and writes are seen at a gate. It sits where a `smach.UserData` keeps its
dictionary (`_data`), so that every way of writing passes it: by attribute, by item, by `update`,
through a Remapper, from the output keys of a nested container.
"""

import copy
import pickle
import threading
from collections.abc import MutableMapping
from typing import (
    Callable,
    Dict,
    Iterable,
    Iterator,
    Mapping,
    NamedTuple,
    Optional,
    Set,
    Tuple,
    cast,
)

import smach
from smach_common.foreign import ends_program, error_text

from ..identity import own_mark
from ..smach_private import (
    constants_of,
    data_of,
    hold_data,
    keys_of,
    remapping_of,
    remappings_of,
    states_of,
)

_GONE = object()  # in place of the value of a key that is not there


def restore(
    data: Dict[str, object],
    snapshot: Mapping[str, object],
    keep: Iterable[str],
    deep_copy_keys: Iterable[str],
) -> None:
    """Make `data` in place what it was at `snapshot`, except the keys in `keep`.

    In place, because scripts hold on to the dictionary. Deep copies are handed out as copies, so
    that the snapshot itself stays what it was.
    """
    kept = set(keep)
    deep = set(deep_copy_keys)
    for key, value in snapshot.items():
        if key not in kept:
            data[key] = copied(value) if key in deep else value
    for key in list(data):
        if key not in snapshot and key not in kept:
            del data[key]


def copied(value: object, warn: Optional[Callable[[str], None]] = None) -> object:
    """Return a deep copy of a value, the value itself where it cannot be copied.

    `warn` takes the reason. It is not needed where that was said before, as the state began.
    """
    try:
        return copy.deepcopy(value)
    except BaseException as err:
        # whatever a user's object raises: a reference is better than a dead machine
        if ends_program(err):
            raise
        if warn is not None:
            warn(error_text(err))
        return value


def fingerprint(value: object) -> Optional[bytes]:
    """Return bytes that differ where the value differs, or None where that cannot be told."""
    try:
        return pickle.dumps(value)  # written to compare, never loaded
    except BaseException as err:  # unpicklable: only an assignment can be told
        if ends_program(err):
            raise
        return None


class UserdataGate(MutableMapping):
    """The dictionary of a container's userdata, with a record of the keys written.

    It looks the dictionary up again each time.

    After `shut` writes are dropped, and told to `on_late_write(key)`. Safe to use from several
    threads.
    """

    def __init__(
        self, machine: smach.StateMachine, on_late_write: Optional[Callable[[str], None]] = None
    ) -> None:
        self._machine = machine
        self._on_late_write = on_late_write
        self._lock = threading.Lock()
        self._open = True
        self.written: Set[str] = set()

    def fork(self) -> 'UserdataGate':
        """Return a gate that can be shut alone and records into the same set."""
        other = UserdataGate(self._machine, self._on_late_write)
        other.written = self.written
        return other

    def shut(self) -> None:
        """Let no write pass from now on."""
        with self._lock:
            self._open = False

    def __getitem__(self, key: str) -> object:
        return data_of(self._machine.userdata)[key]

    def __setitem__(self, key: str, value: object) -> None:
        with self._lock:
            if self._open:
                self.written.add(key)
                data_of(self._machine.userdata)[key] = value
                return
        self._late(key)

    def __delitem__(self, key: str) -> None:
        with self._lock:
            if self._open:
                self.written.add(key)
                del data_of(self._machine.userdata)[key]
                return
        self._late(key)

    def __iter__(self) -> Iterator[str]:
        return iter(list(data_of(self._machine.userdata)))

    def __len__(self) -> int:
        return len(data_of(self._machine.userdata))

    def _late(self, key: str) -> None:
        if self._on_late_write is not None:
            self._on_late_write(key)


def behind(gate: UserdataGate) -> smach.UserData:
    """Return a `smach.UserData` whose reads and writes pass `gate`."""
    userdata = smach.UserData()
    hold_data(userdata, gate)
    return userdata


class UserdataMark(NamedTuple):
    """Userdata at a moment.

    `copies` and `prints` (fingerprints) are those of the deep-copied keys.
    """

    data: Dict[str, object]
    copies: Dict[str, object]
    prints: Dict[str, Optional[bytes]]


class WriteWatch:
    """Finds the keys of a container's userdata that change, whoever writes them.

    It compares the moment when it is made with that of `written`.

    Writes through the gate are recorded. Writes past it (a precondition that holds the machine
    itself) show as another object under the key. Changes in place show for `deep_copy_keys`, by
    a fingerprint.
    """

    def __init__(self, machine: smach.StateMachine, deep_copy_keys: Iterable[str]) -> None:
        self._machine = machine
        self._deep = tuple(deep_copy_keys)
        self.gate = UserdataGate(machine)
        self._kept: Set[str] = set()  # written through the gate before `begin`
        self._before = dict(data_of(machine.userdata))
        self._prints = {
            key: fingerprint(self._before[key]) for key in self._deep if key in self._before
        }

    def begin(self) -> UserdataMark:
        """Begin with what may be taken back."""
        data = dict(data_of(self._machine.userdata))
        self._kept.update(self.gate.written)
        self.gate.written.clear()  # the set itself: branches of the gate have it, too
        copies = {key: copied(data[key]) for key in self._deep if key in data}
        return UserdataMark(data, copies, {key: fingerprint(data[key]) for key in copies})

    def take_back(self, begun: UserdataMark) -> None:
        """Make the userdata what it was. It no longer counts as written.

        Objects that were changed inside stay changed, except the deep-copied keys. So does what
        another part of the program has written meanwhile.
        """
        data = data_of(self._machine.userdata)
        if own_mark(self._machine, 'shares_userdata'):
            self.take_back_own(begun)
            return
        for key, value in begun.data.items():
            if key in begun.prints and fingerprint(value) != begun.prints[key]:
                if self._before.get(key) is value:
                    self._before[key] = begun.copies[key]
                begun.data[key] = begun.copies[key]
        others = keys_of_others(self._machine, begun.data, self._deep)
        restore(data, begun.data, others.difference(self.gate.written), ())
        self.gate.written.clear()

    def take_back_own(self, begun: UserdataMark) -> None:
        """Take back what passed the gate alone: others write the userdata at the same time."""
        data = data_of(self._machine.userdata)
        for key in self.gate.written:
            if key in begun.data:
                data[key] = begun.data[key]
            else:
                data.pop(key, None)
        self.gate.written.clear()

    def written_in(self, machine: smach.StateMachine) -> Set[str]:
        """Return the keys of this machine's userdata that were written: none of another machine."""
        return self.written() if machine is self._machine else set()

    def written(self) -> Set[str]:
        """Return the keys set, deleted or changed so far."""
        now, before = dict(data_of(self._machine.userdata)), self._before
        keys = self._kept.union(self.gate.written)
        for key in {**now, **before}:
            if now.get(key, _GONE) is not before.get(key, _GONE):
                keys.add(key)
        for key, seen in self._prints.items():
            if fingerprint(now.get(key)) != seen:  # one that is gone was found above
                keys.add(key)
        return keys


# -- the userdata of a state


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
        return cast('smach.Remapper', userdata)  # as an Iterator does
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


class StateView:
    """A state's view of the userdata, kept for its next visit where that is safe.

    This engine and the state's class decide that. It may be used again while nothing that it was
    made of has been exchanged, and the state has the same keys: the machine looks at each visit.

    `state`: None where it is made for one visit. `keys`, which it then has not: those of the state,
    in and out.
    """

    __slots__ = ('state', 'userdata', 'remapping', 'keys', 'remapper')

    def __init__(self, machine: smach.StateMachine, label: str, state: smach.State) -> None:
        self.remapping = remappings_of(machine)[label]
        self.userdata = machine.userdata
        self.state: Optional[smach.State] = None
        if (
            _KEEPS_KEY_SETS
            and _has_plain_keys(state)
            and not own_mark(machine, 'hands_on_userdata')
        ):
            self.state, self.keys = state, keys_of(state)
            self.remapper = smach.Remapper(machine.userdata, *self.keys, self.remapping)
        else:
            self.remapper = view_of(machine, label, state, machine.userdata)


def _has_plain_keys(state: smach.State) -> bool:
    """Whether the state declares its keys as `smach.State` does, in sets."""
    methods = ('get_registered_input_keys', 'get_registered_output_keys')
    return all(
        getattr(getattr(state, name, None), '__func__', None) is getattr(smach.State, name)
        for name in methods
    )


def keys_of_others(
    machine: smach.StateMachine, snapshot: Mapping[str, object], deep_copy_keys: Iterable[str]
) -> Set[str]:
    """Return the userdata keys that have changed since, and that no state of the machine writes.

    Another part of the program does, such as a callback that asks the machine to stop.
    """
    none = object()
    now = data_of(machine.userdata)
    changed = {key for key in now if now[key] is not snapshot.get(key, none)}
    changed.difference_update(deep_copy_keys)
    if not changed or own_mark(machine, 'hands_on_userdata'):
        return set()
    for label, state in list(states_of(machine).items()):
        remapping = remapping_of(machine, label)
        changed.difference_update(
            [remapping.get(key, key) for key in state.get_registered_output_keys()],
            constants_of(machine, label),
        )
    return changed


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
