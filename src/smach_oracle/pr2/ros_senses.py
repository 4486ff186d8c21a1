"""What a robot tells of itself: joint states, transforms, camera; all of one moment where its world gives snapshots."""
import collections
import threading
import time
from typing import Any, Callable, Deque, Dict, List, Optional

import numpy as np
import rospy
import tf2_ros
from sensor_msgs.msg import CameraInfo, Image, JointState

from smach_oracle.srv import Snapshot

from ...geometry.transforms import from_quaternion
from ...ros.images import ImageError, colour_of, depth_of, intrinsics_of
from ...ros.settling import Settling, live_connections
from .interface import Frame, RobotError

KEPT = {Image: 4}  # messages of a topic
KEPT_OTHERS = 200
AGAIN_S = 3.0  # wall s after which joint states that were asked for are asked for anew


class Recent:
    """The last few messages of a topic, to be had by their stamp."""

    def __init__(self, topic: str, kind: Any) -> None:
        self.name = rospy.resolve_name(topic)
        self._settling = Settling()
        self._arrived = threading.Condition()
        kept = KEPT.get(kind, KEPT_OTHERS)
        self._messages: Deque[Any] = collections.deque(maxlen=kept)
        self._subscriber = rospy.Subscriber(topic, kind, self._heard, queue_size=kept, buff_size=1 << 24,
                                            tcp_nodelay=True)

    def connected(self) -> bool:
        """Whether somebody publishes; takes a moment, where that is new, until whoever does surely knows of us."""
        connections = live_connections(self._subscriber)
        if connections:
            self._settling.wait(connections)
        return bool(connections)

    def at(self, stamp: rospy.Time, timeout_s: float) -> Any:
        """The message with this stamp; waits for it, by the wall's clock. Raises RobotError."""
        return self._wait(lambda message: message.header.stamp == stamp, timeout_s)

    def next(self, timeout_s: float) -> Any:
        """The first message that comes from now on. Raises RobotError."""
        with self._arrived:
            before = list(self._messages)
        return self._wait(lambda message: not any(message is old for old in before), timeout_s)

    def _wait(self, fits: Callable[[Any], bool], timeout_s: float) -> Any:
        def found() -> Optional[Any]:
            return next((message for message in reversed(self._messages) if fits(message)), None)
        with self._arrived:
            message = self._arrived.wait_for(found, timeout_s)
        if message is None:
            raise RobotError('no message on {} within {:g} s'.format(self.name, timeout_s))
        return message

    def _heard(self, message: Any) -> None:
        with self._arrived:
            self._messages.append(message)
            self._arrived.notify_all()


class RosSenses:
    """
    :param snapshot: service smach_oracle/Snapshot; '': none, the next messages count.
    :param timeout_s: wall s to wait for anything.
    """

    def __init__(self, snapshot: str, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._snapshot = rospy.ServiceProxy(snapshot, Snapshot) if snapshot else None
        self._states = Recent('joint_states', JointState)
        self._starting = threading.Lock()
        # a world that gives snapshots sends images only when asked; a robot's stream is for those who really look
        self._camera = self._subscribe() if snapshot else []
        self._buffer = tf2_ros.Buffer(rospy.Duration(60.0))
        self._listener = tf2_ros.TransformListener(self._buffer, tcp_nodelay=True)

    def joints(self) -> Dict[str, float]:
        """Joint positions, rad or m, now. Raises RobotError where none come."""
        message = self._states_of_snapshot() if self._snapshot else self._next_states()
        return dict(zip(message.name, message.position))

    def transform(self, target: str, source: str) -> np.ndarray:
        """4x4, target from source, now. Raises RobotError where it is not known."""
        stamp = self._shot(False) if self._snapshot else self._next_states().header.stamp
        return self._looked_up(target, source, stamp)

    def see(self, base: str, camera: str) -> Frame:
        """A frame of the camera, with the pose of the frame `camera` in `base` at its moment.

        :raises RobotError: where none comes, its pose is not known, or it holds no image.
        """
        topics = self._camera_topics()
        if self._snapshot:
            stamp = self._shot(True)
            colour, depth, info = (topic.at(stamp, self._timeout_s) for topic in topics)
        else:
            depth = topics[1].next(self._timeout_s)
            stamp = depth.header.stamp
            colour, info = (topics[number].at(stamp, self._timeout_s) for number in (0, 2))
        pose = self._looked_up(base, camera, stamp)
        try:
            return Frame(stamp.to_sec(), colour_of(colour), depth_of(depth), intrinsics_of(info), pose)
        except ImageError as err:
            raise RobotError('camera: {}'.format(err)) from err

    def _camera_topics(self) -> List[Recent]:
        """Colour, depth and camera info, subscribed to by the first who wants to see."""
        with self._starting:
            self._camera = self._camera or self._subscribe()
        for topic in self._camera:
            self._connected(topic)
        return self._camera

    @staticmethod
    def _subscribe() -> List[Recent]:
        return [Recent('head_camera/rgb/image_raw', Image), Recent('head_camera/depth_registered/image_raw', Image),
                Recent('head_camera/rgb/camera_info', CameraInfo)]

    def _states_of_snapshot(self) -> JointState:
        """Asked for again where they do not come: a publisher may have been slow to learn who listens."""
        until = time.monotonic() + self._timeout_s
        while True:
            try:
                return self._states.at(self._shot(False), min(AGAIN_S, self._timeout_s))
            except RobotError:
                if time.monotonic() > until or rospy.is_shutdown():
                    raise

    def _next_states(self) -> JointState:
        return self._states.next(self._timeout_s)

    def _shot(self, camera: bool) -> rospy.Time:
        """Have the world publish a snapshot; its stamp."""
        self._connected(self._states)
        try:
            self._snapshot.wait_for_service(self._timeout_s)
            answer = self._snapshot(camera)
        except (rospy.ServiceException, rospy.ROSException) as err:
            raise RobotError('{}: {}'.format(self._snapshot.resolved_name, err)) from err
        if not answer.ok:
            raise RobotError('{}: {}'.format(self._snapshot.resolved_name, answer.message))
        return answer.stamp

    def _connected(self, topic: Recent) -> None:
        until = time.monotonic() + self._timeout_s
        while not topic.connected():
            if time.monotonic() > until or rospy.is_shutdown():
                raise RobotError('nobody publishes {}'.format(topic.name))
            time.sleep(0.005)

    def _looked_up(self, target: str, source: str, stamp: rospy.Time) -> np.ndarray:
        """4x4. tf2's own waiting goes by ROS time, which may stand still; this goes by the wall's."""
        until = time.monotonic() + self._timeout_s
        while True:
            try:
                found = self._buffer.lookup_transform(target, source, stamp).transform
                break
            except tf2_ros.TransformException as err:
                if time.monotonic() > until or rospy.is_shutdown():
                    raise RobotError('no transform from {} to {}: {}'.format(source, target, err)) from err
            time.sleep(0.002)
        place, turn = found.translation, found.rotation
        return from_quaternion((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))
