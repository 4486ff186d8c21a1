"""A hand behind the manipulation interface: one command at a time, in lock-step."""

import threading
import time
from typing import Callable, Optional

import numpy as np
import rospy
from geometry_msgs.msg import Twist, Vector3
from std_msgs.msg import Header

from smach_oracle.geometry.transforms import from_quaternion
from smach_oracle.msg import TeleopCommand, TeleopState

from .hand_driver import GripResult, StuckError

# wall time in which a command must be carried out. A gripper may take many periods
_ANSWER_S = 90.0


class GoalEndedError(Exception):
    """The interface's goal has ended before its work was done."""


class TeleoperationClient:
    """The topics of the manipulation interface. Hands of both arms share it."""

    def __init__(self, interface: str, operator: str) -> None:
        """`interface`: name of the node, e.g. manipulation_interface."""
        self._operator = operator
        self._seq = 0
        self._changed = threading.Condition()
        self._state: Optional[TeleopState] = None
        self._publisher = rospy.Publisher(
            interface + '/command', TeleopCommand, queue_size=10, tcp_nodelay=True
        )
        self._subscriber = rospy.Subscriber(
            interface + '/state', TeleopState, self._heard, queue_size=100, tcp_nodelay=True
        )

    def wait_for_goal(self, query_id: str, limit_s: float) -> bool:
        """Wait until the interface works on a question. Return whether it does.

        :raises GoalEndedError: where the node ends.
        """
        return self._wait(lambda state: state.query_id == query_id, limit_s)

    def send(self, command: TeleopCommand) -> TeleopState:
        """Send a command, and wait until it is carried out.

        :raises StuckError: where it is refused, or no answer comes.
        :raises GoalEndedError: where the interface has no goal any more.
        """
        self._seq += 1
        command.seq, command.operator = self._seq, self._operator
        self._publisher.publish(command)
        key = (self._seq, self._operator)
        carried_out = self._wait(lambda state: (state.seq, state.sender) == key, _ANSWER_S)
        state = self._state
        if not carried_out or state is None:
            raise StuckError('the manipulation interface does not answer')
        if not state.query_id:
            raise GoalEndedError('the manipulation interface has no goal any more')
        if state.refused:
            raise StuckError('command refused: ' + state.refused)
        return state

    def let_go(self, arm: str) -> None:
        """Release the dead-man."""
        self._seq += 1
        self._publisher.publish(TeleopCommand(seq=self._seq, operator=self._operator, arm=arm))

    def _wait(self, holds: Callable[[TeleopState], bool], limit_s: float) -> bool:
        until_s = time.monotonic() + limit_s
        with self._changed:
            while not rospy.is_shutdown():
                if self._state is not None and holds(self._state):
                    return True
                left_s = until_s - time.monotonic()
                if left_s <= 0:
                    return False
                self._changed.wait(min(left_s, 0.5))
        raise GoalEndedError('the node goes down')

    def _heard(self, state: TeleopState) -> None:
        with self._changed:
            self._state = state
            self._changed.notify_all()


class TopicHand:
    """A DrivenHand of one arm. See hand_driver.py."""

    def __init__(self, client: TeleoperationClient, arm: str, base: str, period: float) -> None:
        """`base`: the robot's base frame. `period`: s, of the interface.

        :raises StuckError: as TeleoperationClient.send does.
        :raises GoalEndedError: likewise.
        """
        self.arm = arm
        self.period = period
        self._client = client
        self._base = base
        self._state = self._send(np.zeros(6))

    def tool(self) -> np.ndarray:
        """See DrivenHand."""
        at, turn = self._state.tool_pose.position, self._state.tool_pose.orientation
        return from_quaternion((at.x, at.y, at.z), (turn.x, turn.y, turn.z, turn.w))

    def move(self, twist: np.ndarray, turn_freely: bool = False) -> str:
        """See DrivenHand."""
        self._state = self._send(twist, turn_freely=turn_freely)
        limit: str = self._state.limit
        return limit

    def grip(self, gap: float, effort: float) -> GripResult:
        """See DrivenHand."""
        self._state = self._send(np.zeros(6), move_gripper=True, gripper=gap, gripper_effort=effort)
        while self._state.gripper_moving:
            self._state = self._send(np.zeros(6))
        return GripResult(self._state.gripper, self._state.gripper_stalled)

    def let_go(self) -> None:
        """Release the dead-man."""
        self._client.let_go(self.arm)

    def _send(self, twist: np.ndarray, **more: object) -> TeleopState:
        return self._client.send(
            TeleopCommand(
                header=Header(frame_id=self._base),
                arm=self.arm,
                dead_man=True,
                twist=Twist(Vector3(*twist[:3]), Vector3(*twist[3:])),
                **more,
            )
        )
