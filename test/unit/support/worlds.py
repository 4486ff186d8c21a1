"""Small worlds for the tests, and what a hand must do in them."""

import numpy as np

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import from_rpy, inverse
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.robot import ARM_JOINTS, BASE_FRAME, TOOL_FRAME
from smach_oracle.simulation.scenes.scene import Body, Goal, Scene

TABLE = Body('table', 'box', (0.7, 1.4, 0.04), (0.85, 0.0, 0.70), colour=(0.55, 0.38, 0.22))
CAN = Body(
    'can', 'cylinder', (0.031, 0.031, 0.12), (0.70, -0.20, 0.78), mass=0.33, colour=(0.8, 0.1, 0.1)
)
CARTON = Body(
    'carton',
    'box',
    (0.06, 0.05, 0.14),
    (0.75, 0.10, 0.79),
    yaw=0.4,
    mass=0.25,
    colour=(0.1, 0.3, 0.8),
)
GOAL = Goal('stands_at', 'can', (0.70, -0.20, 0.78))


def scene(*bodies, goal=GOAL, seed=3, **more):
    """A table with a can and a carton, or with what is given."""
    bodies = bodies or (TABLE, CAN, CARTON)
    return Scene(
        'test',
        seed,
        bodies,
        goal if goal.body in [body.name for body in bodies] else goal._replace(body=''),
        **more,
    )


def empty(**more):
    """Nothing but the robot."""
    return Scene('test', 3, (), Goal('stands_at', ''), **more)


class Hand:
    """Takes things by knowing where they are."""

    def __init__(self, world, robot, arm='right'):
        self.world, self.robot, self.arm = world, robot, arm
        self.chain = JointChain.from_urdf(
            pr2_urdf().read_text(),
            BASE_FRAME,
            TOOL_FRAME[arm],
            fixed={'torso_lift_joint': world.joints()['torso_lift_joint']},
        )

    def angles(self):
        joints = self.robot.joints()
        return np.array([joints[name] for name in ARM_JOINTS[self.arm]])

    def go(self, pose, speed=0.8, points=1):
        """The tool to a pose in the base's frame, on a line of so many points."""
        angles = self.angles()
        start, way = self.chain.forward(angles), []
        for share in np.linspace(0, 1, points + 1)[1:]:
            between = pose.copy()
            between[:3, 3] = start[:3, 3] + share * (pose[:3, 3] - start[:3, 3])
            generator = np.random.default_rng(0) if points == 1 else None
            found = self.chain.inverse(between, angles, generator)
            assert found is not None, 'out of reach'
            way.append(self.chain.nearest_turn(found, angles))
            angles = way[-1]
        steps = np.abs(np.diff([self.angles()] + way, axis=0)).max(axis=1) / speed
        self.robot.follow(ARM_JOINTS[self.arm], np.array(way), np.cumsum(np.maximum(steps, 0.02)))

    def take(self, body, effort=20.0, yaw=0.3, lift=0.1):
        """Grasp a body and lift it; returns the gripper's state."""
        centre = (inverse(self.world.true_base()) @ self.world.body_pose(body))[:3, 3]
        back = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        self.go(from_rpy(centre - 0.13 * back, yaw=yaw))
        self.go(from_rpy(centre, yaw=yaw), points=8)
        state = self.robot.gripper(self.arm, 0.0, effort)
        self.go(from_rpy(centre + [0.0, 0.0, lift], yaw=yaw), points=8)
        return state

    def shake(self, seconds=6.0):
        """Wrist, elbow and shoulder to and fro."""
        rest, amplitude = self.angles(), np.array([0.04, 0, 0, 0.12, 0, 0.12, 0.4])
        way = np.array([rest + amplitude * (-1) ** k for k in range(round(seconds / 0.3))] + [rest])
        self.robot.follow(ARM_JOINTS[self.arm], way, 0.3 * np.arange(1, len(way) + 1))
