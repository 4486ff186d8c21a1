"""Borders of an operator's hand on a machine that runs, and waits for it."""

import contextlib
import threading
from typing import Any, Callable, Iterator

from waiting import wait_for

from smach_oracle.oracle.operator_hand import OperatorHand
from smach_oracle.srv import CommandMachineRequest, SendMachineRequest

from .border import TAKEN, Border, refused
from .fake_ros import Offered
from .kitchen_machine import kitchen_at_hand
from .values import message, words


@contextlib.contextmanager
def _waits(needs_confirmation: bool) -> Iterator[Offered]:
    """A machine that waits before task/KITCHEN/LOOK; in the end it is preempted."""
    with kitchen_at_hand() as (offered, machine):
        hand = OperatorHand(machine)
        if needs_confirmation:
            hand.set_autonomy('KITCHEN/LOOK', 'confirm', 'eva')
        else:
            hand.set_breakpoint('KITCHEN/LOOK', 'eva')
        thread = threading.Thread(target=machine.execute, daemon=True)
        thread.start()
        try:
            assert wait_for(
                lambda: any(each.state == 'LOOK' and each.held_by for each in hand.status().active)
            )
            yield offered
        finally:
            hand.preempt('eva')
            hand.resume('eva')
            thread.join(20)
            assert not thread.is_alive(), 'it comes to its end'


def _command(name: str) -> Callable[[Any], str]:
    def take(request: Any) -> str:
        with _waits(name == 'confirm') as offered:
            reply = offered.call('~oracle/' + name, request)
        return TAKEN if reply.ok else refused(reply.message)

    return take


_paths = words('', 'task', 'task/KITCHEN', '/task/KITCHEN/', 'task/KITCHEN/LOOK', 'other')
_commands = message(CommandMachineRequest, {'path': _paths, 'by': words('eva', 'ann', '')})
BORDERS = [
    *[
        Border('service {}, while it waits'.format(name), _commands, _command(name))
        for name in ('step', 'confirm', 'resume')
    ],
    Border(
        'service go_to, while it waits',
        message(
            SendMachineRequest,
            {'path': _paths, 'state': words('B', 'KITCHEN/LOOK', 'LOOK'), 'by': words('eva', '')},
        ),
        _command('go_to'),
    ),
]
