"""The smallest piece of a machine: a state with outcomes, userdata keys and a preempt flag."""

from typing import Any, Callable, Dict, Iterable, Optional, Sequence, Set, Tuple

import smach

__all__ = ['State', 'CBState']


class State(object):
    """Base of everything that can be put into a container.

    ``outcomes`` are the names ``execute`` may return. ``input_keys`` may be read and
    ``output_keys`` written through the userdata it is given. ``io_keys`` are both.
    """

    def __init__(
        self,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        both = _key_set(io_keys, 'io_keys')
        self._outcomes: Set[str] = set(outcomes)
        self._input_keys: Set[str] = _key_set(input_keys, 'input_keys') | both
        self._output_keys: Set[str] = _key_set(output_keys, 'output_keys') | both
        self._preempt_requested = False

    def execute(self, ud: Any) -> Any:
        """Do the work of this state and return one of its outcomes. Every subclass has its own."""
        raise NotImplementedError('%s has no execute()' % type(self).__name__)

    def register_outcomes(self, new_outcomes: Iterable[str]) -> None:
        """Add to the names ``execute`` may return."""
        self._outcomes = self._outcomes.union(new_outcomes)

    def get_registered_outcomes(self) -> Tuple[str, ...]:
        """Return the names ``execute`` may return."""
        return tuple(self._outcomes)

    def register_io_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are both read and written."""
        keys = tuple(keys)
        self.register_input_keys(keys)
        self.register_output_keys(keys)

    def register_input_keys(self, keys: Iterable[str]) -> None:
        """Add keys that ``execute`` reads."""
        self._input_keys = self._input_keys.union(keys)

    def get_registered_input_keys(self) -> Tuple[str, ...]:
        """Return the keys ``execute`` reads."""
        return tuple(self._input_keys)

    def register_output_keys(self, keys: Iterable[str]) -> None:
        """Add keys that ``execute`` writes."""
        self._output_keys = self._output_keys.union(keys)

    def get_registered_output_keys(self) -> Tuple[str, ...]:
        """Return the keys ``execute`` writes."""
        return tuple(self._output_keys)

    def request_preempt(self) -> None:
        """Ask the state to stop early. It is up to ``execute`` to notice."""
        self._preempt_requested = True

    def service_preempt(self) -> None:
        """Say that the request was noticed and acted upon."""
        self._preempt_requested = False

    def recall_preempt(self) -> None:
        """Take the request back."""
        self._preempt_requested = False

    def preempt_requested(self) -> bool:
        """Whether the state was asked to stop and has not serviced the request."""
        return self._preempt_requested


class CBState(State):
    """A state whose work is a callback: ``cb(userdata, *cb_args, **cb_kwargs)`` returns the
    outcome.

    A callback decorated with :class:`smach.cb_interface` brings its own outcomes and keys along.
    """

    def __init__(
        self,
        cb: Callable[..., Any],
        cb_args: Sequence[Any] = (),
        cb_kwargs: Optional[Dict[str, Any]] = None,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        State.__init__(self, outcomes, input_keys, output_keys, io_keys)
        self._cb = cb
        self._cb_args = cb_args
        self._cb_kwargs = {} if cb_kwargs is None else cb_kwargs
        if smach.has_smach_interface(cb):
            interface: Any = cb
            self.register_outcomes(interface.get_registered_outcomes())
            self.register_input_keys(interface.get_registered_input_keys())
            self.register_output_keys(interface.get_registered_output_keys())

    def execute(self, ud: Any) -> Any:
        """Call the callback."""
        return self._cb(ud, *self._cb_args, **self._cb_kwargs)


def _key_set(keys: Iterable[str], argument: str) -> Set[str]:
    if isinstance(keys, str):
        raise TypeError(
            '%s must be a list of keys, not the single string %r; write [%r]'
            % (argument, keys, keys)
        )
    return set(keys)
