"""The PR2 in a physics client: encoders, motors that hold or follow, where its links are."""

import math
import xml.etree.ElementTree as ElementTree
from typing import Callable, Collection, Dict, List, Optional, Sequence, Set

import numpy as np
import pybullet

from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.pr2.model.pr2_model import BASE_JOINTS, JAW_OPEN, pr2_files
from smach_oracle.pr2.model.rigid_links import fixed_frames
from smach_oracle.pr2.robot import ARM_JOINTS, ARMS, FINGER_JOINTS

from ..scenes.scene import RobotStart
from .bodies import SceneBuildError, pose_of

SUBSTEPS = 2  # steps of physics in a control period
STEP = 1.0 / 120.0  # s
PERIOD = SUBSTEPS * STEP
FINGERS = {arm: [name.replace('_joint', '_link') for name in FINGER_JOINTS[arm]] for arm in ARMS}
# N, N, N m: about where the wheels of 220 kg begin to slip. Other joints have the URDF's efforts
BASE_EFFORT = {'base_x': 1000.0, 'base_y': 1000.0, 'base_theta': 300.0}
GRIP = 20.0  # N, of each finger at the start
# m, that a finger is sent ahead of where the two are: how fast it closes, and how both keep
# together
LEAD = 0.003
# N m, of an arm whose motors are off. Shoulder and elbow have most of it
DRY_FRICTION = (1.0, 1.0, 0.5, 0.5, 0.2, 0.2, 0.1)
STIFFNESS = 0.51  # share of an error that is taken back in one step of physics
TIP_FRICTION = 1.2
STAND = {  # how a PR2 stands unless the scene says otherwise
    'torso_lift_joint': 0.20,
    'head_tilt_joint': 0.0,
    'l_shoulder_pan_joint': 1.6,
    'l_shoulder_lift_joint': 0.2,
    'l_upper_arm_roll_joint': 1.5,
    'l_elbow_flex_joint': -1.5,
    'l_forearm_roll_joint': -0.5,
    'l_wrist_flex_joint': -0.6,
    'l_wrist_roll_joint': 0.0,
    'r_shoulder_pan_joint': -1.6,
    'r_shoulder_lift_joint': 0.2,
    'r_upper_arm_roll_joint': -1.5,
    'r_elbow_flex_joint': -1.5,
    'r_forearm_roll_joint': 0.5,
    'r_wrist_flex_joint': -0.6,
    'r_wrist_roll_joint': 0.0,
    **{jaw: JAW_OPEN for jaws in FINGER_JOINTS.values() for jaw in jaws},
}


