"""Read-only views of the objects a state may look at but not change.

A state that declares a key as input only gets a :class:`Const` around an object with attributes.
Plain values, containers, functions, classes and modules come as they are: they are either immutable
or not the object's own state.
"""

import collections
import copy
import enum
import types
from typing import Any, Dict, Iterator, Mapping, Set, Tuple

import smach

# Checked by identity before anything else, as nearly every value that passes through userdata is
# one of these.
PLAIN_TYPES = frozenset(
    (int, float, str, bool, type(None), bytes, list, tuple, dict, set, frozenset, complex)
)

_COME_AS_THEY_ARE: Tuple[type, ...] = (
    int,
    float,
    complex,
    str,
    bytes,
    bytearray,
    list,
    tuple,
    dict,
    set,
    frozenset,
    collections.deque,
    enum.Enum,
    type,
    types.FunctionType,
    types.BuiltinFunctionType,
    types.MethodType,
    types.ModuleType,
)


# What was said of attributes that were set on a view: (class of the object, attribute).
_warned_of: Set[Tuple[str, str]] = set()


class Const(object):
    """A view of an object, which stays as it is whatever is set on the view. So do the objects
    reached through it.

    An attribute that is set is kept with this view alone: who read the object through it reads what
    it has set, and nobody else does. Attributes cannot be deleted.
    """

    __slots__ = ('_obj', '_set_here')

    _set_here: Dict[str, Any]  # the attributes set on this view, by name

    def __init__(self, obj: Any) -> None:
        object.__setattr__(self, '_obj', obj)
        object.__setattr__(self, '_set_here', {})

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        """The class of the object behind the view, so that isinstance() answers as it would for the
        object.
        """
        return type(self._obj)

    def __getattr__(self, name: str) -> Any:
        if name in ('_obj', '_set_here'):  # not initialised yet: while being copied
            raise AttributeError(name)
        if name in self._set_here:
            return self._set_here[name]
        return get_const(getattr(self._obj, name))

    def __setattr__(self, name: str, value: Any) -> None:
        self._set_here[name] = value
        of = type(self._obj)
        what = ('%s.%s' % (of.__module__, of.__qualname__), name)
        if what not in _warned_of:
            _warned_of.add(what)
            smach.logwarn(
                "A state has set attribute '%s' of a %s that it gets as input only. The "
                'object in userdata stays as it was; to change it, declare its key as '
                'output, too. This is said once.' % (name, of.__name__)
            )

    def __delattr__(self, name: str) -> None:
        text = "Cannot delete attribute '%s': objects of input keys are read-only." % name
        smach.logerr(text)
        raise TypeError(text)

    def __getitem__(self, key: Any) -> Any:
        return get_const(self._obj[key])

    def __iter__(self) -> Iterator[Any]:
        return (get_const(item) for item in self._obj)

    def __contains__(self, item: Any) -> bool:
        return item in self._obj

    def __len__(self) -> int:
        return len(self._obj)

    def __bool__(self) -> bool:
        return bool(self._obj)

    def __eq__(self, other: object) -> bool:
        return bool(self._obj == _behind(other))

    def __ne__(self, other: object) -> bool:
        return bool(self._obj != _behind(other))

    def __hash__(self) -> int:
        return hash(self._obj)

    def __str__(self) -> str:
        return str(self._obj)

    def __repr__(self) -> str:
        return repr(self._obj)

    def __copy__(self) -> Any:
        return _completed(copy.copy(self._obj), self._set_here)

    def __deepcopy__(self, memo: Any) -> Any:
        return _completed(copy.deepcopy(self._obj, memo), copy.deepcopy(self._set_here, memo))

    def __reduce_ex__(self, protocol: Any) -> Any:
        obj = copy.copy(self) if self._set_here else self._obj
        return obj.__reduce_ex__(protocol)


class CallableConst(Const):
    """A view of an object that can be called. Apart, so that callable() is right about the
    others.
    """

    __slots__ = ()

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._obj(*args, **kwargs)


def _completed(twin: Any, attributes: Mapping[str, Any]) -> Any:
    for name, value in attributes.items():
        setattr(twin, name, value)
    return twin


def _behind(obj: Any) -> Any:
    return obj._obj if issubclass(type(obj), Const) else obj


def get_const(obj: Any) -> Any:
    """Return a read-only view of ``obj``.

    It is ``obj`` itself where that has no attributes of its own.
    """
    if (
        type(obj) in PLAIN_TYPES
        or issubclass(type(obj), Const)
        or isinstance(obj, _COME_AS_THEY_ARE)
    ):
        return obj
    if not hasattr(obj, '__dict__'):
        return obj
    return CallableConst(obj) if callable(obj) else Const(obj)
