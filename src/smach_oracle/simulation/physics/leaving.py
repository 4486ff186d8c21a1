"""The end of a trial in a lab where the robot goes on: what a person does there then."""

from typing import Tuple

import numpy as np

from smach_oracle.geometry.transforms import inverse, yaw_of

from ..scenes.lab import LabState
from ..scenes.scene import Body, Vector
from .world import World

UPRIGHT = float(np.cos(np.radians(15.0)))
HEIGHT = 0.03  # m, by which a thing that stands where it belongs may be higher or lower
BELONGS = 0.5  # m around where it stood
JOINTS = ('torso_lift_joint', 'head_pan_joint', 'head_tilt_joint')  # the arms are stowed


def left_by(world: World, success: bool, began: float, ended: float) -> LabState:
    """Return how a lab is left: the thing of the task is put away, what does not stand is put back.

    :param success: whether the task was done. A robot that has failed is set right, too.
    :param began: h of the run at which the trial began.
    :param ended: likewise.
    """
    things = tuple(_left(world, name) for name in world.movable() if name != world.scene.goal.body)
    state = LabState(began, ended, things)
    if not success:
        return state
    odom = world.odom_from_base() @ inverse(world.true_base())
    return state._replace(
        joints=_joints(world), base=_planar(world.true_base()), localisation=_planar(odom)
    )


def _left(world: World, name: str) -> Body:
    body, pose = world.body(name), world.body_pose(name)
    away = np.abs(pose[:3, 3] - body.position)
    held = any(contact.other == 'robot' for contact in world.contacts(name))
    if held or pose[2, 2] < UPRIGHT or away[2] > HEIGHT or np.hypot(*away[:2]) > BELONGS:
        return body
    x, y, z = (float(each) for each in pose[:3, 3])
    return body._replace(position=(x, y, z), yaw=yaw_of(pose))


def _joints(world: World) -> Tuple[Tuple[str, float], ...]:
    """Return where the joints are by their encoders, within their limits."""
    limits, found = world.robot.limits, world.joints()
    return tuple((name, min(max(found[name], limits[name][0]), limits[name][1])) for name in JOINTS)


def _planar(pose: np.ndarray) -> Vector:
    return float(pose[0, 3]), float(pose[1, 3]), yaw_of(pose)
