"""The ROS side of a bench; imported where ROS is asked for, and nowhere else."""
from typing import Any, Dict, Iterator, List, Tuple

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.ros import introspection
from smach_oracle.ros.attachment import attachments
from smach_oracle.ros.container import OracleContainer as RosOracleContainer

from .places import places_of

_CALLBACKS = ('_start_cbs', '_transition_cbs', '_termination_cbs')


class NodeSide:
    """What a machine has from its node while it is on the bench."""

    container_class = RosOracleContainer

    def __init__(self, machine: smach.StateMachine) -> None:
        self._machine = machine
        self._before: Dict[int, List[Any]] = {
            id(callbacks): list(callbacks) for callbacks in _callbacks_of(machine)}

    def leave(self) -> None:
        """Take the machine off the node: its events, its introspection and their callbacks."""
        if isinstance(self._machine, OracleContainer):
            attachments().detach(self._machine)
        for callbacks in _callbacks_of(self._machine):
            before = self._before.get(id(callbacks), [])
            callbacks[:] = [each for each in callbacks
                            if each in before or not _is_of_introspection(each)]


def _callbacks_of(machine: smach.StateMachine) -> Iterator[List[Any]]:
    """Yield the lists of callbacks of a machine and of all containers in it."""
    containers = [machine] + [place.state for place in places_of(machine) if place.is_container]
    for container in containers:
        for name in _CALLBACKS:
            yield getattr(container, name, [])


def _is_of_introspection(callback: Tuple[Any, ...]) -> bool:
    return type(callback[0]).__module__.startswith(introspection.__name__ + '.')
