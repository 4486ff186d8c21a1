"""Userdata: what states hand to each other, and the view of it a single state gets.

Both classes are made for speed: a step of a machine reads and writes through them many times a
microsecond apart. A read or write of one key is one dictionary operation, which Python itself makes
atomic. So they need no locks to be safe for several threads.
"""

import copy
from typing import Any, Callable, Collection, Dict, Iterable, List, Mapping, Union

import smach
from smach.read_only import PLAIN_TYPES, get_const
from smach.read_only import Const as Const  # scripts look for it here

__all__ = ['UserData', 'Remapper']

_NO_REMAPPING: Dict[str, str] = {}


class UserData(object):
    """Values by key, as attributes (``ud.x``) or items (``ud['x']``). The dictionary itself is
    ``_data``.
    """

    _data: Dict[str, Any]

    def __init__(self) -> None:
        self._data = {}

    def __getattr__(self, key: str) -> Any:
        """Only reached for names that are no attribute of the object: look among the keys."""
        if key == '_data':  # not initialised yet: while being unpickled or copied
            raise AttributeError(key)
        if key in self._data:
            return self._data[key]
        if key.startswith('_'):  # asked for by copy, pickle and hasattr() in other libraries
            raise AttributeError(_no_such_key(self, key))
        return self[key]

    def __setattr__(self, key: str, value: Any) -> None:
        if key == '_data':
            object.__setattr__(self, key, value)
        else:
            self._data[key] = value

    def __getitem__(self, key: str) -> Any:
        try:
            return self._data[key]
        except KeyError:
            text = _no_such_key(self, key)
        smach.logerr(text)
        raise KeyError(text)

    def __setitem__(self, key: str, item: Any) -> None:
        self._data[key] = item

    def __contains__(self, key: object) -> bool:
        return key in self._data

    def keys(self) -> List[str]:
        """Return all keys, in the order in which they were first written."""
        return list(self._data)

    def update(self, other_userdata: Union['UserData', Mapping[str, Any]]) -> None:
        """Take over all keys of another userdata."""
        self._data.update(_as_dict(other_userdata))

    def extract(self, keys: Iterable[str], remapping: Mapping[str, str]) -> 'UserData':
        """Return a new userdata with shallow copies of the given keys.

        ``remapping`` maps new names to keys of this one.
        """
        new_names = {old: new for new, old in remapping.items()}
        extracted = UserData()
        for key in keys:
            extracted[new_names.get(key, key)] = _shallow_copy(self[key])
        return extracted

    def merge(self, ud: 'UserData', keys: Iterable[str], remapping: Mapping[str, str]) -> None:
        """Write shallow copies of the given keys of ``ud`` here. ``remapping`` maps keys of ``ud``
        to keys of this.
        """
        for key in keys:
            self[remapping.get(key, key)] = _shallow_copy(ud[key])

    def __copy__(self) -> 'UserData':
        twin = type(self).__new__(type(self))
        twin.__dict__.update(self.__dict__, _data=dict(self._data))
        return twin


