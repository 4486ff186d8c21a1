"""Calls of services that end in time, whatever the server does."""

import threading
import time
from typing import Optional

import genpy
import rospy

from smach_oracle.oracle.errors import OracleError

CALL_LIMIT_S = 5.0
NOT_REACHED = (rospy.ServiceException, rospy.ROSException, OSError)


class ServerGoneError(OracleError):
    """A server could not be reached, or does not answer. The text names it and the reason."""


class _AtAddress(rospy.ServiceProxy):
    """Calls a service at a known address, and asks no master."""

    def __init__(self, name: str, kind: type, address: str) -> None:
        super().__init__(name, kind)
        self._address = address

    def _get_service_uri(self, request: object) -> str:
        return self._address


def call_where_it_was(address: str, name: str, kind: type, request: object) -> genpy.Message:
    """Call a service at an address. If it cannot be reached there, ask the master where it is.

    The service may be called twice, so the request must do no harm the second time.

    :param address: as the master has told before, or '' where it is not known.
    """
    if address:
        try:
            return _AtAddress(name, kind, address)(request)
        except NOT_REACHED as err:
            rospy.logdebug('%s is not at %s: %s', name, address, err)
    return rospy.ServiceProxy(name, kind)(request)


class ServiceCall(threading.Thread):
    """One call, made in a thread of its own.

    rospy sets no time limit, and a server that is frozen or cut off never answers.
    """

    def __init__(self, name: str, kind: type, request: object, address: str = '') -> None:
        """`address`: where it is called first, as by `call_where_it_was`."""
        super().__init__(name='call {}'.format(name), daemon=True)
        self.since_s = time.monotonic()
        self._service = (name, kind)
        self._request = request
        self._address = address
        self._response: Optional[genpy.Message] = None
        self._error: Optional[Exception] = None
        self.start()

    def run(self) -> None:
        """Make the call."""
        try:
            self._response = call_where_it_was(self._address, *self._service, self._request)
        except Exception as err:  # raised again by `result`, in the caller's thread
            self._error = err

    def result(self, limit_s: float) -> genpy.Message:
        """Return the response. An error that the call has raised is raised again.

        :raises ServerGoneError: where the server cannot be reached or does not answer in time.
        """
        self.join(limit_s)
        name = self._service[0]
        if self.is_alive():
            raise ServerGoneError('{} does not answer'.format(name))
        if isinstance(self._error, NOT_REACHED):
            raise ServerGoneError(
                '{} cannot be reached: {}'.format(name, self._error)
            ) from self._error
        if self._error is not None:
            raise self._error
        return self._response


def call_service(
    name: str, kind: type, request: object, limit_s: float = CALL_LIMIT_S
) -> genpy.Message:
    """Call a service, waiting no longer than `limit_s`.

    :raises ServerGoneError: if there is no such service now, or no answer in time.
    """
    return ServiceCall(name, kind, request).result(limit_s)
