"""A robot as a sensor: its description, its joint states and its transforms, followed while somebody looks at it."""
import json
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy
import tf2_ros
from sensor_msgs.msg import JointState

from ...geometry.transforms import from_quaternion
from .images import Encoded
from .robot_model import RobotModel, version_of
from .sensors import Sensor

DESCRIPTION = 'robot_description'
MOST_ROBOTS = 32
READ_AGAIN_S = 10.0
MOST_JOINTS = 2000


def robots_in(parameters: Sequence[str]) -> List[str]:
    """Of the parameter server's names, those of robot descriptions."""
    return sorted(name for name in parameters if name.rsplit('/', 1)[-1] == DESCRIPTION)[:MOST_ROBOTS]


class RobotSensor(Sensor):
    """Its frames are where the links are; what they look like is in `model`."""

    def __init__(self, sensor: int, parameter: str, read: Callable[[str], Any] = rospy.get_param) -> None:
        """`parameter` holds the robot's description; `read` gets it."""
        super().__init__(sensor, parameter, DESCRIPTION)
        self._read = read
        self._read_s = 0.0
        self._namespace = parameter[:-len(DESCRIPTION)]
        self._urdf: Optional[str] = None
        self._model: Optional[RobotModel] = None
        self._model_of = ''
        self._why_no_model = ''
        self._model_lock = threading.Lock()
        self._positions: Dict[str, float] = {}
        self._positions_lock = threading.Lock()
        self._transforms: Optional[_Transforms] = None

    def model(self) -> RobotModel:
        """What it looks like; takes some seconds for a new one.

        :raises ValueError: where the description cannot be used; the text says why.
        """
        with self._model_lock:
            urdf = self._urdf
            if not isinstance(urdf, str):
                raise ValueError('{} holds no text'.format(self.topic))
            if version_of(urdf) != self._model_of:
                self._model, self._why_no_model, self._model_of = None, '', version_of(urdf)
                try:
                    self._model = RobotModel(urdf)
                except ValueError as err:
                    self._why_no_model = str(err)
            if self._model is None:
                raise ValueError(self._why_no_model)
            return self._model

    def place_of(self, frame: str, stamp: rospy.Time) -> Tuple[Optional[np.ndarray], str]:
        """(3, 4): the robot's root link from a frame at a time; or why not."""
        model, transforms = self._model, self._transforms
        if model is None:
            return None, self._why_no_model or 'The robot is not known yet.'
        frame = frame.lstrip('/')
        prefix = self._namespace.strip('/') + '/'
        own = frame[len(prefix):] if len(prefix) > 1 and frame.startswith(prefix) else frame
        root = frame[:len(frame) - len(own)] + model.robot.root
        at = transforms.at(root, frame, stamp) if transforms is not None else None
        if at is None:
            at = model.robot.poses(self._joints()).get(own)
        if at is None and transforms is not None:
            at = transforms.at(root, frame, rospy.Time(0))
        if at is None:
            return None, 'No transform from {} to {}.'.format(frame[:100] or '(no frame)', root[:100])
        return at[:3], ''

    def take(self, message: JointState) -> None:
        """Several nodes may tell of some of the joints each."""
        with self._positions_lock:
            if len(self._positions) + len(message.name) < MOST_JOINTS:
                self._positions.update((name, value) for name, value in zip(message.name, message.position)
                                       if abs(value) < 1e6)  # not NaN
        super().take(message)

    def _joints(self) -> Dict[str, float]:
        with self._positions_lock:
            return dict(self._positions)

    def _begin(self) -> Any:
        self._read_again()
        self._transforms = _Transforms()
        subscriber = rospy.Subscriber(self._namespace + 'joint_states', JointState, self.take, queue_size=20)
        super().take(JointState())  # so that it is seen though its joints be silent
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

    def _made(self, frame: Any, width: int) -> Tuple[Encoded, str]:
        model, joints = self.model(), self._joints()
        return Encoded('application/octet-stream', model.places(joints).tobytes(), {}), json.dumps({
            'kind': 'robot', 'model': model.version, 'root': model.robot.root, 'joints': len(joints),
            'sequence': frame.sequence})


class _Transforms:
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
            return from_quaternion((found.translation.x, found.translation.y, found.translation.z),
                                   (found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w))
        except (tf2_ros.TransformException, ValueError):
            return None
