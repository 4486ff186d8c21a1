"""Calls that stop a robot's machine, also while the master is away or hangs.

All services of a node have one address. It is looked up while the master answers.
"""

import threading
from concurrent.futures import Future
from typing import Any, Callable, Dict, Iterable

import rosgraph
import rospy

from smach_oracle.ros.master_watch import timed_master
from smach_oracle.ros.service_calls import NOT_REACHED, ServerGoneError, call_where_it_was
from smach_oracle.srv import CommandMachine, CommandMachineRequest, CommandMachineResponse

PREEMPT = '/oracle/preempt'
LOOK_UP_PERIOD_S = 1.5


class StopCalls:
    """One thread calls `look_up`, any thread the rest."""

    def __init__(self) -> None:
        self._addresses: Dict[str, str] = {}  # by robot

    def look_up(self, robots: Iterable[str]) -> None:
        """Ask the master where their services are. What is known stays where it does not say."""
        master = timed_master()
        for robot in robots:
            try:
                self._addresses[robot] = str(master.lookupService(robot + PREEMPT))
            except rosgraph.MasterError as err:
                rospy.logdebug('%s: %s', robot, err)

    def address_of(self, robot: str) -> str:
        """Return where its services were found last, or '' where they never were."""
        return self._addresses.get(robot, '')

    def call(
        self, robot: str, service: str, request: CommandMachineRequest
    ) -> CommandMachineResponse:
        """Call it where it was found last, else where the master says it is.

        :raises ServerGoneError: where it cannot be reached.
        """
        try:
            return call_where_it_was(self.address_of(robot), service, CommandMachine, request)
        except NOT_REACHED as err:
            raise ServerGoneError('{} cannot be reached: {}'.format(service, err)) from err


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
