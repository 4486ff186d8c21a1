"""The surroundings of a driven arm, kept up to date from joint_states and the collision map."""

import math
import re
import threading
from typing import List, Optional

import rospkg
import rospy

from smach_oracle.geometry.joints import read_joints
from smach_oracle.geometry.links import link_pose
from smach_oracle.geometry.transforms import from_quaternion
from smach_oracle.msg import CollisionBoxes

from .clearance import ClearanceError, ClearanceModel, CollisionBox
from .teleoperated_arm import DescribedRobot, TeleoperatedArm


class Surroundings:
    """The robot's model and the boxes around it.

    `update` and the arms' questions come from one thread.
    """

    def __init__(self, robot: DescribedRobot, within: float) -> None:
        """`within`: m beyond which nothing is near.

        :raises ClearanceError: where the robot's model cannot be used.
        """
        self._robot = robot
        self._within = within
        self._tree = read_joints(robot.urdf)
        self._model = ClearanceModel(openable(robot.urdf), robot.base)
        self._lock = threading.Lock()
        self._news: Optional[List[CollisionBox]] = None

    def watch_over(self, arm: TeleoperatedArm) -> None:
        """Let an arm slow down near itself and the boxes."""
        arm.watch(self._model.arm(arm.chain, self._within))

    def replace(self, message: CollisionBoxes) -> None:
        """Take over a new map. Warn of one in a frame that the robot does not have."""
        try:
            boxes = self._boxes(message)
        except ValueError as err:
            rospy.logwarn('collision_map %s cannot be used: %s', message.map_id, err)
            return
        with self._lock:
            self._news = boxes

    def update(self) -> None:
        """Bring the model to where the joints and the boxes are now."""
        self._model.set_joints(self._robot.listener.now()[0])
        with self._lock:
            news, self._news = self._news, None
        if news is not None:
            self._model.set_boxes(news)

    def _boxes(self, message: CollisionBoxes) -> List[CollisionBox]:
        if not len(message.names) == len(message.poses) == len(message.sizes):
            raise ValueError(
                '{} names, {} poses, {} sizes'.format(
                    len(message.names), len(message.poses), len(message.sizes)
                )
            )
        base_from_map = link_pose(
            self._tree, self._robot.base, message.header.frame_id, self._robot.listener.now()[0]
        )
        boxes = []
        for name, pose, size in zip(message.names, message.poses, message.sizes):
            at, turn = pose.position, pose.orientation
            centre = from_quaternion((at.x, at.y, at.z), (turn.x, turn.y, turn.z, turn.w))
            if not all(0.0 < side < math.inf for side in (size.x, size.y, size.z)):
                raise ValueError('size of {!r}: {}'.format(name, (size.x, size.y, size.z)))
            boxes.append(CollisionBox(name, base_from_map @ centre, (size.x, size.y, size.z)))
        return boxes


def openable(urdf: str) -> str:
    """A robot description whose mesh files are named by their paths.

    :raises ClearanceError: for a package that is not there.
    """
    packs = rospkg.RosPack()
    try:
        named = re.sub(
            r'package://([^/"]+)', lambda match: str(packs.get_path(match.group(1))), urdf
        )
    except rospkg.ResourceNotFound as err:
        raise ClearanceError('robot description: no package {}'.format(err)) from err
    return named.replace('file://', '')
