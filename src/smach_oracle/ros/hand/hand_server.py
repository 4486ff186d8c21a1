"""The services by which operators hold the machines of a node, below `~oracle`.

They are called in threads of rospy's. Machines are kept weakly: a script may build one for each
trial. What was asked of a path outlives its machine, and holds for the next one there.
"""

import threading
import weakref
from collections import OrderedDict
from typing import Any, Callable, List, NamedTuple, Optional, Tuple

import genpy
import rospy

from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.control.control import Control
from smach_oracle.oracle.identity import remove_identical
from smach_oracle.oracle.operator_hand import OperatorHand
from smach_oracle.oracle.records.events import Event, EventKind, OwnObserver
from smach_oracle.oracle.scope.clock import Clock
from smach_oracle.oracle.settings.names import PathPattern
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


MOST_PATHS = 100  # a script may give each trial a machine of another name

# what a command asks of a machine that does not answer, such as one to come
Asks = Callable[[Control], object]


class _CommandedPath(NamedTuple):
    """The machines of a path in the order in which they have begun, and what the last is asked."""

    machines: Tuple['weakref.ref[OracleContainer]', ...]
    control: Control

    def alive(self) -> List[OracleContainer]:
        """Return the machines that are still there."""
        return [machine for machine in (each() for each in self.machines) if machine is not None]

    def answering(self) -> List[OracleContainer]:
        """Return those that answer a command: all that run, and the last one."""
        alive = self.alive()
        return [each for each in alive[:-1] if each.is_running()] + alive[-1:]

    def silent(self) -> List[Control]:
        """Return what is asked of the others, which do as they are asked without a word."""
        alive, answering = self.alive(), self.answering()
        others = [each for each in alive if not any(each is other for other in answering)]
        return [OperatorHand(each).control for each in others] if alive else [self.control]


class HandServer(OwnObserver):
    """Offers the hand on every machine that it watches."""

    observer_name = 'the publisher of ~oracle/control'
    without_it = 'consoles show an older state of the machine'

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: 'OrderedDict[str, _CommandedPath]' = OrderedDict()  # the latest last
        self._of_all = Control(Clock())  # what is asked of every machine, also of one to come
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
        """Offer the hand on a top-level machine. It obeys what its path, or all, were asked."""
        oracle = oracle_of(machine)
        oracle.events.observers.append(self._observer)
        self._viewers.listen_for(machine)
        with self._lock:
            known = self._known.get(oracle.path)
            orders = (self._of_all if known is None else known.control).orders()
        OperatorHand(machine).control.obey(orders)
        self.begins(machine)

    def begins(self, machine: OracleContainer) -> None:
        """Have a machine answer for its path from now on, as its next trial begins."""
        path, control = oracle_of(machine).path, OperatorHand(machine).control
        with self._lock:
            self._let_go(machine)  # it may have had another name
            known = self._known.pop(path, _CommandedPath((), control))
            others = [weakref.ref(each) for each in known.alive()]
            self._known[path] = _CommandedPath((*others, weakref.ref(machine)), control)
            while len(self._known) > MOST_PATHS:
                self._known.popitem(last=False)
        self._status.changed()

    def forget(self, machine: OracleContainer) -> None:
        """Take the hand off a machine that is about to come out of its oracle."""
        remove_identical(oracle_of(machine).events.observers, self._observer)
        with self._lock:
            self._let_go(machine)
        self._status.changed()

    def _let_go(self, machine: OracleContainer) -> None:
        for path, known in self._known.items():
            others = tuple(each for each in known.machines if each() is not machine)
            self._known[path] = known._replace(machines=others)

    def _on_event(self, event: Event) -> None:
        if event.kind in _CHANGES:
            self._status.changed()
        else:
            self._status.moved()

    def _hands(self) -> List[Tuple[str, OperatorHand]]:
        """The hands, by the paths of their machines."""
        with self._lock:
            known = sorted(self._known.items())
        return [(path, OperatorHand(machine)) for path, at in known for machine in at.answering()]

    # -- in threads of rospy's

    def _on_command(self, name: str) -> Callable[[CommandMachineRequest], CommandMachineResponse]:
        def handle(request: CommandMachineRequest) -> CommandMachineResponse:
            by, path = _caller(request), request.path.strip('/')

            def command(hand: OperatorHand) -> str:
                where = () if name in TREE_COMMANDS else (path,)
                return str(getattr(hand, name)(*where, by))

            asks = _asks(name, by)
            if asks is not None and not path and not self._hands():
                self._ask_silently(path, asks)
                return CommandMachineResponse(True, 'no machine is there; the next one obeys')
            return CommandMachineResponse(*self._each(path, command, asks))

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

        def asks(control: Control) -> None:
            act = control.remove_breakpoint if request.remove else control.set_breakpoint
            act(PathPattern(request.pattern))

        return SetBreakpointResponse(*self._each(request.path, command, asks))

    def _on_autonomy(self, request: SetAutonomyRequest) -> SetAutonomyResponse:
        return SetAutonomyResponse(
            *self._each(
                request.path,
                lambda hand: hand.set_autonomy(request.pattern, request.level, _caller(request)),
                lambda control: control.set_level(PathPattern(request.pattern), request.level),
            )
        )

    def _each(
        self, path: str, command: Command, asks: Optional[Asks] = None, only: bool = False
    ) -> Tuple[bool, str]:
        """Command the machines that are meant.

        Return whether one of them has obeyed, and what they say.

        :param asks: the same of a machine that does not answer, or is to come.
        :param only: one machine must be meant.
        """
        hands = self._hands()
        meant = [(each, hand) for each, hand in hands if _is_in(path, each)]
        if not meant or (only and len(meant) > 1):
            return False, 'there is no machine {!r} here; there are: {}'.format(
                path, ', '.join(each for each, _ in hands) or 'none; the first has yet to run'
            )
        told, refused = command_all(meant, command)
        if told and asks is not None:
            self._ask_silently(path, asks)
        self._status.changed()
        return bool(told), '; '.join(told or refused)

    def _ask_silently(self, path: str, asks: Asks) -> None:
        """Ask the machines that do not answer, and where all are meant those that are to come."""
        with self._lock:
            meant = [known for each, known in self._known.items() if _is_in(path, each)]
        of_all = [] if path.strip('/') else [self._of_all]
        for control in of_all + [control for known in meant for control in known.silent()]:
            asks(control)


def _asks(name: str, by: str) -> Optional[Asks]:
    """Return what a command asks of a machine that does not answer. None: nothing."""
    if name in ('pause', 'step'):
        return lambda control: control.pause(by)
    return None if name == 'confirm' else lambda control: control.resume()


def _is_in(path: str, machine: str) -> bool:
    """Whether a path is that of a machine or of a container in it. '' is in every one."""
    path = path.strip('/')
    return not path or (path + '/').startswith(machine + '/')


def _caller(request: Any) -> str:
    """Return who commands: as the request says, else the node that calls."""
    header = getattr(request, '_connection_header', None) or {}
    return str(request.by or header.get('callerid', ''))
