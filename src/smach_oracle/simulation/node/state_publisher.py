"""Joint states, transforms and odometry of the simulated PR2, and its description."""

from typing import List, Mapping

import numpy as np
import rospy
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
)
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from smach_oracle.geometry.transform_tree import LinkTransform, TransformTree, link_transform
from smach_oracle.pr2.model.pr2_model import pr2_files
from smach_oracle.pr2.robot import BASE_FRAME, ODOM_FRAME

from ..physics.world import World


def ros_time(nanoseconds: int) -> rospy.Time:
    """A time in ns as a message has it."""
    return rospy.Time(*divmod(nanoseconds, 1_000_000_000))


def publish_description() -> str:
    """Set robot_description and robot_description_semantic.

    :returns: the URDF's text.
    """
    files = pr2_files()
    urdf = files.urdf.read_text(encoding='utf-8').replace('filename="/', 'filename="file:///')
    rospy.set_param('robot_description', urdf)
    rospy.set_param('robot_description_semantic', files.srdf.read_text(encoding='utf-8'))
    return urdf


class StatePublisher:
    """Topics joint_states, base_odometry/odom, /tf and, once, /tf_static."""

    def __init__(self, urdf: str, joints: List[str], latch: bool) -> None:
        """Offer the topics.

        :param joints: those that have encoders. The others of the URDF (the wheels') count as
            fixed.
        :param latch: late subscribers get the last state: a world that stands still publishes no
            other.
        """
        self._tree = TransformTree(urdf, joints)
        self._states = rospy.Publisher(
            'joint_states', JointState, queue_size=100, tcp_nodelay=True, latch=latch
        )
        self._odometry = rospy.Publisher(
            'base_odometry/odom', Odometry, queue_size=100, tcp_nodelay=True, latch=latch
        )
        self._moving = rospy.Publisher(
            '/tf', TFMessage, queue_size=100, tcp_nodelay=True, latch=latch
        )
        self._fixed = rospy.Publisher('/tf_static', TFMessage, queue_size=10, latch=True)
        self._fixed_sent = False

    def publish(self, world: World, stamp: rospy.Time) -> None:
        """Publish all of it as it is now."""
        if not self._fixed_sent:
            self._fixed_sent = True
            self._fixed.publish(TFMessage([_stamped(link, stamp) for link in self._tree.fixed]))
        positions = world.joints()
        self._moving.publish(transforms(self._tree, positions, world.odom_from_base(), stamp))
        self._odometry.publish(odometry(world.odom_from_base(), world.robot.base_velocity(), stamp))
        velocities, efforts = world.joint_velocities(), world.joint_efforts()
        names = sorted(positions)
        self._states.publish(
            JointState(
                Header(stamp=stamp),
                names,
                *([values[name] for name in names] for values in (positions, velocities, efforts)),
            )
        )


def transforms(
    tree: TransformTree,
    positions: Mapping[str, float],
    odom_from_base: np.ndarray,
    stamp: rospy.Time,
) -> TFMessage:
    """The transforms of what moves, as a message for /tf.

    :param positions: rad or m by joint.
    :param odom_from_base: 4x4, ODOM_FRAME from BASE_FRAME.
    """
    links = [link_transform(ODOM_FRAME, BASE_FRAME, odom_from_base)] + tree.moving(positions)
    return TFMessage([_stamped(link, stamp) for link in links])


def odometry(odom_from_base: np.ndarray, velocity: np.ndarray, stamp: rospy.Time) -> Odometry:
    """Return where the robot believes that it stands, and how it moves.

    No variance is known (zeros).

    :param odom_from_base: 4x4, ODOM_FRAME from BASE_FRAME.
    :param velocity: (3,), as `Pr2Body.base_velocity` gives it.
    """
    link = link_transform(ODOM_FRAME, BASE_FRAME, odom_from_base)
    forward, left, turn = velocity
    return Odometry(
        Header(stamp=stamp, frame_id=link.parent),
        link.child,
        PoseWithCovariance(Pose(Point(*link.position), Quaternion(*link.turn)), [0.0] * 36),
        TwistWithCovariance(
            Twist(Vector3(forward, left, 0.0), Vector3(0.0, 0.0, turn)), [0.0] * 36
        ),
    )


def _stamped(link: LinkTransform, stamp: rospy.Time) -> TransformStamped:
    return TransformStamped(
        Header(stamp=stamp, frame_id=link.parent),
        link.child,
        Transform(Vector3(*link.position), Quaternion(*link.turn)),
    )
