"""A machine that goes from A through KITCHEN, a nested machine with LOOK, to B."""

import contextlib
from typing import Iterator, Tuple
from unittest import mock

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.ros.hand import hand_server
from smach_oracle.ros.hand.hand_server import HandServer

from .fake_ros import Offered, SilentPublisher, fake_ros


@contextlib.contextmanager
def kitchen_at_hand() -> Iterator[Tuple[Offered, OracleContainer]]:
    """The machine, and what an operator's hand on it offers."""
    inner, made = (smach.StateMachine(outcomes=['done']) for _ in range(2))
    with inner:
        smach.StateMachine.add('LOOK', _done())
    with made:
        smach.StateMachine.add('A', _done(), {'done': 'KITCHEN'})
        smach.StateMachine.add('KITCHEN', inner, {'done': 'B'})
        smach.StateMachine.add('B', _done())
    machine = OracleContainer.wrap(made, name='task')
    with fake_ros() as offered, mock.patch.multiple(
        hand_server, ControlPublisher=SilentPublisher, ViewerCommands=SilentPublisher
    ):
        server = HandServer()
        server.watch(machine)
        yield offered, machine


def _done() -> smach.State:
    return smach.CBState(lambda ud: 'done', outcomes=['done'])