class Pr2Body:
    """Loaded at its start, every joint held where it is."""

    def __init__(self, client: int, start: RobotStart) -> None:
        """Load the robot.

        :raises SceneBuildError: where the start names a joint that is not there, or a position
            outside its limits.
        """
        self._client = client
        files = pr2_files()
        self.index: int = pybullet.loadURDF(
            str(files.mobile),
            useFixedBase=True,
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=client,
        )
        infos = [
            pybullet.getJointInfo(self.index, number, physicsClientId=client)
            for number in range(pybullet.getNumJoints(self.index, physicsClientId=client))
        ]
        self.numbers = {info[1].decode(): number for number, info in enumerate(infos)}
        self.links = {info[12].decode(): number for number, info in enumerate(infos)}
        self.limits = {
            info[1].decode(): (info[8], info[9]) if info[8] <= info[9] else (-math.inf, math.inf)
            for info in infos
        }
        self.speeds = {info[1].decode(): info[11] for info in infos}
        self.encoders = [name for name in self.numbers if name not in BASE_JOINTS]
        self._frames = fixed_frames(ElementTree.parse(str(files.urdf)).getroot())
        self._targets = np.zeros(len(infos))
        self._rates = np.zeros(len(infos))
        # N m or N, that each motor gives at most
        self.efforts = {info[1].decode(): info[10] for info in infos}
        self.efforts.update(BASE_EFFORT)
        self._forces = np.array([self.efforts[name] for name in self.numbers])
        self._moving: List[int] = []
        self._changed = set(range(len(infos)))
        self._read_more = np.zeros(len(infos))  # what encoders read too much
        self._limp: Set[int] = set()  # joints whose motors are off
        self._grips = dict.fromkeys(ARMS, (2 * JAW_OPEN, GRIP))
        self._halted: Set[str] = set()  # arms, the motor of whose gripper is off
        self._jaws = {arm: [self.numbers[name] for name in FINGER_JOINTS[arm]] for arm in ARMS}
        self._stand(start)
        for arm in ARMS:
            for finger in FINGERS[arm]:
                pybullet.changeDynamics(
                    self.index,
                    self.links[finger],
                    lateralFriction=TIP_FRICTION * (1.0 - start.tip_wear),
                    spinningFriction=0.005,
                    rollingFriction=0.0005,
                    physicsClientId=client,
                )

    def _stand(self, start: RobotStart) -> None:
        for name, error in start.encoder_errors:
            if name not in self.encoders:
                raise SceneBuildError(
                    'robot: no joint {!r}; there: {}'.format(name, ', '.join(self.encoders))
                )
            self._read_more[self.numbers[name]] = error
        wanted = dict(STAND)
        for name, position in start.joints:
            if name not in self.encoders:
                raise SceneBuildError(
                    'robot: no joint {!r}; there: {}'.format(name, ', '.join(self.encoders))
                )
            wanted[name] = position
        wanted.update(zip(BASE_JOINTS, start.base))
        for name, position in wanted.items():
            wrong = self.refusal(name, position)
            if wrong:
                raise SceneBuildError('robot: ' + wrong)
            number = self.numbers[name]
            pybullet.resetJointState(
                self.index, number, position - self._read_more[number], physicsClientId=self._client
            )
            self._targets[self.numbers[name]] = position
        for arm in ARMS:
            self._grips[arm] = (sum(wanted[jaw] for jaw in FINGER_JOINTS[arm]), GRIP)

    def never_meets(self, floor: int) -> None:
        """Leave out the collisions of all but the arms with the floor, which they cannot reach."""
        for name, number in self.links.items():
            if name[:2] not in ('l_', 'r_'):
                pybullet.setCollisionFilterPair(
                    self.index, floor, number, -1, 0, physicsClientId=self._client
                )

    def refusal(self, name: str, position: float) -> str:
        """Return why a joint cannot be sent to a position, or ''."""
        if name not in self.numbers:
            return 'no joint {!r}; there: {}'.format(name, ', '.join(self.numbers))
        lower, upper = self.limits[name]
        if not lower - 1e-3 <= position <= upper + 1e-3:
            return '{} cannot be at {:.4g}; allowed: {:.4g} to {:.4g}'.format(
                name, position, lower, upper
            )
        return ''

    def states(self, field: int) -> Dict[str, float]:
        """One field of every encoder's state.

        :param field: 0: positions (rad or m), 1: velocities (rad/s or m/s), 3: efforts (N m or N).
        """
        numbers = [self.numbers[name] for name in self.encoders]
        states = pybullet.getJointStates(self.index, numbers, physicsClientId=self._client)
        more = self._read_more[numbers] if field == 0 else np.zeros(len(numbers))
        return {
            name: state[field] + float(extra)
            for name, state, extra in zip(self.encoders, states, more)
        }

    def position(self, name: str) -> float:
        """rad or m of one joint, as its encoder reads it, also of the base's."""
        number = self.numbers[name]
        position: float = pybullet.getJointState(self.index, number, physicsClientId=self._client)[
            0
        ]
        return position + float(self._read_more[number])

    def positions(self, names: Sequence[str]) -> np.ndarray:
        """(n,) rad or m of joints, as their encoders read them."""
        numbers = [self.numbers[name] for name in names]
        states = pybullet.getJointStates(self.index, numbers, physicsClientId=self._client)
        return np.array([state[0] for state in states]) + self._read_more[numbers]

    def base(self) -> np.ndarray:
        """4x4, the world from base_footprint."""
        x, y, theta = (self.position(name) for name in BASE_JOINTS)
        return from_rpy((x, y, 0.0), yaw=theta)

    def base_velocity(self) -> np.ndarray:
        """(3,) of base_footprint in its own axes: m/s forward, m/s to the left, rad/s of yaw."""
        (_, _, theta), (x, y, turn) = (
            [
                pybullet.getJointState(
                    self.index, self.numbers[name], physicsClientId=self._client
                )[field]
                for name in BASE_JOINTS
            ]
            for field in (0, 1)
        )
        cos, sin = math.cos(theta), math.sin(theta)
        return np.array([cos * x + sin * y, cos * y - sin * x, turn])

    def link_pose(self, link: str) -> np.ndarray:
        """4x4, the world from a link of the URDF.

        :raises ValueError: for one that is not there.
        """
        if link not in self._frames:
            raise ValueError(
                'no link {!r} in the PR2; there: {}'.format(link, ', '.join(sorted(self._frames)))
            )
        holder, holder_from_link = self._frames[link]
        state = pybullet.getLinkState(
            self.index,
            self.links[holder],
            computeForwardKinematics=True,
            physicsClientId=self._client,
        )
        return pose_of(state[4], state[5]) @ holder_from_link

    def set_target(
        self, name: str, position: float, velocity: float, force: Optional[float]
    ) -> None:
        """Send a joint to a position (rad or m, by its encoder) at the end of the coming period.

        :param velocity: rad/s or m/s until then.
        :param force: N m or N, at most. None means as before.
        """
        number = self.numbers[name]
        self._targets[number], self._rates[number] = position, velocity
        if force is not None:
            self._forces[number] = force
        self._changed.add(number)

    def go_limp(self, arm: str) -> None:
        """Switch an arm's motors off: it stays where it is, and what pushes it takes it along."""
        numbers = [self.numbers[name] for name in ARM_JOINTS[arm]]
        self._limp.update(numbers)
        pybullet.setJointMotorControlArray(
            self.index,
            numbers,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[0.0] * len(numbers),
            forces=DRY_FRICTION,
            physicsClientId=self._client,
        )

    def hold(self, arm: str) -> None:
        """Switch an arm's motors on again: they hold it where it is."""
        for name in ARM_JOINTS[arm]:
            self._limp.discard(self.numbers[name])
            self.set_target(name, self.position(name), 0.0, None)

    def push(self, link: str, point: np.ndarray, force: np.ndarray) -> None:
        """Push a link of the URDF in the coming step of physics.

        :param point: (3,) m, where, in the world.
        :param force: (3,) N, in the world's axes.
        """
        pybullet.applyExternalForce(
            self.index,
            self.links[self._frames[link][0]],
            force.tolist(),
            point.tolist(),
            pybullet.WORLD_FRAME,
            physicsClientId=self._client,
        )

    def target(self, name: str) -> float:
        """rad or m, where a joint was sent last."""
        return float(self._targets[self.numbers[name]])

    def set_grip(self, arm: str, gap: float, force: float) -> None:
        """Send a gripper to a gap between the tips (m), each finger with at most `force` N."""
        self._grips[arm] = (gap, force)

    def halt_gripper(self, arm: str, halted: bool) -> None:
        """Switch the motor of a gripper off: its spindle holds the fingers where they are.

        :param halted: False switches it on again.
        """
        if not halted:
            self._halted.discard(arm)
            return
        self._halted.add(arm)
        for name, position in zip(FINGER_JOINTS[arm], self._jaw_positions(arm)):
            self.set_target(name, position, 0.0, self.efforts[name])

    def sent_gap(self, arm: str) -> float:
        """m, to which a gripper was sent last."""
        return self._grips[arm][0]

    def gap(self, arm: str) -> float:
        """m between the finger tips of an arm."""
        return float(sum(self._jaw_positions(arm)))

    def finger_force(self, arm: str) -> float:
        """N, with which the weaker of the two fingers presses."""
        states = pybullet.getJointStates(self.index, self._jaws[arm], physicsClientId=self._client)
        return float(min(abs(state[3]) for state in states))

    def advance(self, pull: Callable[[], None]) -> None:
        """One control period of physics.

        :param pull: applies the forces from outside that hold for one step. It is called before
            each.
        """
        for arm in ARMS:
            self._drive_jaws(arm)
        moving = [number for number in self._changed if self._rates[number]]
        self._send(self._changed, SUBSTEPS)
        pull()
        pybullet.stepSimulation(physicsClientId=self._client)
        for left in range(SUBSTEPS - 1, 0, -1):
            self._send(moving, left)
            pull()
            pybullet.stepSimulation(physicsClientId=self._client)
        self._rates[moving] = 0.0
        self._changed = set(moving)

    def _send(self, numbers: Collection[int], left: int) -> None:
        """Give the motors their targets, with `left` steps of the period to go."""
        chosen = sorted(set(numbers) - self._limp)
        if not chosen:
            return
        rates = self._rates[chosen]
        pybullet.setJointMotorControlArray(
            self.index,
            chosen,
            pybullet.POSITION_CONTROL,
            targetPositions=self._targets[chosen] - self._read_more[chosen] - left * STEP * rates,
            targetVelocities=rates,
            forces=self._forces[chosen],
            positionGains=[STIFFNESS] * len(chosen),
            velocityGains=[1.0] * len(chosen),
            physicsClientId=self._client,
        )

    def _drive_jaws(self, arm: str) -> None:
        """Send both fingers the same way, neither further than LEAD from the middle of the two."""
        if arm in self._halted:
            return
        gap, force = self._grips[arm]
        middle = sum(self._jaw_positions(arm)) / 2
        target = min(max(gap / 2, middle - LEAD), middle + LEAD)
        for number in self._jaws[arm]:
            if self._targets[number] != target or self._forces[number] != force:
                self._targets[number], self._forces[number] = target, force
                self._changed.add(number)

    def _jaw_positions(self, arm: str) -> List[float]:
        states = pybullet.getJointStates(self.index, self._jaws[arm], physicsClientId=self._client)
        return [state[0] for state in states]


def arm_of(joint: str) -> str:
    """The arm that a joint belongs to, or ''."""
    return next((arm for arm in ARMS if joint in ARM_JOINTS[arm]), '')
