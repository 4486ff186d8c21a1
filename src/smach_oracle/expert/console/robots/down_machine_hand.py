"""Changes machines that are down, as the pages command: goto, edit and drop of oracle_state."""

from typing import Any, Mapping

from smach_oracle.store.errors import StoreError
from smach_oracle.store.stopped_trial import StoppedTrial

from ..commands.commands import CommandReply, PageCommand
from ..web.audit import Audit, Person
from .down_machines import DownMachines


class DownMachineHand:
    """Changes machines that are down, for all pages. Any thread may use it."""

    def __init__(self, machines: DownMachines, audit: Audit) -> None:
        self._machines, self._audit = machines, audit

    def carry_out(self, command: PageCommand, person: Person, page: int) -> CommandReply:
        """Change one machine, and record it. It takes as long as its store does."""
        reply = self._try(command, person)
        self._audit.record(person, command.name, reply.ok, reply.message, command.arguments)
        return reply

    def _try(self, command: PageCommand, person: Person) -> CommandReply:
        # the log of the store has who it was
        who = '{} (console, session {})'.format(person.expert, person.session)
        try:
            done = self._machines.change(
                command.arguments['down'],
                command.arguments['moment'],
                lambda stopped: _change(stopped, command.name, command.arguments, who),
            )
        except StoreError as err:
            return CommandReply(False, str(err))
        return CommandReply(True, done)


def _change(stopped: StoppedTrial, name: str, arguments: Mapping[str, Any], who: str) -> str:
    """Do it, and return what was done.

    :raises StoreError: where it cannot be done.
    """
    machine = stopped.trial.machine
    if name == 'goto_stored':
        stopped.go_to(arguments['label'], who)
        return '{} will go on at {}.'.format(machine, arguments['label'])
    if name == 'edit_stored':
        key, container = arguments['key'], arguments['container']
        stopped.edit(key, arguments['json'], container, who)
        return '{} of {} is changed.'.format(key, container)
    stopped.drop(who)
    return 'Trial {} of {} is dropped: it is never resumed.'.format(stopped.trial.number, machine)
