"""Collision maps for others to see: teleoperation slows near them, RViz draws them."""

from typing import Callable

import rospy
from geometry_msgs.msg import Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.msg import BuildCollisionMapGoal, BuildCollisionMapResult, CollisionBoxes

from ..planning.collision_map import CollisionMap, CollisionMapStore
from ..robot import BASE_FRAME
from .frames import pose_message
from .skill_server import ReportStatus

COLOUR = ColorRGBA(0.9, 0.6, 0.2, 0.5)

Build = Callable[[BuildCollisionMapGoal, ReportStatus], BuildCollisionMapResult]


class CollisionMapPublisher:
    """Builds maps as `build` does, and publishes each.

    The topics are latched: `collision_map`, and `collision_map_markers` for RViz.
    """

    def __init__(self, build: Build, maps: CollisionMapStore) -> None:
        self._build = build
        self._maps = maps
        self._publisher = rospy.Publisher('collision_map', CollisionBoxes, queue_size=2, latch=True)
        self._markers = rospy.Publisher(
            'collision_map_markers', MarkerArray, queue_size=2, latch=True
        )

    def __call__(
        self, goal: BuildCollisionMapGoal, report: ReportStatus
    ) -> BuildCollisionMapResult:
        """A skill's handler."""
        result = self._build(goal, report)
        boxes = boxes_message(result.map_id, self._maps.find(result.map_id))
        self._publisher.publish(boxes)
        self._markers.publish(markers_message(boxes))
        return result


def boxes_message(map_id: str, made: CollisionMap) -> CollisionBoxes:
    """A map as a message, in base_footprint."""
    names = sorted(made.boxes)
    boxes = [made.boxes[name] for name in names]
    return CollisionBoxes(
        Header(frame_id=BASE_FRAME, stamp=rospy.get_rostime()),
        map_id,
        names,
        [pose_message(from_rpy(box.centre, yaw=box.yaw)).pose for box in boxes],
        [Vector3(*(2 * side for side in box.half)) for box in boxes],
    )


def markers_message(boxes: CollisionBoxes) -> MarkerArray:
    """The same as RViz draws it. What it drew before goes."""
    drawn = [
        Marker(
            header=boxes.header,
            ns='collision_map',
            id=number,
            type=Marker.CUBE,
            action=Marker.ADD,
            pose=pose,
            scale=size,
            color=COLOUR,
            text=name,
        )
        for number, (name, pose, size) in enumerate(zip(boxes.names, boxes.poses, boxes.sizes))
    ]
    return MarkerArray(
        [Marker(header=boxes.header, ns='collision_map', action=Marker.DELETEALL)] + drawn
    )
