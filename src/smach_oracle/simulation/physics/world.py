"""The world of a trial: the PR2, the bodies of the scene, physics, the only place with the truth.

The same scene and the same calls give the same states to the last bit: every reset begins in a
fresh physics client, and nothing here reads a clock or shares a random generator.
"""

import math
from typing import Dict, List, NamedTuple, Optional, Tuple, cast

import numpy as np
import pybullet

from smach_oracle.geometry.transforms import from_rpy, inverse, yaw_of
from smach_oracle.pr2.robot import ARMS, CAMERA_FRAME, TOOL_FRAME

from ..scenes.scene import Body, Goal, Scene
from .bodies import PlacedBody, add_body, add_floor, check_scene, pose_of
from .cause_log import CauseSpan
from .disturbances import SEEING, Disturbances
from .door_hinges import DoorHinges
from .harm import HarmWatch
from .pr2_body import FINGERS, PERIOD, STEP, Pr2Body
from .pushed_arm import PushedArm
from .weights import StickingThing, Weights

EMPTY = Scene('none', 0, (), Goal('stands_at', ''))
REST_PERIODS = 30  # control periods after a reset, in which things come to rest
ITERATIONS = 40  # of the solver, in a step of physics


class Contact(NamedTuple):
    """A place where a body touches something."""

    other: str  # name of a body, 'robot' or 'floor'
    link: str  # of the other
    position: np.ndarray  # (3,) m, in the world
    force: float  # N


