"""Whole trees: puts a machine, and the machines nested in it, under one oracle each."""
from typing import Any, Dict, Iterator, List, Optional, Set, Tuple

import smach

from .config import Settings
from .container import OracleContainer
from .errors import ConfigError
from .ledger import Ledger
from .question import Expert
from .tree import Tree

_MADE: Dict[Tuple[type, type], type] = {}
_STATIC = ('add', 'add_auto')  # static in StateMachine, so that the order of bases alone does not find the user's


def wrapped_class(oracle_class: type, base: type) -> Any:
    """Return the class of machines of class `base` under `oracle_class`; the same one each time."""
    made = _MADE.get((oracle_class, base))
    if made is None:
        namespace: Dict[str, Any] = {'__module__': base.__module__, '__qualname__': base.__qualname__,
                                     '__doc__': base.__doc__, '_wrapped_of': (oracle_class, base)}
        for name in _STATIC + _new_names(oracle_class):
            own = _static(base, name)
            if own is not _static(smach.StateMachine, name):
                namespace[name] = own
        metaclass: Any = type(base)
        made = metaclass(base.__name__, (oracle_class, base), namespace)
        made = _MADE.setdefault((oracle_class, base), made)
    return made


def _new_names(oracle_class: type) -> Tuple[str, ...]:
    """Return the public names that no StateMachine has: a user's class that uses one keeps it."""
    return tuple(name for name in dir(oracle_class)
                 if not name.startswith('_') and not hasattr(smach.StateMachine, name))


def _static(cls: type, name: str) -> Any:
    for each in cls.__mro__:
        if name in each.__dict__:
            return each.__dict__[name]
    return None


def two_classes(cls: type) -> Optional[Tuple[type, type]]:
    """Return what a class made by wrapping is made of, None for other classes."""
    made_of: Optional[Tuple[type, type]] = cls.__dict__.get('_wrapped_of')
    return made_of


def rebuild(oracle_class: type, base: type) -> Any:
    """Return a new, empty object of a wrapped class: for unpickling and copying."""
    cls = wrapped_class(oracle_class, base)
    return cls.__new__(cls)


def wrap_machine(oracle_class: type, given: Any, settings: Settings, nested: bool, name: str,
                 expert: Optional[Expert], strict: bool, recover: bool) -> Any:
    """Wrap a machine and what is nested in it; see OracleContainer.wrap.

    :raises ConfigError: for what is no machine or cannot be wrapped, and for settings that do not fit it; a
        bare machine then stays bare.
    """
    if not isinstance(given, smach.StateMachine):
        raise ConfigError('machine', given, 'a smach.StateMachine')
    machine: Any = given
    again = isinstance(given, OracleContainer)
    before = machine._oracle.settings if again else None
    try:
        if again:
            _wrap_again(machine, settings, name, expert, recover)
        else:
            _change_class(machine, oracle_class)
            machine._oracle = Ledger(machine, Tree(recover, expert), settings, name)
        _put_in_order(machine, settings, nested, strict)
    except ConfigError:  # as if nobody had tried
        if before is not None:
            _configure(machine, before)
        else:
            _unwrap(machine)
        raise
    return machine


def _put_in_order(machine: Any, settings: Settings, nested: bool, strict: bool) -> None:
    machine._oracle.strict = strict
    machine._oracle.nested = nested
    adopt(machine)
    _configure(machine, settings)
    for container in containers_in(machine):
        container._oracle.strict = strict
    _check_keys(machine)
    for container in containers_in(machine):
        container._oracle.bring_up_to_date()


def _configure(machine: Any, settings: Settings) -> None:
    """Hand the settings to a machine and to those below it that have none of their own."""
    for container in containers_in(machine):
        if container is machine or container._oracle.inherits:
            container._oracle.configure(settings)


def _wrap_again(machine: Any, settings: Settings, name: str, expert: Optional[Expert], recover: bool) -> None:
    ledger = machine._oracle
    for container in containers_in(machine):
        container._remove_oracle()
    ledger.tree.recover = recover
    ledger.name = name or ledger.name
    if expert is not None:
        ledger.tree.expert = expert
    _configure(machine, settings)


