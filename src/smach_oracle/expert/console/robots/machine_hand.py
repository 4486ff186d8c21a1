"""Holds robots' machines, as the pages command: stop, pause, resume, step, confirm, breakpoints.

To stop and to pause waits for nothing here, and is refused for nothing.
"""

import asyncio
from concurrent.futures import Future
from typing import Any, Callable, Collection, Dict, List, Mapping, Optional, Tuple

from smach_oracle.ros.service_calls import CALL_LIMIT_S, ServerGoneError, call_service
from smach_oracle.srv import (
    CommandMachine,
    CommandMachineRequest,
    SetBreakpoint,
    SetBreakpointRequest,
)

from ...stop_calls import StopCalls, in_thread
from ..commands.commands import CommandReply, PageCommand
from ..commands.holding import MACHINE_STARTS, MANY_STOPPED
from ..web.audit import Audit, Person

MOST_AT_ONCE = 4  # equal stops that are under way: a robot that hangs needs no more of them
SERVICES = {
    'stop_machine': 'preempt',
    'pause_machine': 'pause',
    'resume_machine': 'resume',
    'step_machine': 'step',
    'confirm_state': 'confirm',
    'set_breakpoint': 'breakpoint',
}
NO_HAND = 'There is no robot {} here whose machines can be held.'
NO_MACHINE = 'There is no machine {} of {} here.'
MANY_TOLD = 'Asked to {}: {} of {}.'
NO_ANSWER = '{} has not answered within {:.0f} s: whether it has heard that is not known.'
# by robot the paths of its containers
Holdable = Callable[[], Mapping[str, Collection[str]]]
# why a robot that is silent is not commanded, or '' where it may be
Refusal = Callable[[str, Optional[float]], str]
_Key = Tuple[str, str, str]


class MachineHand:
    """Sends the commands of operators to machines, for all pages."""

    def __init__(
        self,
        holdable: Holdable,
        audit: Audit,
        refusal: Refusal,
        calls: Optional[StopCalls] = None,
        call: Callable[..., Any] = call_service,
    ) -> None:
        """
        :param holdable: the robots that can be held.
        :param refusal: of a robot, and the newest beat that the page had seen.
        :param call: calls a service, as call_service does.
        """
        self._holdable = holdable
        self._audit = audit
        self._refusal = refusal
        self._calls = calls or StopCalls()
        self._call = call
        self._under_way: Dict[_Key, List['Future[Any]']] = {}  # of the loop alone

    async def stop(self, command: PageCommand, person: Person) -> CommandReply:
        """Stop or pause, whatever else is at work. It is called in the loop."""
        many = MANY_STOPPED.get(command.name)
        by = _by(person)
        reply = await (self._stop_many(command, many, by) if many else self._stop(command, by))
        self._note(command, person, reply)
        return reply

    async def _stop_many(self, command: PageCommand, each_is_sent: str, by: str) -> CommandReply:
        """Stop or pause several robots at once: none of them waits for another."""
        robots = sorted(set(command.arguments['robots']) or self._holdable())
        stops = [
            PageCommand(command.number, each_is_sent, {'robot': robot, 'path': ''})
            for robot in robots
        ]
        replies = await asyncio.gather(*(self._stop(stop, by) for stop in stops))
        refused = [
            '{}: {}'.format(robot, reply.message)
            for robot, reply in zip(robots, replies)
            if not reply.ok
        ]
        count = len(robots) - len(refused)
        word = 'stop' if each_is_sent == 'stop_machine' else 'pause'
        told = MANY_TOLD.format(word, count, len(robots))
        return CommandReply(bool(robots) and not refused, ' '.join([told, *refused]))

    async def _stop(self, command: PageCommand, by: str) -> CommandReply:
        robot = command.arguments['robot']
        why = self._unknown(command)
        if why:
            return CommandReply(False, why)
        try:
            response = await asyncio.wait_for(
                asyncio.shield(asyncio.wrap_future(self._begin(command, by))), CALL_LIMIT_S
            )
        except ServerGoneError as err:
            return CommandReply(False, str(err))
        except asyncio.TimeoutError:
            return CommandReply(False, NO_ANSWER.format(robot, CALL_LIMIT_S))
        return CommandReply(response.ok, response.message)

    def _begin(self, command: PageCommand, by: str) -> 'Future[Any]':
        robot, path = command.arguments['robot'], command.arguments['path']
        key = (robot, command.name, path)
        for each in [
            each for each, calls in self._under_way.items() if all(call.done() for call in calls)
        ]:
            del self._under_way[each]
        under_way = [call for call in self._under_way.get(key, []) if not call.done()]
        if len(under_way) < MOST_AT_ONCE:
            under_way.append(
                in_thread(
                    lambda: self._calls.call(
                        robot, _service(command), CommandMachineRequest(path, by)
                    )
                )
            )
        self._under_way[key] = under_way
        return under_way[-1]

    def carry_out(self, command: PageCommand, person: Person, page: int) -> CommandReply:
        """Do what is no stop, and record it. It takes as long as the robot's service does."""
        reply = self._try(command, _by(person))
        self._note(command, person, reply)
        return reply

    def _try(self, command: PageCommand, by: str) -> CommandReply:
        arguments = command.arguments
        why = self._unknown(command)
        if not why and command.name in MACHINE_STARTS:
            why = self._refusal(arguments['robot'], arguments['seen'])
        if why:
            return CommandReply(False, why)
        kind, request = CommandMachine, CommandMachineRequest(arguments['path'], by)
        if command.name == 'set_breakpoint':
            kind, request = (
                SetBreakpoint,
                SetBreakpointRequest(
                    arguments['pattern'], arguments['remove'], arguments['path'], by
                ),
            )
        try:
            response = self._call(_service(command), kind, request)
        except ServerGoneError as err:
            return CommandReply(False, str(err))
        return CommandReply(response.ok, response.message)

    def _unknown(self, command: PageCommand) -> str:
        """Return why the console knows no such machine, or '' where it does."""
        robot, path = command.arguments['robot'], command.arguments['path']
        holdable = self._holdable()
        if robot not in holdable:
            return NO_HAND.format(robot)
        return '' if not path or path in holdable[robot] else NO_MACHINE.format(path, robot)

    def _note(self, command: PageCommand, person: Person, reply: CommandReply) -> None:
        self._audit.record(person, command.name, reply.ok, reply.message, command.arguments)


def _service(command: PageCommand) -> str:
    return '{}/oracle/{}'.format(command.arguments['robot'], SERVICES[command.name])


def _by(person: Person) -> str:
    """To stop needs no name."""
    return person.expert or 'somebody at {}'.format(person.client)
