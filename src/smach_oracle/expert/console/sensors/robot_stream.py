"""A robot as a sensor: its description, joint states and transforms, followed while watched."""

import json
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy
import tf2_ros
from sensor_msgs.msg import JointState

from smach_oracle.geometry.transforms import from_quaternion

from .images import BrowserFile
from .robot_appearance import RobotAppearance, version_of
from .sensor_streams import SensorSample, SensorStream

DESCRIPTION = 'robot_description'
MOST_ROBOTS = 32
READ_AGAIN_S = 10.0
MOST_JOINTS = 2000


def robots_in(parameters: Sequence[str]) -> List[str]:
    """Return the names of robot descriptions among those of the parameter server."""
    return sorted(name for name in parameters if name.rsplit('/', 1)[-1] == DESCRIPTION)[
        :MOST_ROBOTS
    ]


class RobotStream(SensorStream):
    """Its samples are the poses of the links. Their geometries are in `appearance`."""

    def __init__(
        self, sensor: int, parameter: str, read: Callable[[str], Any] = rospy.get_param
    ) -> None:
        """`parameter` holds the robot's description. `read` gets it."""
        super().__init__(sensor, parameter, DESCRIPTION)
        self._read = read
        self._read_s = 0.0
        self._namespace = parameter[: -len(DESCRIPTION)]
        self._urdf: Optional[str] = None
        self._appearance: Optional[RobotAppearance] = None
        self._appearance_of = ''
        self._why_no_appearance = ''
        self._appearance_lock = threading.Lock()
        self._positions: Dict[str, float] = {}
        self._positions_lock = threading.Lock()
        self._transforms: Optional[_RecentTransforms] = None

    def appearance(self) -> RobotAppearance:
        """Return how to draw the robot. It takes some seconds for a new description.

        :raises ValueError: where the description cannot be used. The text says why.
        """
        with self._appearance_lock:
            urdf = self._urdf
            if not isinstance(urdf, str):
                raise ValueError('{} holds no text'.format(self.topic))
            if version_of(urdf) != self._appearance_of:
                self._appearance, self._why_no_appearance = None, ''
                self._appearance_of = version_of(urdf)
                try:
                    self._appearance = RobotAppearance(urdf)
                except ValueError as err:
                    self._why_no_appearance = str(err)
            if self._appearance is None:
                raise ValueError(self._why_no_appearance)
            return self._appearance

    def place_of(self, frame: str, stamp: rospy.Time) -> Tuple[Optional[np.ndarray], str]:
        """Return the pose of a tf frame in the robot's root link at a time.

        :returns: (3, 4) and '', or None and why it is not known.
        """
        appearance, transforms = self._appearance, self._transforms
        if appearance is None:
            return None, self._why_no_appearance or 'The robot is not known yet.'
        frame = frame.lstrip('/')
        prefix = self._namespace.strip('/') + '/'
        own = frame[len(prefix) :] if len(prefix) > 1 and frame.startswith(prefix) else frame
        root = frame[: len(frame) - len(own)] + appearance.robot.root
        at = transforms.at(root, frame, stamp) if transforms is not None else None
        if at is None:
            at = appearance.robot.poses(self._joints()).get(own)
        if at is None and transforms is not None:
            at = transforms.at(root, frame, rospy.Time(0))
        if at is None:
            return None, 'No transform from {} to {}.'.format(
                frame[:100] or '(no frame)', root[:100]
            )
        return at[:3], ''

    def take(self, message: JointState) -> None:
        """Take in joint states. Several nodes may each publish some of the joints."""
        with self._positions_lock:
            if len(self._positions) + len(message.name) < MOST_JOINTS:
                self._positions.update(
                    (name, value)
                    for name, value in zip(message.name, message.position)
                    if abs(value) < 1e6
                )  # not NaN
        super().take(message)

    def _joints(self) -> Dict[str, float]:
        with self._positions_lock:
            return dict(self._positions)

    def _begin(self) -> rospy.Subscriber:
        self._read_again()
        self._transforms = _RecentTransforms()
        subscriber = rospy.Subscriber(
            self._namespace + 'joint_states', JointState, self.take, queue_size=20
        )
        super().take(JointState())  # so that it is drawn though nobody publishes its joints
        return subscriber

    def _go_on(self) -> None:
        if time.monotonic() - self._read_s > READ_AGAIN_S:
            before = self._urdf
            self._read_again()
            if self._urdf != before:
                super().take(JointState())

    def _end(self) -> None:
        super()._end()
        if self._transforms is not None:
            self._transforms.stop()
        self._transforms = None
        with self._positions_lock:
            self._positions.clear()

    def _read_again(self) -> None:
        self._read_s = time.monotonic()
        try:
            self._urdf = self._read(self.topic)
        except (KeyError, rospy.ROSException, OSError) as err:
            rospy.logdebug('%s cannot be read: %s', self.topic, err)

    def _made(self, sample: SensorSample, width: int) -> Tuple[BrowserFile, str]:
        appearance, joints = self.appearance(), self._joints()
        return BrowserFile(
            'application/octet-stream', appearance.places(joints).tobytes(), {}
        ), json.dumps(
            {
                'kind': 'robot',
                'model': appearance.version,
                'root': appearance.robot.root,
                'joints': len(joints),
                'sequence': sample.sequence,
            }
        )


class _RecentTransforms:
    """The transforms of the last seconds."""

    def __init__(self) -> None:
        self._buffer = tf2_ros.Buffer(debug=False)
        self._listener = tf2_ros.TransformListener(self._buffer)

    def stop(self) -> None:
        self._listener.unregister()

    def at(self, target: str, source: str, stamp: rospy.Time) -> Optional[np.ndarray]:
        """4x4, or None where it is not known."""
        try:
            found = self._buffer.lookup_transform_core(target, source, stamp).transform
            return from_quaternion(
                (found.translation.x, found.translation.y, found.translation.z),
                (found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w),
            )
        except (tf2_ros.TransformException, ValueError):
            return None
