"""Userdata seen through a gate: recorded while the oracle recovers, shut when a state is abandoned; and its restore.

The gate sits where a `smach.UserData` keeps its dictionary (`_data`), so that every way of writing passes it: by
attribute, by item, by `update`, through a Remapper, from the output keys of a nested container.
"""
import copy
import pickle
import threading
from collections.abc import MutableMapping
from typing import Any, Callable, Dict, Iterable, Iterator, Mapping, NamedTuple, Optional, Set, Tuple

import smach


class Gate(MutableMapping):
    """The dictionary of a container's userdata, looked up anew each time, with a record of the keys written.

    After `shut` writes are dropped, and told to `on_late_write(key)`. Safe to use from several threads.
    """

    def __init__(self, machine: Any, on_late_write: Optional[Callable[[str], None]] = None) -> None:
        self._machine = machine
        self._on_late_write = on_late_write
        self._lock = threading.Lock()
        self._open = True
        self.written: Set[str] = set()

    def branch(self) -> 'Gate':
        """Return a gate that can be shut alone and records into the same set."""
        other = Gate(self._machine, self._on_late_write)
        other.written = self.written
        return other

    def shut(self) -> None:
        """Let no write pass from now on."""
        with self._lock:
            self._open = False

    def __getitem__(self, key: str) -> Any:
        return self._machine.userdata._data[key]

    def __setitem__(self, key: str, value: Any) -> None:
        with self._lock:
            if self._open:
                self.written.add(key)
                self._machine.userdata._data[key] = value
                return
        self._late(key)

    def __delitem__(self, key: str) -> None:
        with self._lock:
            if self._open:
                self.written.add(key)
                del self._machine.userdata._data[key]
                return
        self._late(key)

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._machine.userdata._data))

    def __len__(self) -> int:
        return len(self._machine.userdata._data)

    def _late(self, key: str) -> None:
        if self._on_late_write is not None:
            self._on_late_write(key)


def behind(gate: Gate) -> Any:
    """Return a `smach.UserData` whose reads and writes pass `gate`."""
    userdata: Any = smach.UserData()
    userdata._data = gate
    return userdata


def take_snapshot(data: Mapping[str, Any], deep_copy_keys: Iterable[str],
                  warn: Callable[[str], None]) -> Dict[str, Any]:
    """Return the userdata as it is now: references, but for `deep_copy_keys`, which are copied through and through."""
    snapshot = dict(data)
    for key in deep_copy_keys:
        if key in snapshot:
            try:
                snapshot[key] = copy.deepcopy(snapshot[key])
            except Exception as err:  # whatever a user's object raises: a reference is better than a dead machine
                warn('Userdata key {!r} cannot be deep-copied, a reference is kept: {!r}'.format(key, err))
    return snapshot


def restore(data: Dict[str, Any], snapshot: Mapping[str, Any], keep: Iterable[str],
            deep_copy_keys: Iterable[str]) -> None:
    """Make `data` in place what it was at `snapshot`, but for the keys in `keep`.

    In place, because scripts hold on to the dictionary. Deep copies are handed out as copies, so that the snapshot
    itself stays what it was.
    """
    kept = set(keep)
    deep = set(deep_copy_keys)
    for key, value in snapshot.items():
        if key not in kept:
            data[key] = _copied(value) if key in deep else value
    for key in list(data):
        if key not in snapshot and key not in kept:
            del data[key]


def _copied(value: Any) -> Any:
    try:
        return copy.deepcopy(value)
    except Exception:  # it could not be copied at entry either, and that was said then
        return value


class Begun(NamedTuple):
    """Userdata at a moment: values, copies and fingerprints of the deep-copied keys, the keys written until then."""

    data: Dict[str, Any]
    copies: Dict[str, Any]
    prints: Dict[str, Optional[bytes]]
    written: Set[str]


class WriteWatch:
    """Tells which keys of a container's userdata change between its making and `written`, whoever writes them.

    Writes through the gate are recorded; writes past it (a precondition that holds the machine itself) show as another
    object under the key; changes in place show for `deep_copy_keys`, by a fingerprint.
    """

    def __init__(self, machine: Any, deep_copy_keys: Iterable[str]) -> None:
        self._machine = machine
        self._deep = tuple(deep_copy_keys)
        self.gate = Gate(machine)
        self._before = dict(machine.userdata._data)
        self._prints = {key: _fingerprint(self._before[key]) for key in self._deep if key in self._before}

    def begin(self) -> Begun:
        """Begin with what may be taken back."""
        data = dict(self._machine.userdata._data)
        copies = {key: _copied(data[key]) for key in self._deep if key in data}
        return Begun(data, copies, {key: _fingerprint(data[key]) for key in copies}, set(self.gate.written))

    def take_back(self, begun: Begun) -> None:
        """Userdata is again what it was, and does not count as written; objects that were changed inside stay changed,
        but for the deep-copied keys."""
        data = self._machine.userdata._data
        for key, value in begun.data.items():
            if key in begun.prints and _fingerprint(value) != begun.prints[key]:
                if self._before.get(key) is value and self._prints.get(key) == begun.prints[key]:
                    self._before[key] = begun.copies[key]
                value = begun.copies[key]
            data[key] = value
        for key in set(data).difference(begun.data):
            del data[key]
        self.gate.written.intersection_update(begun.written)

    def written(self) -> Set[str]:
        """Return the keys set, deleted or changed so far."""
        now = dict(self._machine.userdata._data)
        keys = set(self.gate.written)
        keys.update(key for key in now if key not in self._before or now[key] is not self._before[key])
        keys.update(key for key in self._before if key not in now)
        keys.update(key for key, seen in self._prints.items() if key in now and _fingerprint(now[key]) != seen)
        return keys