def _unwrap(machine: Any) -> None:
    """Give a machine that could not be wrapped, and what was wrapped with it, back as it was."""
    for container in containers_in(machine) if isinstance(machine, OracleContainer) else []:
        made_of = two_classes(type(container))
        if made_of is not None and (container is machine or container._oracle.inherits):
            container._remove_oracle()
            container.__class__ = made_of[1]
            del container.__dict__['_oracle']


def _change_class(machine: Any, oracle_class: type) -> None:
    try:
        machine.__class__ = wrapped_class(oracle_class, type(machine))
    except TypeError as err:
        raise ConfigError('machine', machine, 'a machine whose class can be extended ({})'.format(err)) from err
    quicken(machine)


def quicken(machine: Any) -> None:
    """Give an object a fresh dictionary of its attributes.

    CPython reads from it much faster than from one that was looked at, or whose object has changed its class.
    """
    machine.__dict__ = dict(machine.__dict__)


def adopt(machine: Any) -> None:
    """Wrap what is nested in a wrapped machine and is not wrapped yet; let all of it share one tree.

    :raises ConfigError: for a machine whose class cannot be extended.
    """
    parent = machine._oracle
    for below, child in _machines_below(machine, ()):
        if not isinstance(child, OracleContainer):
            if not parent.nested:
                continue
            _change_class(child, OracleContainer)
            child._oracle = Ledger(child, parent.tree, parent.settings, '')
            child._oracle.inherits = True
            child._oracle.strict = parent.strict
        ledger = child._oracle
        if child is not machine and (ledger.parent is None or ledger.tree is not parent.tree):
            _move_below(child, parent, below)
        ledger.nested = parent.nested
        adopt(child)


def _move_below(child: Any, parent: Ledger, below: Tuple[str, ...]) -> None:
    """Make a wrapped machine one below `parent`: it may have been on its own, or below another machine, before."""
    ledger = child._oracle
    child._remove_oracle()  # it may go by another name here, or not be wanted
    ledger.parent, ledger.below = parent, below
    ledger.join(parent.tree)
    if ledger.inherits:
        ledger.strict = parent.strict
    ledger.configure(parent.settings if ledger.inherits else ledger.settings)


def _machines_below(container: Any, below: Tuple[str, ...]) -> Iterator[Tuple[Tuple[str, ...], Any]]:
    """Yield the state machines nested in a container, through Concurrences and Iterators, but none inside those."""
    children = container._states if isinstance(container, smach.StateMachine) else container.get_children()
    for label, state in list(children.items()):
        path = below + (label,)
        if isinstance(state, smach.StateMachine):
            yield path, state
        elif isinstance(state, smach.Container):
            yield from _machines_below(state, path)


def containers_in(machine: Any) -> List[Any]:
    """Return a wrapped machine and all wrapped machines nested in it, each once."""
    found: List[Any] = []
    waiting = [machine]
    while waiting:
        container = waiting.pop(0)
        if not any(container is each for each in found):
            found.append(container)
            waiting.extend(child for _, child in _machines_below(container, ()) if isinstance(child, OracleContainer))
    return found


def _check_keys(machine: Any) -> None:
    """Raise ConfigError for settings of states that are nowhere in the tree, or warn where not strict."""
    known: Set[str] = set()
    for container in containers_in(machine):
        path = container._oracle.relative_path
        for label in container._oracle.labels():
            known.update((label, '{}/{}'.format(path, label) if path else label))
    settings = machine._oracle.settings
    named = [('states.' + name, name) for name in settings.states]
    named += [('interfaces.{}.states'.format(offer.name), name) for offer, states in settings.interfaces
              for name in states]
    for key, name in named:
        if name not in known:
            err = ConfigError(key, name, 'the states of the machine: ' + ', '.join(sorted(known)))
            if machine._oracle.strict:
                raise err
            smach.logwarn(str(err))
