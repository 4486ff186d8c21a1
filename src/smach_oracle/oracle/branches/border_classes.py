"""Classes of the Concurrences and Iterators of a wrapped tree, made of their own classes."""

from typing import Any, Dict, Optional, Tuple

import smach

from ..identity import own_attributes, set_class
from ..machine.nesting import BORDER
from ..recovery.stack_room import too_deep_below, too_deep_here
from .border import Border, ConcurrenceBorder, IteratorBorder
from .stand_in import real

_MADE: Dict[int, type] = {}  # by id of the class that it is made of, and keeps


class _Bordered:
    """A Concurrence or an Iterator whose plain states have oracles of their own.

    In all else it is what its own class makes it.
    """

    _oracle_border: Border

    def execute(self, *args: object, **kwargs: object) -> object:
        base: Any = super()
        border = self._oracle_border
        if not border.enter():
            return base.execute(*args, **kwargs)
        outcome, error = None, None
        try:
            outcome = base.execute(*args, **kwargs)
            return outcome
        except BaseException as err:
            error = err
            border.tell_cause(err)
            if border.top is not None and too_deep_below(err) is None:
                too_deep = too_deep_here(border.top, err)
                if too_deep is not None:
                    raise too_deep from None
            raise
        finally:
            border.ended(outcome, error)
            border.leave()

    def get_children(self) -> Dict[str, smach.State]:
        base: Any = super()
        children: Dict[str, smach.State] = base.get_children()
        if any(real(state) is not state for state in children.values()):
            return {label: real(state) for label, state in children.items()}
        return children

    def __getitem__(self, label: str) -> smach.State:
        base: Any = super()
        state: smach.State = real(base.__getitem__(label))
        return state

    def __reduce_ex__(self, protocol: Any) -> Tuple[Any, ...]:
        """Make the class again on unpickling: a class made here cannot be found by name."""
        base: Any = super()
        reduced = base.__reduce_ex__(max(2, protocol))
        attributes = self._oracle_border.without_places(dict(reduced[2]))
        return (rebuild_bordered, (type(self).__dict__['_bordered_of'],), attributes) + tuple(
            reduced[3:]
        )

    def _copy_input_keys(self, parent_ud: Optional[smach.UserData], ud: smach.UserData) -> None:
        base: Any = super()
        base._copy_input_keys(parent_ud, ud)
        self._oracle_border.take_over_userdata()


class _BorderedIterator(_Bordered):
    _oracle_border: IteratorBorder

    def _copy_input_keys(self, parent_ud: Optional[smach.UserData], ud: smach.UserData) -> None:
        base: Any = super()
        kept = self._oracle_border.keys_to_keep(parent_ud)
        base._copy_input_keys(parent_ud, ud)
        for key, value in kept.items():
            ud[key] = value


def put_border(container: smach.Container) -> None:
    """Give a Concurrence or an Iterator a border, and the class that uses it.

    :raises TypeError: where its class cannot be extended.
    """
    cls = bordered_class(type(container))
    set_class(container, cls)
    is_iterator = isinstance(container, smach.Iterator)
    own_attributes(container)[BORDER] = (IteratorBorder if is_iterator else ConcurrenceBorder)(
        container
    )


def take_border_away(container: smach.Container) -> None:
    """Give a Concurrence or an Iterator back as it was before `put_border`."""
    made_of = type(container).__dict__.get('_bordered_of')
    if made_of is not None:
        set_class(container, made_of)
        del own_attributes(container)[BORDER]


def bordered_class(base: type) -> type:
    """Return the class of bordered containers of class `base`, the same one each time."""
    made = _MADE.get(id(base))
    if made is None:
        mixin = _BorderedIterator if issubclass(base, smach.Iterator) else _Bordered
        metaclass: Any = type(base)
        made = metaclass(
            base.__name__,
            (mixin, base),
            {
                '__module__': base.__module__,
                '__qualname__': base.__qualname__,
                '__doc__': base.__doc__,
                '_bordered_of': base,
            },
        )
        made = _MADE.setdefault(id(base), made)
    return made


def rebuild_bordered(base: type) -> object:
    """Return a new, empty object of a bordered class: for unpickling and copying."""
    cls: Any = bordered_class(base)
    return cls.__new__(cls)