def _fingerprint(value: Any) -> Optional[bytes]:
    try:
        return pickle.dumps(value)  # written to compare, never loaded
    except Exception:  # unpicklable: only an assignment can be told
        return None


class _WithConstants(MutableMapping):
    """A userdata dictionary in which some keys read as constants; writes go to the dictionary."""

    def __init__(self, userdata: Any, fixed: Mapping[str, Any]) -> None:
        self._userdata = userdata
        self._fixed = fixed

    def __getitem__(self, key: str) -> Any:
        return self._fixed[key] if key in self._fixed else self._userdata._data[key]

    def __setitem__(self, key: str, value: Any) -> None:
        self._userdata._data[key] = value

    def __delitem__(self, key: str) -> None:
        del self._userdata._data[key]

    def __iter__(self) -> Iterator[str]:
        return iter(set(self._fixed).union(self._userdata._data))

    def __len__(self) -> int:
        return len(set(self._fixed).union(self._userdata._data))


def constants_of(machine: Any, label: str) -> Mapping[str, Any]:
    """Return the constants given with a state; engines without constants have none."""
    return (getattr(machine, '_constants', None) or {}).get(label) or {}


def view_of(machine: Any, label: str, state: Any, userdata: Any) -> Any:
    """Return what a state reads and writes, by its own key names. `label` is '' for a state not in the machine."""
    remapping = machine._remappings.get(label) or {} if label else {}
    constants = constants_of(machine, label)
    if constants:
        shown: Any = smach.UserData()
        shown._data = _WithConstants(userdata, {remapping.get(key, key): value for key, value in constants.items()})
        userdata = shown
    return smach.Remapper(userdata, state.get_registered_input_keys(), state.get_registered_output_keys(), remapping)


def _keeps_key_sets() -> bool:
    """Whether this engine's Remapper sees keys that a state declares after the Remapper was made."""
    userdata, keys = smach.UserData(), {'before'}
    userdata._data['after'] = None
    remapper = smach.Remapper(userdata, keys, keys, {})
    keys.add('after')
    return 'after' in remapper


_KEEPS_KEY_SETS = _keeps_key_sets()


class View:
    """What a state reads and writes, kept for its next visit where this engine and the state's make allow it.

    It may be used again while nothing that it was made of has been exchanged: the machine looks at each visit.
    """

    __slots__ = ('remapper', 'state', 'userdata', 'remapping', 'input_keys', 'output_keys')

    def __init__(self, machine: Any, label: str, state: Any) -> None:
        self.remapping = machine._remappings[label]
        self.userdata = machine.userdata
        self.state = None  # what no state is: made for one visit
        if _KEEPS_KEY_SETS and _has_plain_keys(state) and not constants_of(machine, label):
            self.state, self.input_keys, self.output_keys = state, state._input_keys, state._output_keys
            self.remapper = smach.Remapper(machine.userdata, self.input_keys, self.output_keys, self.remapping)
        else:
            self.remapper = view_of(machine, label, state, machine.userdata)


def _has_plain_keys(state: Any) -> bool:
    """Whether the state declares its keys as `smach.State` does, so that the sets themselves can be looked at."""
    methods = ('get_registered_input_keys', 'get_registered_output_keys')
    return isinstance(state, smach.State) and all(
        getattr(getattr(state, name), '__func__', None) is getattr(smach.State, name) for name in methods)


def missing_keys(machine: Any, label: str, available: Iterable[str]) -> Tuple[str, ...]:
    """Return the input keys of a state, by its own names, that are not among the container's `available` keys."""
    present = set(available)
    remapping = machine._remappings.get(label) or {}
    constants = constants_of(machine, label)
    inputs = machine._states[label].get_registered_input_keys()
    return tuple(sorted(key for key in inputs if key not in constants and remapping.get(key, key) not in present))


def keys_after_jump(ledger: Any, label: str, written: Any) -> Tuple[str, ...]:
    """Return the container's userdata keys as they would be after a jump to a state."""
    now = ledger.machine.userdata._data
    snapshot = ledger.record(label).snapshot
    if ledger.settings.userdata == 'keep' or snapshot is None:
        return tuple(now)
    return tuple(set(snapshot).difference(written).union(key for key in written if key in now))
