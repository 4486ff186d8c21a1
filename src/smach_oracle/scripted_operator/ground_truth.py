"""The simulated world as it truly is, from its service `world/reveal`."""
import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped

from smach_oracle.geometry.transforms import from_quaternion
from smach_oracle.msg import RevealedBody
from smach_oracle.srv import Reveal

from .true_scene import TrueBody, TrueScene


class GroundTruthError(Exception):
    """The world cannot be read; the text says why."""


class GroundTruth:
    """Reads the world as it truly is."""

    def __init__(self, service: str = 'world/reveal') -> None:
        self._reveal = rospy.ServiceProxy(service, Reveal)

    def read_scene(self) -> TrueScene:
        """All bodies, as they are now.

        :raises GroundTruthError: where the world does not answer.
        """
        try:
            answer = self._reveal([])
        except (rospy.ServiceException, rospy.ROSException, OSError) as err:
            raise GroundTruthError('{}: {}'.format(self._reveal.resolved_name, err)) from err
        if not answer.ok:
            raise GroundTruthError('{}: {}'.format(self._reveal.resolved_name, answer.message))
        return TrueScene({body.name: _true_body(body)
                          for body in answer.bodies}, answer.seed, answer.goal_body)


def pose_of(message: PoseStamped) -> np.ndarray:
    """4x4, in the message's frame.

    :raises ValueError: for a quaternion of no length.
    """
    at, turn = message.pose.position, message.pose.orientation
    return from_quaternion((at.x, at.y, at.z), (turn.x, turn.y, turn.z, turn.w))


def _true_body(body: RevealedBody) -> TrueBody:
    region = body.region
    return TrueBody(body.name, pose_of(body.pose), (body.size.x, body.size.y, body.size.z),
                    body.movable, body.held,
                    (region.x_offset, region.y_offset, region.width, region.height), body.visible,
                    body.angle)
