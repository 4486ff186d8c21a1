"""The ROS side of a bench. Imported where ROS is asked for, and nowhere else."""

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.ros.attachment import attachments
from smach_oracle.ros.container import OracleContainer as RosOracleContainer


class NodeSide:
    """Attaches a machine on the bench to its node, and detaches it."""

    container_class = RosOracleContainer

    def __init__(self, machine: smach.StateMachine) -> None:
        self._machine = machine

    def leave(self) -> None:
        """Take the machine off the node: its events, its introspection and their callbacks."""
        if isinstance(self._machine, OracleContainer):
            attachments().detach(self._machine)
