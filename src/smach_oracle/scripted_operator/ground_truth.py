"""The scripted operator's eye on ROS: the service `world/reveal`."""
import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped

from smach_oracle.geometry.transforms import from_quaternion
from smach_oracle.msg import RevealedBody
from smach_oracle.srv import Reveal

from .sight import Seen, Sight


class EyeError(Exception):
    """Nothing can be seen; the text says why."""


class Eye:
    """Looks at the world as it truly is."""

    def __init__(self, service: str = 'world/reveal') -> None:
        self._reveal = rospy.ServiceProxy(service, Reveal)

    def look(self) -> Sight:
        """Everything there is.

        :raises EyeError: where the world does not answer.
        """
        try:
            answer = self._reveal([])
        except (rospy.ServiceException, rospy.ROSException, OSError) as err:
            raise EyeError('{}: {}'.format(self._reveal.resolved_name, err)) from err
        if not answer.ok:
            raise EyeError('{}: {}'.format(self._reveal.resolved_name, answer.message))
        return Sight({body.name: _seen(body) for body in answer.bodies}, answer.seed, answer.goal_body)


def pose_of(message: PoseStamped) -> np.ndarray:
    """4x4, of the message's frame. Raises ValueError for a quaternion of no length."""
    at, turn = message.pose.position, message.pose.orientation
    return from_quaternion((at.x, at.y, at.z), (turn.x, turn.y, turn.z, turn.w))


def _seen(body: RevealedBody) -> Seen:
    region = body.region
    return Seen(body.name, pose_of(body.pose), (body.size.x, body.size.y, body.size.z), body.movable, body.held,
                (region.x_offset, region.y_offset, region.width, region.height), body.visible, body.angle)
