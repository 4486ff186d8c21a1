"""Motions of the PR2's other controllers: grippers, torso, head, base."""

import math
from typing import List, Optional, Sequence

import numpy as np

from smach_oracle.geometry.transforms import VectorLike, from_rpy, inverse, yaw_of
from smach_oracle.pr2.model.pr2_model import BASE_JOINTS
from smach_oracle.pr2.robot import ARMS, GRIPPER_OPEN, GripperState

from .easing import eased
from .neck import NECK, head_angles
from .pr2_body import PERIOD
from .trajectory import ARRIVAL_S, GOAL_TOLERANCE, MotionResult, Trajectory
from .world import World

CLOSING_SPEED = 0.08  # m/s of the gap
STALL_S = 0.25
LONGEST_S = 10.0  # for what trembles between the fingers
TORSO_SPEED = 0.013  # m/s, a PR2's
HEAD_SPEED = 1.0  # rad/s, mean of a turn
# m, or rad, after which a drive's error is all its own. A shorter one keeps some of the last one's
LONG_DRIVE = 0.5
BASE_SPEED, BASE_TURN = 0.25, 0.4  # m/s, rad/s, means of a drive


class GripperMotion:
    """Moves the two fingers of a hand to a gap.

    It ends when they are there, or stall, or have not come to rest in LONGEST_S.
    """

    def __init__(self, arm: str, position: float, max_effort: float = 50.0) -> None:
        """Take a command.

        :param position: m between the tips.
        :param max_effort: N.
        :raises ValueError: for an unknown arm, a gap outside 0 to 0.09, an effort outside 0 to 200.
        """
        if arm not in ARMS:
            raise ValueError('unknown arm {!r}; allowed: {}'.format(arm, ', '.join(ARMS)))
        if not 0.0 <= position <= GRIPPER_OPEN + 1e-3 or not 0.0 < max_effort <= 200.0:
            raise ValueError(
                '{} gripper: {} m with {} N; allowed: 0 to {} m, above 0 to 200 N'.format(
                    arm, position, max_effort, GRIPPER_OPEN
                )
            )
        self._arm, self._goal, self._effort = arm, min(position, GRIPPER_OPEN), max_effort
        self._gaps: List[float] = []
        self._sent = self._start = 0.0

    def tick(self, world: World) -> Optional[MotionResult]:
        """See Motion."""
        gap = world.gap(self._arm)
        if not self._gaps:
            self._start = gap
            # fingers that press on something go on pressing
            self._sent = min(gap, world.robot.sent_gap(self._arm)) if self._goal < gap else gap
        self._gaps.append(gap)
        step = CLOSING_SPEED * PERIOD
        self._sent += min(max(self._goal - self._sent, -step), step)
        world.set_gripper(self._arm, min(max(self._sent, 0.0), GRIPPER_OPEN), self._effort)
        window = round(STALL_S / PERIOD)
        trembling = (
            len(self._gaps) <= window
            or max(self._gaps[-window:]) - min(self._gaps[-window:]) > 3e-4
        )
        if trembling and len(self._gaps) * PERIOD < LONGEST_S:
            return None
        reached = abs(gap - self._goal) < 2e-3
        if not reached and abs(self._sent - self._goal) > 1e-6:
            return None
        effort = world.robot.finger_force(self._arm)
        return MotionResult(True, '', GripperState(gap, effort, not reached, reached))

    def events(self) -> Sequence[str]:
        """See Motion."""
        return ['{}_{}'.format('open' if self._goal > self._start else 'close', self._arm)]

    def stop(self, world: World) -> None:
        """See Motion; fingers that close no longer press, as on a PR2.

        Its pr2_gripper_action sends the present gap, with no effort, where a goal is cancelled.
        """
        world.set_gripper(
            self._arm, min(max(world.gap(self._arm), 0.0), GRIPPER_OPEN), self._effort
        )


class TorsoMotion(Trajectory):
    """Moves the spindle to a height, at a PR2's pace."""

    def __init__(self, world: World, height: float) -> None:
        """Take a command.

        :param height: m.
        :raises ValueError: for a height that is not finite.
        """
        if not math.isfinite(height):
            raise ValueError('torso: height is {}; allowed: 0 to 0.31 m'.format(height))
        self.height = height
        way = abs(height - world.robot.position('torso_lift_joint'))
        super().__init__(
            ['torso_lift_joint'], np.array([[height]]), np.array([max(way / TORSO_SPEED, PERIOD)])
        )

    def events(self) -> Sequence[str]:
        """See Motion."""
        return ['torso']


