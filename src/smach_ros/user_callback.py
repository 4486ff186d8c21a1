"""A script's callback together with the userdata keys it may touch."""

from typing import Any, Callable, Dict, Iterable, Optional, Tuple

import smach


class UserCallback(object):
    """Calls ``cb(userdata, *values, *args, **kwargs)`` with userdata narrowed to the callback's own
    interface.

    A callback decorated with ``smach.cb_interface`` brings its keys along. Any other gets the keys
    its state declares for callbacks.

    :raises InvalidStateError: if ``cb`` cannot be called.
    """

    def __init__(
        self,
        what: str,
        cb: Callable[..., Any],
        args: Iterable[Any],
        kwargs: Optional[Dict[str, Any]],
        input_keys: Iterable[str],
        output_keys: Iterable[str],
    ) -> None:
        if not callable(cb):
            raise smach.InvalidStateError('%s must be callable, not %r' % (what, cb))
        self._cb = cb
        self._args = tuple(args)
        self._kwargs = dict(kwargs or {})
        decorated = smach.has_smach_interface(cb)
        # the formatter does not count a type comment, so that its lines would be too long
        # fmt: off
        self.input_keys = tuple(
            cb.get_registered_input_keys() if decorated else input_keys)  # type: ignore
        self.output_keys = tuple(
            cb.get_registered_output_keys() if decorated else output_keys)  # type: ignore
        self.outcomes: Tuple[str, ...] = tuple(cb.get_registered_outcomes()) if decorated else (
        )  # type: ignore
        # fmt: on

    def register_with(self, state: smach.State, decides: bool = False) -> None:
        """Give ``state`` the keys this callback brings along, and, if it decides the end, its
        outcomes.
        """
        state.register_input_keys(self.input_keys)
        state.register_output_keys(self.output_keys)
        if decides:
            state.register_outcomes(self.outcomes)

    def __call__(self, userdata: Any, *values: Any) -> Any:
        narrowed = smach.Remapper(userdata, self.input_keys, self.output_keys, {})
        return self._cb(narrowed, *(values + self._args), **self._kwargs)


def checked_slots(what: str, slots: Iterable[str], message: Any) -> Tuple[str, ...]:
    """Return ``slots`` as a tuple.

    It raises ``smach.InvalidStateError`` for one that is not a field of ``message``.
    """
    slots = tuple(slots)
    unknown = [slot for slot in slots if slot not in message.__slots__]
    if unknown:
        raise smach.InvalidStateError(
            '%s %s: no such field in %s, which has %s'
            % (what, unknown, message._type, list(message.__slots__))
        )
    return slots