class Remapper(object):
    """The userdata as one state sees it: its own names for the keys, and only those it declared.

    ``remapping`` maps the state's names to the keys of ``ud``. Reading a key that is not in
    ``input_keys`` raises InvalidUserCodeError. Writing one that is not in ``output_keys`` logs an
    error and changes nothing. The collections of keys are kept, not copied: keys that a state
    declares later are seen at once.
    """

    # One slot with everything in it and __getattribute__ (not __getattr__) take half the time of
    # anything plainer: a failing attribute look-up, with its exception made and thrown away, would
    # precede every read.
    __slots__ = ('_parts', '__weakref__')

    def __init__(
        self,
        ud: Any,
        input_keys: Collection[str] = (),
        output_keys: Collection[str] = (),
        remapping: Mapping[str, str] = _NO_REMAPPING,
    ) -> None:
        # A plain UserData is read and written at its dictionary, anything else through its own item
        # access.
        _set_parts(self, (ud, input_keys, output_keys, remapping, type(ud) is UserData))

    def __getattribute__(self, key: str) -> Any:
        ud, input_keys, output_keys, remapping, is_plain = _parts_of(self)
        if key not in input_keys:
            return object.__getattribute__(self, key)
        ud_key = remapping[key] if key in remapping else key
        values = ud._data if is_plain else ud
        if ud_key in values:
            value = values[ud_key]
        else:
            value = ud[ud_key]  # complains
        if type(value) in PLAIN_TYPES or key in output_keys:
            return value
        return get_const(value)

    def __getattr__(self, key: str) -> Any:
        """Reached for names that are neither input keys nor methods."""
        if key.startswith('__'):  # the protocols of copy, pickle, numpy and the like
            raise AttributeError(key)
        raise self._not_an_input(key)

    def __setattr__(self, key: str, value: Any) -> None:
        ud, _, output_keys, remapping, is_plain = _parts_of(self)
        if key not in output_keys:
            smach.logerr(
                "Userdata key '%s' is not written: the state's output keys are %s."
                % (key, _listed(output_keys))
            )
        elif is_plain:
            ud._data[remapping[key] if key in remapping else key] = value
        else:
            ud[remapping[key] if key in remapping else key] = value

    def __getitem__(self, key: str) -> Any:
        if key not in _parts_of(self)[1]:
            raise self._not_an_input(key)
        return Remapper.__getattribute__(self, key)

    __setitem__ = __setattr__

    def _remap(self, key: str) -> str:
        """The key of the userdata behind the state's name ``key``."""
        remapping: Mapping[str, str] = _parts_of(self)[3]
        return remapping[key] if key in remapping else key

    def __contains__(self, key: str) -> bool:
        return key in _parts_of(self)[1] and self._remap(key) in _parts_of(self)[0]

    def keys(self) -> List[str]:
        """Return the input keys that have a value, under the state's names for them."""
        ud, input_keys = _parts_of(self)[:2]
        names: Dict[str, List[str]] = {}
        for name in _listed(input_keys):
            names.setdefault(self._remap(name), []).append(name)
        return [name for key in ud.keys() for name in names.get(key, ())]

    def update(self, other_userdata: Any) -> None:
        """Hand all keys of another userdata to the userdata behind this view, under their own
        names.
        """
        _parts_of(self)[0].update(other_userdata)

    def __reduce__(self) -> Any:
        return type(self), _parts_of(self)[:4]

    def _not_an_input(self, key: str) -> Exception:
        return smach.InvalidUserCodeError(
            "Userdata key '%s' is no input key of this state, which has %s; declare it in "
            'input_keys to read it.' % (key, _listed(_parts_of(self)[1]))
        )

    _ud = property(lambda self: _parts_of(self)[0], doc='The userdata behind the view.')
    _input = property(lambda self: _parts_of(self)[1], doc='The keys that may be read.')
    _output = property(lambda self: _parts_of(self)[2], doc='The keys that may be written.')
    _map = property(
        lambda self: _parts_of(self)[3], doc='The keys of the userdata by the names the state uses.'
    )


_parts_of: Callable[[Remapper], Any] = Remapper._parts.__get__  # type: ignore[attr-defined]
_set_parts: Callable[[Remapper, Any], None] = Remapper._parts.__set__  # type: ignore[attr-defined]


def _no_such_key(ud: UserData, key: object) -> str:
    return "There is no userdata key '%s', only %s" % (key, ud.keys())


def _shallow_copy(value: Any) -> Any:
    try:
        return copy.copy(value)
    except Exception:
        # whatever a lock, a socket or a user's own __copy__ raises: such a thing is shared
        return value


def _listed(keys: Iterable[str]) -> List[str]:
    return sorted(keys, key=str) if isinstance(keys, (set, frozenset)) else list(keys)


def _as_dict(userdata: Any) -> Mapping[str, Any]:
    if isinstance(userdata, Mapping):
        return userdata
    if isinstance(userdata, Remapper):
        return {key: userdata[key] for key in userdata.keys()}
    data: Mapping[str, Any] = userdata._data
    return data