class HeadMotion(Trajectory):
    """Points the camera's optical axis at a point."""

    def __init__(self, world: World, point: VectorLike) -> None:
        """Take a command.

        :param point: (3,) m in BASE_FRAME.
        :raises ValueError: for a point that is not finite, or that the head cannot turn to.
        """
        turn = head_angles(world.robot.position('torso_lift_joint'), point)
        self.point = np.asarray(point, float)
        here = [world.robot.position(name) for name in NECK[1:]]
        for name, angle in zip(NECK[1:], turn):
            if world.robot.refusal(name, angle):
                raise ValueError(
                    'cannot look at {}: {}'.format(
                        np.round(np.asarray(point, float), 3).tolist(),
                        world.robot.refusal(name, angle),
                    )
                )
        span = max(0.2, float(np.abs(turn - here).max()) / HEAD_SPEED)
        super().__init__(NECK[1:], turn[None], np.array([span]), np.zeros((1, 2)))

    def events(self) -> Sequence[str]:
        """See Motion."""
        return ['look_at']


class BaseMotion:
    """Drives the base, straight and blindly, to where odometry has the goal.

    It sets off when the disturbances that its beginning has set off are over.
    """

    def __init__(self, odom_from_goal: np.ndarray) -> None:
        """Take a command.

        :param odom_from_goal: 4x4.
        :raises ValueError: for a goal that is not a finite 4x4.
        """
        if np.shape(odom_from_goal) != (4, 4) or not np.isfinite(odom_from_goal).all():
            raise ValueError('drive: the goal is no finite 4x4 pose')
        self._goal = np.asarray(odom_from_goal, float)
        self._departed, self._begun = False, -1

    def tick(self, world: World) -> Optional[MotionResult]:
        """See Motion."""
        if not self._departed:
            self._departed = True
            world.happened('depart', place=(inverse(world.map_error) @ self._goal)[:3, 3])
        if self._begun < 0:
            if world.disturbed:
                return None
            self._begin(world)
        done = (world.periods - self._begun) / self._periods
        here, there = (self._place_at(min(1.0, done + more)) for more in (0.0, 1.0 / self._periods))
        lag = np.abs(
            [world.robot.position(name) - wanted for name, wanted in zip(BASE_JOINTS, here)]
        ).max()
        if lag > 0.05:
            self.stop(world)
            return MotionResult(
                False,
                'the base is {:.2f} off its way (m or rad): something is in its way'.format(lag),
            )
        if done >= 1.0:
            return self._arrive(world, done, lag)
        for name, before, after in zip(BASE_JOINTS, here, there):
            world.robot.set_target(name, after, (after - before) / PERIOD, None)
        share = eased(min(1.0, done + 1.0 / self._periods))
        world.belief_error = from_rpy(
            (*(self._errors[0] + share * (self._errors[1] - self._errors[0]))[:2], 0.0),
            yaw=(self._errors[0] + share * (self._errors[1] - self._errors[0]))[2],
        )
        return None

    def _begin(self, world: World) -> None:
        way = inverse(world.odom_from_base()) @ self._goal
        error = world.drive_error(
            min(1.0, (float(np.hypot(way[0, 3], way[1, 3])) + abs(yaw_of(way))) / LONG_DRIVE)
        )
        true_goal = inverse(world.map_error) @ self._goal @ error
        self._begun = world.periods
        self._start = np.array([world.robot.position(name) for name in BASE_JOINTS])
        turn = (yaw_of(true_goal) - self._start[2] + np.pi) % (2 * np.pi) - np.pi
        self._change = np.array([*(true_goal[:2, 3] - self._start[:2]), turn])
        self._errors = [
            np.array([pose[0, 3], pose[1, 3], yaw_of(pose)]) for pose in (world.belief_error, error)
        ]
        seconds = max(0.5, float(np.hypot(*self._change[:2])) / BASE_SPEED, abs(turn) / BASE_TURN)
        self._periods = math.ceil(seconds / PERIOD)

    def _place_at(self, share: float) -> np.ndarray:
        return self._start + eased(share) * self._change

    def _arrive(self, world: World, done: float, lag: float) -> Optional[MotionResult]:
        for name, position in zip(BASE_JOINTS, self._place_at(1.0)):
            world.robot.set_target(name, position, 0.0, None)
        waited = (done - 1.0) * self._periods * PERIOD
        if lag < GOAL_TOLERANCE and waited >= ARRIVAL_S[0]:
            return MotionResult(True)
        return (
            MotionResult(False, 'the base ended {:.2f} (m or rad) from its goal'.format(lag))
            if waited > ARRIVAL_S[1]
            else None
        )

    def events(self) -> Sequence[str]:
        """See Motion."""
        return ['drive']

    def stop(self, world: World) -> None:
        """See Motion."""
        for name in BASE_JOINTS:
            world.robot.set_target(name, world.robot.position(name), 0.0, None)
