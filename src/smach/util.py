"""The shutdown check, and callbacks that declare outcomes and keys."""

from typing import Any, Callable, Iterable, Tuple

import smach

__all__ = [
    'is_shutdown',
    'set_shutdown_check',
    'cb_interface',
    'has_smach_interface',
    'CBInterface',
]


def is_shutdown() -> bool:
    """Whether every machine of this process should stop: never, until a check is handed in."""
    return False


def set_shutdown_check(cb: Callable[[], bool]) -> None:
    """Let ``cb()`` decide from now on whether machines should stop."""
    smach.is_shutdown = cb


def has_smach_interface(obj: Any) -> bool:
    """Whether ``obj`` declares outcomes and userdata keys the way a state does."""
    return all(
        hasattr(obj, name)
        for name in (
            'get_registered_outcomes',
            'get_registered_input_keys',
            'get_registered_output_keys',
        )
    )


class CBInterface(object):
    """A callable together with the outcomes and userdata keys it declares."""

    def __init__(
        self,
        cb: Callable[..., Any],
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        self._cb = cb
        self._outcomes = list(outcomes)
        self._input_keys = set(input_keys).union(io_keys)
        self._output_keys = set(output_keys).union(io_keys)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._cb(*args, **kwargs)

    def get_registered_outcomes(self) -> Tuple[str, ...]:
        """Return the outcomes the callback may return."""
        return tuple(self._outcomes)

    def get_registered_input_keys(self) -> Tuple[str, ...]:
        """Return the keys the callback reads."""
        return tuple(self._input_keys)

    def get_registered_output_keys(self) -> Tuple[str, ...]:
        """Return the keys the callback writes."""
        return tuple(self._output_keys)


class cb_interface(object):
    """Decorate a callback with an interface.

    An example: ``@cb_interface(outcomes=['done'], input_keys=['x'])``.
    """

    def __init__(
        self,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        self._interface = (outcomes, input_keys, output_keys)

    def __call__(self, cb: Callable[..., Any]) -> CBInterface:
        return CBInterface(cb, *self._interface)
