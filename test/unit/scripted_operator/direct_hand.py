"""The scripted expert's hand and eye in one process with the world, without ROS: the same drive,
the same outlines.
"""

from pathlib import Path

import numpy as np
import yaml

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.joints import read_joints
from smach_oracle.geometry.links import link_pose
from smach_oracle.interfaces.manipulation.cartesian_drive import (
    CartesianDrive,
    DriveLimits,
    pulled_back,
)
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.scripted_operator.hand_driver import GripResult
from smach_oracle.scripted_operator.seen_scene import Outline, seen_scene
from smach_oracle.simulation.physics.camera import see
from smach_oracle.simulation.physics.recognition import recognised, view_of
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot

SETTINGS = yaml.safe_load(
    (Path(__file__).resolve().parents[3] / 'launch/manipulation_interface.yaml').read_text()
)
PERIODS = 2  # of the world, for one of the hand


class DirectHand:
    """Drives an arm of a World as the manipulation interface does in lock-step."""

    def __init__(self, world, arm):
        self.arm = arm
        self.period = PERIODS / 60.0
        self.limits_met = []
        self.moves = 0
        self._world = world
        names = SETTINGS['arms'][arm]
        text = pr2_urdf().read_text()
        self._tree = read_joints(text)
        self._names = names
        self._chain = JointChain.from_urdf(text, names['base'], names['tool'])
        self._drive = CartesianDrive(
            self._chain, DriveLimits(**SETTINGS['limits']), posture=np.array(names['posture'])
        )
        self._targets = self._measured()

    def _measured(self):
        joints = self._world.joints()
        return np.array([joints[name] for name in self._chain.names])

    def tool(self):
        return link_pose(self._tree, 'base_footprint', self._names['tool'], self._world.joints())

    def move(self, twist, turn_freely=False):
        self.moves += 1
        self._targets = pulled_back(self._targets, self._measured(), SETTINGS['lead'])
        step = self._drive.step(self._targets, twist, self.period, turn_freely)
        for tick in range(1, PERIODS + 1):
            for name, at, speed in zip(self._chain.names, self._targets, step.velocities):
                self._world.set_target(name, at + speed * self.period * tick / PERIODS, speed)
            self._world.step()
        self._targets = step.joints
        if step.limit:
            self.limits_met.append(step.limit)
        return step.limit

    def grip(self, gap, effort):
        self._world.set_gripper(self.arm, gap, effort)
        before = self._world.gap(self.arm)
        for _ in range(120):
            self._world.step(3)
            now = self._world.gap(self.arm)
            if abs(now - before) < 1e-4:
                break
            before = now
        return GripResult(now, now > gap + 0.004)


class DirectWatcher:
    """Looks and feels as the operator's eye and means do."""

    def __init__(self, world):
        self._world = world
        self._robot = DirectRobot(world)
        self._tall = {}

    def look(self, *names):
        image = see(self._world)
        found = recognised(
            view_of(self._world, image.colour), self._world.movable() + ['robot', *names]
        )
        wanted = self._world.scene.goal.body
        return seen_scene(
            image,
            [
                Outline(name, name == wanted, name in self._world.movable(), mask)
                for name, mask in found.items()
            ],
        )

    def look_at(self, point, *names):
        self._robot.look_at(point)
        scene = self.look(*names)
        for name, height in scene.heights().items():
            self._tall[name] = max(height, self._tall.get(name, 0.0))
        return scene

    def tall(self, name):
        return self._tall.get(name)

    def gap(self, arm):
        return self._world.gap(arm)