class World:
    """One PyBullet client, owned by one thread.

    An arm or a body that is not there raises a ValueError.
    """

    def __init__(self, scene: Scene = EMPTY, binning: int = 1) -> None:
        """Build a scene's world.

        :param binning: columns and rows of the head camera's sensor that make one pixel of its
            images, 1 or 2.
        """
        self._client = -1
        self.binning = binning
        self._periods_before = 0
        self.periods = 0  # control periods since the reset
        self.reset(scene)

    def reset(self, scene: Scene) -> None:
        """Build a scene's world from nothing, and let it come to rest.

        :raises SceneBuildError: with what is wrong with the scene. The world is as it was then.
        """
        check_scene(scene)
        client = pybullet.connect(pybullet.DIRECT)
        try:
            floor, robot, placed = self._build(client, scene)
            disturbances = Disturbances(scene, robot)
        except Exception:
            pybullet.disconnect(client)
            raise
        self.close()
        self._client, self._robot, self._placed = client, robot, placed
        self._weights = Weights(client, placed.values())
        self._hinges = DoorHinges(client, placed)
        self._pushed: List[PushedArm] = []
        self._sticking: Dict[str, StickingThing] = {}
        self.scene, self._disturbances = scene, disturbances
        self._names = {robot.index: 'robot', floor: 'floor'}
        self._names.update({each.number: name for name, each in placed.items()})
        self._periods_before += self.periods
        self.periods = self.drives = 0
        self.belief_error = np.eye(4)  # 4x4, where the robot believes to be, from where it is
        x, y, yaw = scene.robot.localisation_error
        self.map_error = from_rpy((x, y, 0.0), yaw=yaw)  # 4x4, odom_combined from the world
        self.harm = HarmWatch()  # what comes to harm since the reset
        # (h, w): the number of the body that each pixel of the last image shows
        self.labels = np.zeros((0, 0), int)
        self.step(REST_PERIODS)
        self.happened('start')

    def _build(self, client: int, scene: Scene) -> Tuple[int, Pr2Body, Dict[str, PlacedBody]]:
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP,
            numSolverIterations=ITERATIONS,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        floor = add_floor(client)
        robot = Pr2Body(client, scene.robot)
        robot.never_meets(floor)
        return floor, robot, {body.name: add_body(client, body) for body in scene.bodies}

    def close(self) -> None:
        """Free the physics client. Reset() makes another."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1

    # time

    @property
    def time(self) -> float:
        """s of simulated time since the first reset began. It never goes back."""
        return (self._periods_before + self.periods) * PERIOD

    def step(self, count: int = 1) -> None:
        """Let `count` control periods of 1/60 s pass."""
        for _ in range(count):
            self._disturbances.tick(self)
            self._hinges.tick()
            self._robot.advance(self._push)
            self.periods += 1
            self.harm.tick(self)

    def leap(self, count: int) -> None:
        """Let `count` control periods pass in which nothing moves, without physics."""
        self.periods += count

    def _push(self) -> None:
        """Apply the forces from outside, in the coming step of physics."""
        self._weights.pull()
        for each in self._pushed:
            each.push()
        self._pushed = [each for each in self._pushed if not each.over]

    def push_arm(self, joints: Dict[str, float], seconds: float, motors: bool) -> None:
        """Begin to push an arm as a person would. See PushedArm."""
        self._pushed.append(PushedArm(self._robot, joints, seconds, motors))

    def happened(self, *events: str, place: Optional[np.ndarray] = None) -> None:
        """Count events, such as 'look_at'. They may set off a disturbance of the scene.

        :param place: (3,) m in the world, where. None means where camera or base is.
        """
        for event in events:
            here = self.link_pose(CAMERA_FRAME) if event in SEEING else self.true_base()
            self._disturbances.happened(
                event, self.periods, here[:3, 3] if place is None else place
            )

    @property
    def disturbed(self) -> bool:
        """Whether a disturbance moves something: motions should not count as done before."""
        return self._disturbances.moving

    @property
    def disturbances(self) -> Disturbances:
        """The disturbances of this trial's world."""
        return self._disturbances

    def cause_spans(self) -> List[CauseSpan]:
        """Return when the scene's causes were there, as of now, s since the scene was at rest."""
        self._disturbances.log.look(self, self.disturbed)
        return self._disturbances.log.spans(REST_PERIODS, self.periods)

    # the robot

    @property
    def robot(self) -> Pr2Body:
        """The PR2's body."""
        return self._robot

    @property
    def client(self) -> int:
        """PyBullet's number for this world. Each reset gives another one."""
        return self._client

    def joints(self) -> Dict[str, float]:
        """Return the positions of the encoders, rad or m."""
        return self._robot.states(0)

    def joint_velocities(self) -> Dict[str, float]:
        """Return the velocities of the encoders, rad/s or m/s."""
        return self._robot.states(1)

    def joint_efforts(self) -> Dict[str, float]:
        """Return the efforts of the motors, N m or N."""
        return self._robot.states(3)

    def set_target(
        self, joint: str, position: float, velocity: float = 0.0, max_force: Optional[float] = None
    ) -> None:
        """Send a joint to a position at the end of the coming control period, and hold it there.

        :param velocity: rad/s or m/s on the way. It holds for that one period.
        :raises ValueError: for an unknown joint, a position outside its limits, or what is not a
            finite number.
        """
        wrong = self._robot.refusal(joint, position)
        if not wrong and not math.isfinite(velocity):
            wrong = '{}: velocity is {}; allowed: finite numbers'.format(joint, velocity)
        if wrong:
            raise ValueError(wrong)
        self._robot.set_target(joint, position, velocity, max_force)

    def set_gripper(self, arm: str, gap: float, max_effort: float) -> None:
        """Send a gripper to `gap` m between its tips.

        :param max_effort: N, with which each finger presses at most.
        :raises ValueError: for an unknown arm, or a gap or effort that cannot be.
        """
        self._check_arm(arm)
        if not 0.0 <= gap <= 0.0901 or not 0.0 < max_effort <= 200.0:
            raise ValueError(
                '{} gripper: gap {} m with {} N; allowed: 0 to 0.09 m, above 0 to 200 N'.format(
                    arm, gap, max_effort
                )
            )
        self._robot.set_grip(arm, min(gap, 0.09), max_effort)

    def gap(self, arm: str) -> float:
        """m between the finger tips of an arm."""
        self._check_arm(arm)
        return self._robot.gap(arm)

    def true_base(self) -> np.ndarray:
        """4x4, the world from base_footprint, in truth."""
        return self._robot.base()

    def odom_from_base(self) -> np.ndarray:
        """4x4, where the robot believes to stand: odom_combined from base."""
        return self.map_error @ self._robot.base() @ inverse(self.belief_error)

    def localise(self, odom_from_base: np.ndarray) -> None:
        """Tell the robot where it stands (4x4), as somebody or something has found out."""
        self.map_error = odom_from_base @ inverse(self._robot.base())
        self.belief_error = np.eye(4)

    def drive_error(self, share: float = 1.0) -> np.ndarray:
        """4x4, by how much the next drive will miss its goal unknown to the robot.

        The same trial has the same errors.

        :param share: of the error that is drawn again: a short drive keeps most of the last one's.
        """
        self.drives += 1
        generator = np.random.default_rng([self.scene.seed, 101, self.drives])
        # an array, which numpy's types may take for one number
        drawn = cast('np.ndarray', generator.normal(0.0, self.scene.robot.drive_error))
        before = np.array(
            [self.belief_error[0, 3], self.belief_error[1, 3], yaw_of(self.belief_error)]
        )
        x, y, yaw = (1.0 - share) * before + share * (drawn + self.scene.robot.drive_bias)
        return from_rpy((x, y, 0.0), yaw=yaw)

    def link_pose(self, link: str) -> np.ndarray:
        """4x4, the world from a link of the PR2's URDF.

        :raises ValueError: for an unknown one.
        """
        return self._robot.link_pose(link)

    def tool_pose(self, arm: str) -> np.ndarray:
        """4x4, the world from the tool frame of an arm."""
        self._check_arm(arm)
        return self._robot.link_pose(TOOL_FRAME[arm])

    # things

    @property
    def body_names(self) -> List[str]:
        """The scene's bodies, in its order."""
        return list(self._placed)

    def body(self, name: str) -> Body:
        """A body as the scene has it."""
        return self._find(name).body

    def body_pose(self, name: str, link: str = '') -> np.ndarray:
        """4x4, the world from a body's frame (its centre), or from a link of it.

        :raises ValueError: for a body or link that is not there, with those that are.
        """
        placed = self._find(name)
        if link not in placed.links:
            raise ValueError(
                'no link {!r} in {!r}; there: {}'.format(
                    link, name, ', '.join(filter(None, placed.links))
                )
            )
        if link:
            state = pybullet.getLinkState(
                placed.number,
                placed.links[link],
                computeForwardKinematics=True,
                physicsClientId=self._client,
            )
            return pose_of(state[4], state[5])
        pose = pybullet.getBasePositionAndOrientation(placed.number, physicsClientId=self._client)
        if placed.body.shape != 'urdf':
            return pose_of(*pose)
        inertial = pybullet.getDynamicsInfo(placed.number, -1, physicsClientId=self._client)
        return pose_of(*pose) @ inverse(pose_of(inertial[3], inertial[4]))

    def body_speed(self, name: str) -> Tuple[float, float]:
        """Return how fast a body moves and turns, m/s and rad/s."""
        linear, angular = pybullet.getBaseVelocity(
            self._find(name).number, physicsClientId=self._client
        )
        return float(np.linalg.norm(linear)), float(np.linalg.norm(angular))

    def fastest(self, name: str) -> float:
        """Return the highest speed of a body and its joints, m/s or rad/s."""
        placed = self._find(name)
        joints = (
            [
                abs(state[1])
                for state in pybullet.getJointStates(
                    placed.number, list(placed.joints.values()), physicsClientId=self._client
                )
            ]
            if placed.joints
            else []
        )
        return max([*self.body_speed(name), *joints])

    def body_joint(self, name: str, joint: str) -> float:
        """rad or m of a joint of a body.

        :raises ValueError: for one that is not there, with those that are.
        """
        placed = self._find(name)
        if joint not in placed.joints:
            raise ValueError(
                'no joint {!r} in {!r}; there: {}'.format(
                    joint, name, ', '.join(placed.joints) or 'none'
                )
            )
        position: float = pybullet.getJointState(
            placed.number, placed.joints[joint], physicsClientId=self._client
        )[0]
        return position

    def body_joints(self, name: str) -> List[str]:
        """The joints of a body, in its model's order."""
        return list(self._find(name).joints)

    def slide_body(self, name: str, x: float, y: float, let_go: bool = False) -> None:
        """Push a body over what it stands on, at m/s. It does not topple, but obstacles stop it.

        :param let_go: leave it where it is, with its own friction again.
        """
        placed = self._find(name)
        friction = placed.body.friction if let_go else 0.0
        pybullet.changeDynamics(
            placed.number, -1, lateralFriction=friction, physicsClientId=self._client
        )
        linear, _ = pybullet.getBaseVelocity(placed.number, physicsClientId=self._client)
        pybullet.resetBaseVelocity(
            placed.number, [x, y, linear[2]], [0.0] * 3, physicsClientId=self._client
        )

    def turn_body(self, name: str, joint: str, speed: float, let_go: bool = False) -> None:
        """Drive a joint of a body at rad/s with a person's strength. What is in its way stops it.

        :param let_go: leave it to its own hinge again.
        """
        self._find(name)
        if let_go:
            self._hinges.let_go(name, joint)
        else:
            self._hinges.turn(name, joint, speed)

    def suck_door(self, name: str, torque: float) -> bool:
        """Hold the doors of a body shut with a torque (N m). Whether they are shut."""
        return all([self._hinges.suck(name, joint, torque) for joint in self.body_joints(name)])

    def stick_body(self, name: str, force: float) -> None:
        """Let a body stick to what it stands on, with at most `force` N."""
        self._sticking[name] = StickingThing(
            self._client, self._find(name), self.body_pose(name), force
        )

    def comes_off(self, name: str) -> bool:
        """Whether a body that sticks has been pulled away. It sticks no more then."""
        sticks = self._sticking.get(name)
        if sticks is not None and not sticks.comes_off(self.body_pose(name)):
            return False
        self._sticking.pop(name, None)
        return True

    def contacts(self, name: str) -> List[Contact]:
        """Return what touches a body ('robot' is one here, too), as of the last step."""
        index = self._robot.index if name == 'robot' else self._find(name).number
        found = []
        for point in pybullet.getContactPoints(bodyA=index, physicsClientId=self._client):
            # the solver presses on what is a hair's breadth away, too
            if point[8] <= 0 or point[9] > 0:
                found.append(
                    Contact(
                        self._names[point[2]],
                        self._link_name(point[2], point[4]),
                        np.array(point[6]),
                        point[9],
                    )
                )
        return found

    def holding(self, name: str) -> str:
        """The arm both of whose fingers touch a body, or ''."""
        touching = {
            contact.link
            for contact in self.contacts(name)
            if contact.other == 'robot' and contact.force > 0
        }
        return next((arm for arm in ARMS if touching.issuperset(FINGERS[arm])), '')

    def movable(self) -> List[str]:
        """The bodies that can be carried, in the scene's order."""
        return [
            name
            for name, placed in self._placed.items()
            if placed.body.mass > 0 and placed.body.shape != 'urdf'
        ]

    def seen_as(self, index: int) -> str:
        """The name of a body by its number in the client: 'robot', 'floor', or a scene's."""
        return self._names.get(index, '')

    def _link_name(self, index: int, link: int) -> str:
        links = self._robot.links if index == self._robot.index else {}
        for placed in self._placed.values():
            if placed.number == index:
                links = placed.links
        return next((name for name, number in links.items() if number == link), '')

    def _find(self, name: str) -> PlacedBody:
        if name not in self._placed:
            raise ValueError(
                'no body {!r} in this scene; there: {}'.format(
                    name, ', '.join(self._placed) or 'none'
                )
            )
        return self._placed[name]

    @staticmethod
    def _check_arm(arm: str) -> None:
        if arm not in ARMS:
            raise ValueError('unknown arm {!r}; allowed: {}'.format(arm, ', '.join(ARMS)))
