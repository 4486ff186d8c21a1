"""The services by which operators hold the machines of a node, below `~oracle`.

They are called in threads of rospy's. Machines are kept weakly: a script may build one for each
trial.
"""

import weakref
from typing import Any, Callable, Dict, List, Tuple

import genpy
import rospy

from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.identity import remove_identical
from smach_oracle.oracle.operator_hand import OperatorHand
from smach_oracle.oracle.records.events import Event, EventKind, OwnObserver
from smach_oracle.srv import (
    CommandMachine,
    CommandMachineRequest,
    CommandMachineResponse,
    SendMachine,
    SendMachineRequest,
    SendMachineResponse,
    SetAutonomy,
    SetAutonomyRequest,
    SetAutonomyResponse,
    SetBreakpoint,
    SetBreakpointRequest,
    SetBreakpointResponse,
)

from .all_at_once import Command, command_all
from .status_publisher import ControlPublisher
from .viewer_commands import ViewerCommands

NAMESPACE = '~oracle/'
TREE_COMMANDS = ('pause', 'resume', 'preempt')
PLACE_COMMANDS = ('step', 'confirm')
_CHANGES = frozenset(
    [
        EventKind.TRIAL_START,
        EventKind.TRIAL_END,
        EventKind.HOLD_START,
        EventKind.HOLD_END,
        EventKind.OPERATOR_COMMAND,
        EventKind.SENT,
    ]
)


class HandServer(OwnObserver):
    """Offers the hand on every machine that it watches."""

    observer_name = 'the publisher of ~oracle/control'
    without_it = 'consoles show an older state of the machine'

    def __init__(self) -> None:
        self._machines: Dict[str, 'weakref.ref[OracleContainer]'] = {}  # by path
        self._observer = self._on_event  # the same object each time it is looked for
        self._status = ControlPublisher(self._hands)
        self._viewers = ViewerCommands()
        for name in TREE_COMMANDS + PLACE_COMMANDS:
            self._offer(name, CommandMachine, self._on_command(name))
        self._offer('go_to', SendMachine, self._on_send)
        self._offer('breakpoint', SetBreakpoint, self._on_breakpoint)
        self._offer('autonomy', SetAutonomy, self._on_autonomy)
        self._status.start()  # last: whom it reaches may look the services up at once

    @staticmethod
    def _offer(name: str, kind: type, handle: Callable[[Any], genpy.Message]) -> None:
        rospy.Service(NAMESPACE + name, kind, handle)

    def watch(self, machine: OracleContainer) -> None:
        """Offer the hand on a top-level machine, in place of an earlier one of its path."""
        oracle = oracle_of(machine)
        self._machines[oracle.path] = weakref.ref(machine)
        oracle.events.observers.append(self._observer)
        self._viewers.listen_for(machine)
        self._status.changed()

    def forget(self, machine: OracleContainer) -> None:
        """Take the hand off a machine that is about to come out of its oracle."""
        remove_identical(oracle_of(machine).events.observers, self._observer)
        for path, known in dict(self._machines).items():
            if known() is machine:
                del self._machines[path]
        self._status.changed()

    def _on_event(self, event: Event) -> None:
        if event.kind in _CHANGES:
            self._status.changed()
        else:
            self._status.moved()

    def _hands(self) -> List[Tuple[str, OperatorHand]]:
        """The hands, by the paths of their machines."""
        alive = [(path, known()) for path, known in sorted(self._machines.items())]
        return [(path, OperatorHand(machine)) for path, machine in alive if machine is not None]

    # -- in threads of rospy's

    def _on_command(self, name: str) -> Callable[[CommandMachineRequest], CommandMachineResponse]:
        def handle(request: CommandMachineRequest) -> CommandMachineResponse:
            by = _caller(request)
            if name in TREE_COMMANDS:
                return CommandMachineResponse(
                    *self._each(request.path, lambda hand: str(getattr(hand, name)(by)))
                )
            path = request.path.strip('/')
            return CommandMachineResponse(
                *self._each(path, lambda hand: str(getattr(hand, name)(path, by)))
            )

        return handle

    def _on_send(self, request: SendMachineRequest) -> SendMachineResponse:
        return SendMachineResponse(
            *self._each(
                request.path,
                lambda hand: hand.go_to(
                    request.path, request.state, _caller(request), request.confirm_repeats
                ),
                only=True,
            )
        )

    def _on_breakpoint(self, request: SetBreakpointRequest) -> SetBreakpointResponse:
        def command(hand: OperatorHand) -> str:
            act = hand.remove_breakpoint if request.remove else hand.set_breakpoint
            return act(request.pattern, _caller(request))

        return SetBreakpointResponse(*self._each(request.path, command))

    def _on_autonomy(self, request: SetAutonomyRequest) -> SetAutonomyResponse:
        return SetAutonomyResponse(
            *self._each(
                request.path,
                lambda hand: hand.set_autonomy(request.pattern, request.level, _caller(request)),
            )
        )

    def _each(self, path: str, command: Command, only: bool = False) -> Tuple[bool, str]:
        """Command the machines that are meant.

        Return whether one of them has obeyed, and what they say.

        :param only: one machine must be meant.
        """
        hands = self._hands()
        meant = [(each, hand) for each, hand in hands if _is_in(path, each)]
        if not meant or (only and len(meant) > 1):
            return False, 'there is no machine {!r} here; there are: {}'.format(
                path, ', '.join(each for each, _ in hands) or 'none; the first has yet to run'
            )
        told, refused = command_all(meant, command)
        self._status.changed()
        return bool(told), '; '.join(told or refused)


def _is_in(path: str, machine: str) -> bool:
    """Whether a path is that of a machine or of a container in it. '' is in every one."""
    path = path.strip('/')
    return not path or (path + '/').startswith(machine + '/')


def _caller(request: Any) -> str:
    """Return who commands: as the request says, else the node that calls."""
    header = getattr(request, '_connection_header', None) or {}
    return str(request.by or header.get('callerid', ''))
