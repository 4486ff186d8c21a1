"""A robot's messages about itself: joint states, transforms, images.

Where its world gives snapshots, all of it is of one moment.
"""

import collections
import threading
import time
from typing import Callable, Deque, Dict, List, Optional, Sequence, Type, TypeVar

import genpy
import numpy as np
import rospy
import tf2_ros
from sensor_msgs.msg import CameraInfo, Image, JointState

from smach_common.connections import live_connections
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.transforms import from_quaternion
from smach_oracle.ros.connections import ConnectionGrace
from smach_oracle.ros.images import ImageError, colour_of, depth_of, intrinsics_of
from smach_oracle.srv import Snapshot, SnapshotResponse

from .robot import RobotError

KEPT = {Image: 4}  # messages of a topic
KEPT_OTHERS = 200
LOOK_S = 0.05  # wall s that a service that is not there is waited for
AGAIN_S = 3.0  # wall s after which what was asked for is asked for again
T = TypeVar('T')


class NotReceivedError(RobotError):
    """A message that is waited for has not come."""


class MessageHistory:
    """The last few messages of a topic, to be had by their stamp."""

    def __init__(self, topic: str, kind: type) -> None:
        self.name = rospy.resolve_name(topic)
        self._grace = ConnectionGrace()
        self._arrived = threading.Condition()
        kept = KEPT.get(kind, KEPT_OTHERS)
        self._messages: Deque[genpy.Message] = collections.deque(maxlen=kept)
        self._subscriber = rospy.Subscriber(
            topic, kind, self._heard, queue_size=kept, buff_size=1 << 24, tcp_nodelay=True
        )

    def connected(self) -> bool:
        """Whether somebody publishes. It waits until a new publisher has registered this node."""
        connections = live_connections(self._subscriber)
        if connections:
            self._grace.wait(connections)
        return bool(connections)

    def at(self, stamp: rospy.Time, timeout_s: float) -> genpy.Message:
        """The message with this stamp. It waits for it, by the wall's clock.

        :raises RobotError: where it does not come.
        """
        return self.at_one_of([stamp], timeout_s)

    def at_one_of(self, stamps: Sequence[rospy.Time], timeout_s: float) -> genpy.Message:
        """The message with one of these stamps that came last. It waits as `at`.

        :raises RobotError: where none comes.
        """
        return self._wait(lambda message: message.header.stamp in stamps, timeout_s)

    def next(self, timeout_s: float) -> genpy.Message:
        """The first message that comes from now on.

        :raises RobotError: where none comes.
        """
        with self._arrived:
            before = list(self._messages)
        return self._wait(lambda message: not any(message is old for old in before), timeout_s)

    def _wait(self, fits: Callable[[genpy.Message], bool], timeout_s: float) -> genpy.Message:
        def found() -> Optional[genpy.Message]:
            return next((message for message in reversed(self._messages) if fits(message)), None)

        with self._arrived:
            message = self._arrived.wait_for(found, timeout_s)
        if message is None:
            raise NotReceivedError('no message on {} within {:g} s'.format(self.name, timeout_s))
        return message

    def _heard(self, message: genpy.Message) -> None:
        with self._arrived:
            self._messages.append(message)
            self._arrived.notify_all()


