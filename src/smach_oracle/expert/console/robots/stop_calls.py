"""Calls that stop a robot's machine: each in a thread of its own, also while the master is away.

All services of a node have one address. It is looked up while the master answers.
"""
import threading
from concurrent.futures import Future
from typing import Any, Callable, Dict, Iterable

import rosgraph
import rospy

from smach_oracle.oracle.errors import OracleError
from smach_oracle.srv import CommandMachine, CommandMachineRequest, CommandMachineResponse

PREEMPT = '/oracle/preempt'
NOT_REACHED = (rospy.ServiceException, rospy.ROSException, OSError)


class StopError(OracleError):
    """A service that stops could not be reached. The text says why."""


class _AtAddress(rospy.ServiceProxy):
    """Calls a service at a known address, and asks no master."""

    def __init__(self, name: str, kind: type, address: str) -> None:
        super().__init__(name, kind)
        self._address = address

    def _get_service_uri(self, request: object) -> str:
        return self._address


class StopCalls:
    """One thread calls `look_up`, any thread the rest."""

    def __init__(self) -> None:
        self._addresses: Dict[str, str] = {}  # by robot

    def look_up(self, robots: Iterable[str]) -> None:
        """Ask the master where their services are. What is known stays where it does not say."""
        master = rosgraph.Master(rospy.get_name())
        for robot in robots:
            try:
                self._addresses[robot] = str(master.lookupService(robot + PREEMPT))
            except rosgraph.MasterError as err:
                rospy.logdebug('%s: %s', robot, err)

    def call(self, robot: str, service: str,
             request: CommandMachineRequest) -> CommandMachineResponse:
        """Call it where it was found last, else where the master says it is.

        :raises StopError: where it cannot be reached.
        """
        address = self._addresses.get(robot)
        if address:
            try:
                return _AtAddress(service, CommandMachine, address)(request)
            except NOT_REACHED as err:
                rospy.logdebug('%s is not at %s: %s', service, address, err)
        try:
            return rospy.ServiceProxy(service, CommandMachine)(request)
        except NOT_REACHED as err:
            raise StopError('{} cannot be reached: {}'.format(service, err)) from err


def in_thread(work: Callable[[], Any]) -> 'Future[Any]':
    """Begin some work in a thread of its own: it waits for no other."""
    future: 'Future[Any]' = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except Exception as err:
            future.set_exception(err)
    threading.Thread(target=run, name='stop', daemon=True).start()
    return future
