"""A right arm among boxes, and a check of its ways that shares nothing with the planner's."""

from typing import Dict, List, Mapping

import numpy as np
import pybullet

from smach_oracle.pr2.kitchen import MapBox
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.planning.collision import CollisionModel, CollisionWorld, installed_model
from smach_oracle.pr2.robot import ARM_JOINTS
from smach_oracle.pr2.skills.arms_aside import ASIDE

REST = {
    'torso_lift_joint': 0.22,
    'r_gripper_l_finger_joint': 0.045,
    'r_gripper_r_finger_joint': 0.045,
    'l_gripper_l_finger_joint': 0.045,
    'l_gripper_r_finger_joint': 0.045,
    **dict(zip(ARM_JOINTS['left'], ASIDE['left'])),
    **dict(zip(ARM_JOINTS['right'], ASIDE['right'])),
}


def model() -> CollisionModel:
    return installed_model()


def box(x: float, y: float, z: float, *half: float, yaw: float = 0.0) -> MapBox:
    return MapBox(np.array([x, y, z]), np.array(half), yaw)


def clutter(seed: int) -> Dict[str, MapBox]:
    """A table with six things on it."""
    generator = np.random.default_rng(seed)
    boxes = {'table': box(0.85, 0.0, 0.7, 0.35, 0.7, 0.02)}
    for k in range(6):
        x, y = generator.uniform(0.55, 0.95), generator.uniform(-0.5, 0.35)
        boxes['thing {}'.format(k)] = box(x, y, 0.79, 0.03, 0.03, 0.07)
    return boxes


def right_arm(boxes: Mapping[str, MapBox]) -> CollisionWorld:
    space = CollisionWorld(model(), 'right', REST)
    for name in sorted(boxes):
        space.add_box(name, boxes[name])
    return space


def deepest(way: np.ndarray, boxes: Mapping[str, MapBox], step: float = 0.01) -> float:
    """The deepest that the right arm gets into a box or into base and torso, m; points every `step`
    rad of the way.
    """
    client = pybullet.connect(pybullet.DIRECT)
    try:
        robot = pybullet.loadURDF(str(pr2_urdf()), useFixedBase=True, physicsClientId=client)
        infos = [
            pybullet.getJointInfo(robot, k, physicsClientId=client)
            for k in range(pybullet.getNumJoints(robot, physicsClientId=client))
        ]
        joints = {info[1].decode(): k for k, info in enumerate(infos)}
        links = {info[12].decode(): k for k, info in enumerate(infos)}
        for name, value in REST.items():
            pybullet.resetJointState(robot, joints[name], value, physicsClientId=client)
        bodies = [_body(client, each) for each in boxes.values()]
        arm = [
            index
            for name, index in links.items()
            if name.startswith(('r_gripper', 'r_wrist', 'r_forearm_link'))
        ]
        trunk = [links[name] for name in ('base_link', 'torso_lift_link', 'head_tilt_link')]
        worst = 0.0
        for q in _dense(way, step):
            for name, value in zip(ARM_JOINTS['right'], q):
                pybullet.resetJointState(robot, joints[name], value, physicsClientId=client)
            for body in bodies:
                worst = min(
                    [worst]
                    + [
                        point[8]
                        for point in pybullet.getClosestPoints(
                            robot, body, 0.0, physicsClientId=client
                        )
                    ]
                )
            for one in arm:
                for other in trunk:
                    worst = min(
                        [worst]
                        + [
                            point[8]
                            for point in pybullet.getClosestPoints(
                                robot, robot, 0.0, one, other, physicsClientId=client
                            )
                        ]
                    )
        return -worst
    finally:
        pybullet.disconnect(client)


def _dense(way: np.ndarray, step: float) -> List[np.ndarray]:
    points = [way[0]]
    for corner in way[1:]:
        count = max(1, int(np.ceil(np.abs(corner - points[-1]).max() / step)))
        points += list(np.linspace(points[-1], corner, count + 1)[1:])
    return points


def _body(client: int, each: MapBox) -> int:
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=list(each.half), physicsClientId=client
    )
    return pybullet.createMultiBody(
        0,
        shape,
        -1,
        list(each.centre),
        pybullet.getQuaternionFromEuler([0, 0, each.yaw]),
        physicsClientId=client,
    )