class RosSenses:
    """Encoders, odometry and camera of a robot, read from its topics.

    :param snapshot: service smach_oracle/Snapshot. '' means none, the next messages count.
    :param timeout_s: wall s to wait for anything.
    """

    def __init__(self, snapshot: str, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._snapshot_name = rospy.resolve_name(snapshot) if snapshot else ''
        self._snapshot: Optional[rospy.ServiceProxy] = None  # while it is connected
        self._calling = threading.Lock()
        self._states = MessageHistory('joint_states', JointState)
        self._starting = threading.Lock()
        # a world that gives snapshots sends images only when asked. A robot's stream is for those
        # who really look
        self._camera = self._subscribe() if snapshot else []
        self._buffer = tf2_ros.Buffer(rospy.Duration(60.0))
        self._listener = tf2_ros.TransformListener(self._buffer, tcp_nodelay=True)
        self._tree_grace = ConnectionGrace()

    def lacking(self) -> List[str]:
        """Return what is not connected: the service for snapshots, topics.

        For those that are, it waits until their publishers send to this node.
        """
        lacking = [topic.name for topic in [self._states] + self._camera if not topic.connected()]
        if not self._tree_connected():
            lacking.append('/tf')
        try:
            if self._snapshot_name:
                rospy.wait_for_service(self._snapshot_name, LOOK_S)
        except rospy.ROSException:
            lacking.append(self._snapshot_name)
        return lacking

    def _tree_connected(self) -> bool:
        found = live_connections(self._listener.tf_sub)
        if found:
            self._tree_grace.wait(found)
        return bool(found)

    def joints(self) -> Dict[str, float]:
        """Joint positions, rad or m, now.

        :raises RobotError: where none come.
        """
        message = self._states_of_snapshot() if self._snapshot_name else self._next_states()
        return dict(zip(message.name, message.position))

    def transform(self, target: str, source: str) -> np.ndarray:
        """4x4, target from source, now.

        :raises RobotError: where it is not known.
        """
        stamp = self._shot(False) if self._snapshot_name else self._next_states().header.stamp
        return self._looked_up(target, source, stamp)

    def see(self, base: str, camera: str) -> CameraImage:
        """An image of the camera, with the pose of the frame `camera` in `base` at its moment.

        :raises RobotError: where none comes, its pose is not known, or it holds no image.
        """
        topics = self._camera_topics()
        if self._snapshot_name:
            colour, depth, info = self._images_of_snapshot(topics)
            stamp = colour.header.stamp
        else:
            depth = topics[1].next(self._timeout_s)
            stamp = depth.header.stamp
            colour, info = (topics[number].at(stamp, self._timeout_s) for number in (0, 2))
        pose = self._looked_up(base, camera, stamp)
        try:
            return CameraImage(
                stamp.to_sec(), colour_of(colour), depth_of(depth), intrinsics_of(info), pose
            )
        except ImageError as err:
            raise RobotError('camera: {}'.format(err)) from err

    def _camera_topics(self) -> List[MessageHistory]:
        """Colour, depth and camera info, subscribed to by the first who wants to see."""
        with self._starting:
            self._camera = self._camera or self._subscribe()
        for topic in self._camera:
            self._connected(topic)
        return self._camera

    @staticmethod
    def _subscribe() -> List[MessageHistory]:
        return [
            MessageHistory('head_camera/rgb/image_raw', Image),
            MessageHistory('head_camera/depth_registered/image_raw', Image),
            MessageHistory('head_camera/rgb/camera_info', CameraInfo),
        ]

    def _states_of_snapshot(self) -> JointState:
        return self._asked_again(lambda wait_s: self._states.at(self._shot(False), wait_s))

    def _images_of_snapshot(self, topics: List[MessageHistory]) -> List[genpy.Message]:
        """Colour, depth and camera info of one moment, also of one that was asked for before.

        Asked for again only where they do not come: with each, time passes in the world.
        """
        stamps: List[rospy.Time] = []

        def take(wait_s: float) -> List[genpy.Message]:
            stamps.append(self._shot(True))
            colour = topics[0].at_one_of(stamps, wait_s)
            return [colour] + [topic.at(colour.header.stamp, wait_s) for topic in topics[1:]]

        return self._asked_again(take, NotReceivedError)

    def _asked_again(
        self, take: Callable[[float], T], again_after: Type[RobotError] = RobotError
    ) -> T:
        """The result of `take`, which asks the world and waits so many seconds at most.

        It asks again after an error: a publisher may have been slow to learn who listens.
        """
        until = time.monotonic() + self._timeout_s
        while True:
            try:
                return take(min(AGAIN_S, self._timeout_s))
            except again_after:
                if time.monotonic() > until or rospy.is_shutdown():
                    raise

    def _next_states(self) -> JointState:
        return self._states.next(self._timeout_s)

    def _shot(self, camera: bool) -> rospy.Time:
        """Have the world publish a snapshot. Return its stamp."""
        self._connected(self._states)
        self._tree_connected()
        try:
            answer = self._snapped(camera)
        except (rospy.ServiceException, rospy.ROSException) as err:
            raise RobotError('{}: {}'.format(self._snapshot_name, err)) from err
        if not answer.ok:
            raise RobotError('{}: {}'.format(self._snapshot_name, answer.message))
        return answer.stamp

    def _snapped(self, camera: bool) -> SnapshotResponse:
        """Ask for a snapshot over the connection of the last time, where that is still there."""
        with self._calling:
            if self._snapshot is not None:
                try:
                    return self._snapshot(camera)
                except (rospy.ServiceException, rospy.ROSException):
                    self._snapshot.close()  # the world has been started again, or is gone
            rospy.wait_for_service(self._snapshot_name, self._timeout_s)
            self._snapshot = rospy.ServiceProxy(self._snapshot_name, Snapshot, persistent=True)
            return self._snapshot(camera)

    def _connected(self, topic: MessageHistory) -> None:
        until = time.monotonic() + self._timeout_s
        while not topic.connected():
            if time.monotonic() > until or rospy.is_shutdown():
                raise RobotError('nobody publishes {}'.format(topic.name))
            time.sleep(0.005)

    def _looked_up(self, target: str, source: str, stamp: rospy.Time) -> np.ndarray:
        """4x4, target from source at a stamp, waited for by the wall's clock.

        tf2's own waiting goes by ROS time, which may stand still.
        """
        until = time.monotonic() + self._timeout_s
        while True:
            try:
                found = self._buffer.lookup_transform(target, source, stamp).transform
                break
            except tf2_ros.TransformException as err:
                if time.monotonic() > until or rospy.is_shutdown():
                    raise RobotError(
                        'no transform from {} to {}: {}'.format(source, target, err)
                    ) from err
            time.sleep(0.002)
        place, turn = found.translation, found.rotation
        return from_quaternion((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))
