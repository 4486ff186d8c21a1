"""Sources of the robot's health: ports, and functions of the user's own."""

from typing import Optional, Protocol

from smach_common.foreign import error_text, repr_of

from ..scope.background_call import BackgroundCall
from ..scope.scope import Scope
from ..settings.health import HealthFunction

# a function that takes longer counts as one that says no
FUNCTION_LIMIT_S = 2.0


class HealthPort(Protocol):
    """Knows one thing, or several, that must hold. Called from any thread. It does not wait."""

    def why_unwell(self, since_s: Optional[float] = None) -> str:
        """Return what is wrong, or was since that monotonic time, '' where all is well."""


class HealthFunctionPort:
    """A function of the user's own, called in a thread that nobody has to wait for.

    Several may ask at once: one call answers them all. What a call says after its limit, or after
    nobody waited for it any more, is dropped: the robot may be otherwise by now.
    """

    def __init__(self, name: str, function: HealthFunction) -> None:
        self._name = name
        self._function = function
        self._call: Optional[BackgroundCall] = None
        self._since_s = 0.0

    def why_unwell(self, scope: Scope) -> str:
        """Return what is wrong, '' where all is well, also where `scope` ends the asking."""
        now = scope.clock.now
        call = self._call
        if call is None or call.done.is_set():
            self._since_s = now()
            call = self._call = BackgroundCall(self._function, 'smach_oracle health')
            call.start()
        if not scope.wait(self._since_s + FUNCTION_LIMIT_S - now(), call.done):
            is_late = now() >= self._since_s + FUNCTION_LIMIT_S
            return '{} does not return'.format(self._name) if is_late else ''
        self._call = None
        if now() > self._since_s + FUNCTION_LIMIT_S:
            return '{} took too long'.format(self._name)
        return self._in_words(call)

    def _in_words(self, call: BackgroundCall) -> str:
        if call.error is not None:
            return '{}: {}'.format(self._name, error_text(call.error))
        result = call.result
        if isinstance(result, str):
            return '{}: {}'.format(self._name, result) if result else ''
        if isinstance(result, bool) or type(result).__name__ == 'bool_':  # numpy's, too
            return '' if result else self._name
        return "{} returned {}; True and '' are well".format(self._name, repr_of(result))
