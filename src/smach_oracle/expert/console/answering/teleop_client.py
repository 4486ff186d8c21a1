"""One manipulation interface as the console drives it: commands out, states in."""

import math
import time
from typing import Any, Dict, List, Optional

import rosgraph
import rosgraph.names
import rospy
from geometry_msgs.msg import Twist, Vector3
from std_msgs.msg import Header

from smach_oracle.interfaces.manipulation.cartesian_drive import GRIPPER_OPEN
from smach_oracle.msg import CollisionBoxes, TeleopCommand, TeleopState

from .driving_control import DrivingControl, along

ANSWER_S = 2.0  # after which a command in lock-step counts as lost
STOP = {'frame': 'base', 'linear': (0, 0, 0), 'angular': (0, 0, 0), 'gripper': '', 'arm': ''}


class TeleopClient:
    """One manipulation interface: its topics, and what a front end needs of its parameters."""

    def __init__(self, action: str) -> None:
        self.control = DrivingControl()
        self.state: Optional[TeleopState] = None
        self._seq, self._sent_s = 0, -math.inf
        self._in_steps = bool(rospy.get_param(action + '/lock_step', False))
        self._base = str(rospy.get_param(action + '/base_frame', 'base_footprint'))
        self._camera = str(rospy.get_param(action + '/camera_frame', ''))
        arms = rospy.get_param(action + '/arms', {})
        self._tools = {name: str(arm.get('tool', '')) for name, arm in arms.items()}
        self._linear = float(rospy.get_param(action + '/limits/linear', 0.25))
        self._angular = float(rospy.get_param(action + '/limits/angular', 1.0))
        self._open = float(rospy.get_param(action + '/gripper_open', GRIPPER_OPEN))
        self._publisher = rospy.Publisher(
            action + '/command', TeleopCommand, queue_size=2, tcp_nodelay=True
        )
        # number of boxes in the robot's collision map. None means there is no map
        self.boxes: Optional[int] = None
        self._subscribers = [
            rospy.Subscriber(
                action + '/state', TeleopState, self._on_state, queue_size=2, tcp_nodelay=True
            ),
            rospy.Subscriber(
                rosgraph.names.namespace(action) + 'collision_map', CollisionBoxes, self._on_map
            ),
        ]

    def _on_state(self, state: TeleopState) -> None:
        self.state = state

    def _on_map(self, message: CollisionBoxes) -> None:
        self.boxes = len(message.names)

    def busy(self, operator: str) -> bool:
        """Whether a world in lock-step has not carried out the last command yet.

        More would wait, and move the arm after it was let go.
        """
        answered = self.state is not None and (self.state.sender, self.state.seq) == (
            operator,
            self._seq,
        )
        return self._in_steps and not answered and time.monotonic() - self._sent_s < ANSWER_S

    @property
    def arms(self) -> List[str]:
        """Return the names of the arms."""
        return sorted(self._tools)

    @property
    def arm(self) -> str:
        """The arm that the interface has chosen for the state or moved last, or '' if unknown."""
        return self.state.arm if self.state is not None else ''

    def frames(self, arm: str) -> Dict[str, str]:
        """The tf frames by the names that a page uses for them. Unknown ones are left out."""
        frames = {'tool': self._tools.get(arm, ''), 'base': self._base, 'camera': self._camera}
        return {name: frame for name, frame in frames.items() if frame}

    def send(self, operator: str, arguments: Dict[str, Any], held: bool) -> None:
        """Publish one command, along the axes of the frame named."""
        arm = arguments['arm'] or self.arm
        frame = self.frames(arm).get(arguments['frame'], self._base)
        self._seq, self._sent_s = self._seq + 1, time.monotonic()
        self._publisher.publish(
            TeleopCommand(
                header=Header(frame_id=frame, stamp=rospy.Time.now()),
                operator=operator,
                seq=self._seq,
                arm=arm,
                dead_man=held,
                twist=Twist(
                    Vector3(*along(arguments['frame'], arguments['linear'], self._linear)),
                    Vector3(*along(arguments['frame'], arguments['angular'], self._angular)),
                ),
                move_gripper=held and bool(arguments['gripper']),
                gripper=self._open if arguments['gripper'] == 'open' else 0.0,
            )
        )

    def release(self, operator: str) -> None:
        """Stop the arm now."""
        self.send(operator, STOP, False)

    def stop_whoever_drives(self) -> None:
        """Stop the arm now, also where another front end moves it."""
        self.send('', STOP, False)

    def stop(self) -> None:
        """Take the topics down."""
        self._publisher.unregister()
        for subscriber in self._subscribers:
            subscriber.unregister()
