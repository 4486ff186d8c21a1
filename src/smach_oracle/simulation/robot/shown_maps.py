"""Collision maps for others to see: what is planned in is published, for teleoperation to slow near it."""
from typing import Callable

import rospy
from geometry_msgs.msg import Vector3
from std_msgs.msg import Header

from smach_oracle.msg import BuildCollisionMapGoal, BuildCollisionMapResult, CollisionBoxes

from ...geometry.transforms import from_rpy
from .collision_map import CollisionMap, MapBook
from .frames import pose_message
from .interface import BASE_FRAME
from .skill_server import Say

Build = Callable[[BuildCollisionMapGoal, Say], BuildCollisionMapResult]


class ShownMaps:
    """Builds maps as `build` does, and publishes each on the latched topic `collision_map`."""

    def __init__(self, build: Build, maps: MapBook) -> None:
        self._build = build
        self._maps = maps
        self._publisher = rospy.Publisher('collision_map', CollisionBoxes, queue_size=2, latch=True)

    def __call__(self, goal: BuildCollisionMapGoal, say: Say) -> BuildCollisionMapResult:
        """A skill's handler."""
        result = self._build(goal, say)
        self._publisher.publish(boxes_message(result.map_id, self._maps.find(result.map_id)))
        return result


def boxes_message(map_id: str, made: CollisionMap) -> CollisionBoxes:
    """A map as a message, in base_footprint."""
    names = sorted(made.boxes)
    boxes = [made.boxes[name] for name in names]
    return CollisionBoxes(Header(frame_id=BASE_FRAME, stamp=rospy.get_rostime()), map_id, names,
                          [pose_message(from_rpy(box.centre, yaw=box.yaw)).pose for box in boxes],
                          [Vector3(*(2 * side for side in box.half)) for box in boxes])
