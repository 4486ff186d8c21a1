"""Containers whose class asks no hook: upstream's, and those of users that execute by themselves.

All that stands in there does so here: a class made of the container's own, and stand-ins in the
tables in which it keeps its states while it executes.
"""

from typing import Any, Dict, Optional, Tuple, cast

import smach

from ..identity import set_class
from .items import TrackedItems
from .runner import Runner

HOOK = 'execution_hook'  # the attribute by which our engine asks
_MADE: Dict[int, type] = {}  # by id of the class that it is made of, and keeps
_OWN = '_made_of'  # the class of the user


def asks_hook(cls: type) -> bool:
    """Whether containers of a class ask their `execution_hook`, as those of our engine do.

    A class that preempts the states by itself finds no runners there.
    """
    execute = getattr(cls, 'execute', None)
    request_preempt = getattr(cls, 'request_preempt', None)
    kinds: Tuple[Any, ...] = (smach.Concurrence, smach.Iterator)
    return hasattr(smach.Container, HOOK) and any(
        execute is kind.execute and request_preempt is kind.request_preempt for kind in kinds
    )


def have_asked(container: smach.Container) -> None:
    """Have a container ask its hook, by a class made for that.

    :raises TypeError: where its class cannot be extended.
    """
    set_class(container, _class_of(type(container)))


def ask_no_more(container: smach.Container) -> None:
    """Give a container its own class back."""
    made_of = type(container).__dict__.get(_OWN)
    if made_of is not None:
        set_class(container, made_of)


class _OfRunner:
    """A method of the runner of a stand-in, without a frame of its own on the stack."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, stand_in: Any, owner: Optional[type] = None) -> Any:
        return self if stand_in is None else getattr(stand_in._runner, self._name)


class StandIn:
    """Executes by a runner. In all else it is the user's state.

    Its place is in the tables of a container alone, and only while that executes. Whoever asks the
    container for its children gets the user's states.
    """

    def __init__(self, runner: Runner, state: smach.State) -> None:
        self._runner = runner
        self._state = state

    execute = _OfRunner('execute')
    request_preempt = _OfRunner('request_preempt')
    preempt_requested = _OfRunner('preempt_requested')
    recall_preempt = _OfRunner('recall_preempt')

    def __getattr__(self, name: str) -> Any:
        if name in ('_runner', '_state'):  # while it is copied
            raise AttributeError(name)
        return getattr(self._state, name)

    # that of the user's state: upstream's Iterator, and users, ask for it by `isinstance`
    __class__ = cast(Any, property(lambda self: type(self._state)))


def _real(state: object) -> Any:
    """Return the user's state, whatever stands in for it."""
    return state._state if type(state) is StandIn else state


class _Asking:
    """A Concurrence or an Iterator that asks its hook. In all else it is what its own class is."""

    _oracle_wrapper: Any

    def execute(self, *args: Any, **kwargs: Any) -> Optional[str]:
        base: Any = super()
        hook = self._oracle_wrapper

        with hook.execution(self) as execution:
            tables = _stand_in(self, hook) if execution.is_entered else {}
            try:
                execution.outcome = base.execute(*args, **kwargs)
            finally:
                _give_back(self, tables)
        outcome: Optional[str] = execution.outcome
        return outcome

    def get_children(self) -> Dict[str, smach.State]:
        base: Any = super()
        children: Dict[str, smach.State] = base.get_children()
        if self._oracle_wrapper.runners:
            return {label: _real(state) for label, state in children.items()}
        return children

    def __getitem__(self, label: str) -> smach.State:
        base: Any = super()
        state: smach.State = _real(base.__getitem__(label))
        return state

    def __reduce_ex__(self, protocol: Any) -> Tuple[Any, ...]:
        """Make the class again on unpickling: a class made here cannot be found by name."""
        base: Any = super()
        reduced = base.__reduce_ex__(max(2, protocol))
        return (rebuild, (type(self).__dict__[_OWN],), _at_rest(dict(reduced[2]))) + tuple(
            reduced[3:]
        )

    def _copy_input_keys(self, parent_ud: Optional[smach.UserData], ud: smach.UserData) -> None:
        base: Any = super()
        self._oracle_wrapper.take_inputs(
            self, lambda: base._copy_input_keys(parent_ud, ud), parent_ud
        )


def _stand_in(container: Any, hook: Any) -> Dict[str, Any]:
    """Put stand-ins into the tables of a container, and return what was there."""

    def of(label: str, state: Optional[smach.State]) -> Any:
        runner = hook.runners.get(label)
        return state if runner is None or state is None else StandIn(runner, state)

    if not isinstance(container, smach.Iterator):
        own = {'_states': container._states}
        container._states = {label: of(label, state) for label, state in own['_states'].items()}
        return own
    own = {'_items': container._items, '_state': container._state}
    container._items = hook.items(container, container._items)
    container._state = of(container._state_label, container._state)
    return own


def _give_back(container: Any, tables: Dict[str, Any]) -> None:
    for name, own in tables.items():
        now = getattr(container, name)
        if name == '_states' or isinstance(now, TrackedItems) or type(now) is StandIn:
            setattr(container, name, own)


def _at_rest(attributes: Dict[str, Any]) -> Dict[str, Any]:
    """Return the attributes of a container for a copy, as they are while it is at rest."""
    if '_states' in attributes:
        attributes['_states'] = {
            label: _real(state) for label, state in attributes['_states'].items()
        }
    if '_state' in attributes:
        attributes['_state'] = _real(attributes['_state'])
    items = attributes.get('_items')
    if isinstance(items, TrackedItems):
        attributes['_items'] = items.given
    return attributes


def _class_of(base: type) -> type:
    """Return the class of asking containers of class `base`, the same one each time."""
    made = _MADE.get(id(base))
    if made is None:
        metaclass: Any = type(base)
        made = metaclass(
            base.__name__,
            (_Asking, base),
            {
                '__module__': base.__module__,
                '__qualname__': base.__qualname__,
                '__doc__': base.__doc__,
                _OWN: base,
            },
        )
        made = _MADE.setdefault(id(base), made)
    return made


def rebuild(base: type) -> object:
    """Return a new, empty object of an asking class: for unpickling and copying."""
    cls: Any = _class_of(base)
    return cls.__new__(cls)
