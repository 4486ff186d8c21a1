"""Classes of wrapped machines: each made of an OracleContainer and the machine's own class."""

from typing import Any, Dict, Optional, Tuple

import smach

from ..errors import SettingsError
from ..identity import set_class

_MADE: Dict[Tuple[int, int], type] = {}  # by ids of both classes, which it keeps
# static in StateMachine, so that the order of bases alone does not find the user's
_STATIC = ('add', 'add_auto')
_STEP = '_update_once'


def wrapped_class(oracle_class: type, base: type) -> type:
    """Return the class of machines of class `base` under `oracle_class`, the same one each time."""
    key = id(oracle_class), id(base)
    made = _MADE.get(key)
    if made is None:
        if _static(base, _STEP) is not _static(smach.StateMachine, _STEP):
            text = '{}.{} does not run: under an oracle, the oracle makes each step'
            smach.logwarn(text.format(base.__name__, _STEP))
        namespace: Dict[str, object] = {
            '__module__': base.__module__,
            '__qualname__': base.__qualname__,
            '__doc__': base.__doc__,
            '_wrapped_of': (oracle_class, base),
        }
        for name in _STATIC + _new_names(oracle_class):
            own = _static(base, name)
            if own not in (None, _static(smach.StateMachine, name)):
                namespace[name] = own
        metaclass: Any = type(base)
        made = metaclass(base.__name__, (oracle_class, base), namespace)
        made = _MADE.setdefault(key, made)
    return made


def _new_names(oracle_class: type) -> Tuple[str, ...]:
    """Return the public names that no StateMachine has: a user's class that uses one keeps it."""
    return tuple(
        name
        for name in dir(oracle_class)
        if not name.startswith('_') and not hasattr(smach.StateMachine, name)
    )


def _static(cls: type, name: str) -> object:
    for each in cls.__mro__:
        if name in each.__dict__:
            return each.__dict__[name]
    return None


def two_classes(cls: type) -> Optional[Tuple[type, type]]:
    """Return what a class made by wrapping is made of, None for other classes."""
    made_of: Optional[Tuple[type, type]] = cls.__dict__.get('_wrapped_of')
    return made_of


def rebuild(oracle_class: type, base: type) -> object:
    """Return a new, empty object of a wrapped class: for unpickling and copying."""
    cls: Any = wrapped_class(oracle_class, base)
    return cls.__new__(cls)


def change_class(machine: smach.StateMachine, oracle_class: type) -> None:
    """Make a machine one of `oracle_class` and of its own class.

    :raises SettingsError: where its class cannot be extended.
    """
    try:
        set_class(machine, wrapped_class(oracle_class, type(machine)))
    except TypeError as err:
        raise SettingsError(
            'machine', machine, 'a machine whose class can be extended ({})'.format(err)
        ) from err
