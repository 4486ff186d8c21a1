"""A robot's arm on ROS: joint states in, joint targets out, a gripper action."""

import math
import threading
import time
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_msgs.msg import GripperCommandAction, GripperCommandGoal
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks
from smach_oracle.oracle.settings.checks import number
from smach_oracle.ros.goal_link import GoalLink, SentGoal

_FIELDS = ('base', 'tool', 'command', 'gripper')
_ANGLE = number(-math.inf, math.inf, 'a list of angles, rad')


class ArmNames(NamedTuple):
    """The names of an arm's parts on the robot."""

    base: str  # link from which the arm's joints begin
    tool: str  # link that commands move
    command: str  # topic for trajectory_msgs/JointTrajectory
    gripper: str  # control_msgs/GripperCommand action
    # rad, one for each joint: where the arm is at ease. None means the middle of its ranges
    posture: Sequence[float] = ()

    @classmethod
    def parse(cls, key: str, value: object) -> 'ArmNames':
        """Make names from a dictionary.

        :raises SettingsError: naming the key, its value and what is allowed.
        """
        if not isinstance(value, Mapping) or set(value) - {'posture'} != set(_FIELDS):
            raise SettingsError(
                key,
                value,
                'a mapping with the keys {}, and posture or not'.format(', '.join(_FIELDS)),
            )
        for field in _FIELDS:
            if not isinstance(value[field], str) or not value[field]:
                raise checks.no_name('{}.{}'.format(key, field), value[field], 'a name')
        posture = value.get('posture', [])
        if not isinstance(posture, list):
            raise SettingsError(key + '.posture', posture, 'a list of angles, rad')
        for angle in posture:
            _ANGLE(key + '.posture', angle)
        return cls(**value)


class JointListener:
    """The latest joint positions, from every publisher of joint_states together."""

    def __init__(self, topic: str = 'joint_states') -> None:
        self._changed = threading.Condition()
        self._positions: Dict[str, float] = {}
        self._heard_s: Dict[str, float] = {}  # monotonic
        self._stamp = rospy.Time()
        self._subscriber = rospy.Subscriber(
            topic, JointState, self._heard, queue_size=100, tcp_nodelay=True
        )

    def now(self) -> Tuple[Dict[str, float], rospy.Time]:
        """Positions by joint (rad or m), and their time."""
        with self._changed:
            return dict(self._positions), self._stamp

    def silent_s(self, names: Sequence[str]) -> float:
        """Wall time (s) for which one of these joints has been silent.

        Infinity means one never was heard.
        """
        with self._changed:
            return time.monotonic() - min(self._heard_s.get(name, -math.inf) for name in names)

    def wait_for_period(
        self,
        before: Optional[Mapping[str, float]],
        since: rospy.Time,
        period_s: float,
        limit_s: float,
    ) -> bool:
        """Wait until joints are reported a period after `since`. Return whether they were.

        Where `before` is given, they must be elsewhere than that.

        A world that stands still while nobody commands it repeats its positions to the last bit. A
        later report of others comes from after the command.
        """
        after = since + rospy.Duration(0.9 * period_s)

        def passed() -> bool:
            return self._stamp > after and (
                before is None
                or any(self._positions.get(name) != value for name, value in before.items())
            )

        with self._changed:
            return self._changed.wait_for(passed, limit_s)

    def catch_up(self, stamp: rospy.Time, limit_s: float) -> bool:
        """Wait until the joints of `stamp` or later are known. Return whether they are."""
        with self._changed:
            return self._changed.wait_for(lambda: self._stamp >= stamp, limit_s)

    def _heard(self, message: JointState) -> None:
        with self._changed:
            self._positions.update(zip(message.name, message.position))
            self._heard_s.update(dict.fromkeys(message.name, time.monotonic()))
            self._stamp = message.header.stamp
            self._changed.notify_all()


class GripperReport(NamedTuple):
    """A report on how the last motion of a gripper ended."""

    position: float = float('nan')  # m between the finger tips
    stalled: bool = False
    problem: str = ''


class GripperPort:
    """A gripper behind a GripperCommand action."""

    def __init__(self, action: str) -> None:
        self._link = GoalLink(rospy.resolve_name(action), GripperCommandAction)
        self._sent: Optional[SentGoal] = None
        self._wanted = (math.nan, math.nan)  # m, N
        self.report = GripperReport()

    def why_not(self) -> str:
        """Return why it cannot be moved now, or ''."""
        return '' if self._link.ready() else 'no gripper at {}'.format(self._link.name)

    @property
    def moving(self) -> bool:
        """Whether a motion has begun whose end is not known."""
        return self._sent is not None

    def move(self, position: float, effort: float) -> None:
        """Begin to move to `position` m between the tips, with at most `effort` N.

        The same once more, while it is on its way there, changes nothing. Anything else comes in
        its place.
        """
        if self.moving and self._wanted == (position, effort):
            return
        self._wanted = position, effort
        goal = GripperCommandGoal()
        goal.command.position, goal.command.max_effort = position, effort
        self._sent = self._link.send(goal)

    def stop(self) -> None:
        """Take back a motion that has not ended."""
        sent = self._sent
        if sent is not None:
            sent.cancel()

    def poll(self, timeout_s: float) -> bool:
        """Take notice of a motion's end. Return whether it has just ended."""
        if self._sent is None:
            return False
        event = self._sent.poll(timeout_s)
        if event is None and self._link.alive() and not self._sent.unheard(time.monotonic()):
            return False
        if event is not None and not event.status:
            return False
        self._sent = None
        if (
            event is None
            or event.result is None
            or event.status in (GoalStatus.LOST, GoalStatus.REJECTED)
        ):
            self.report = GripperReport(
                problem='gripper {}: its motion got lost'.format(self._link.name)
            )
        else:
            self.report = GripperReport(event.result.position, event.result.stalled)
        return True


class ArmPort:
    """Joint targets for one arm."""

    def __init__(self, topic: str, joints: List[str]) -> None:
        self._joints = joints
        self._publisher = rospy.Publisher(topic, JointTrajectory, queue_size=1, tcp_nodelay=True)

    def why_not(self) -> str:
        """Return why it cannot be moved now, or ''."""
        if self._publisher.get_num_connections():
            return ''
        return 'no controller listens to {}'.format(self._publisher.resolved_name)

    def send(self, positions: np.ndarray, velocities: np.ndarray, period_s: float) -> None:
        """Be at `positions` (n,), rad, `period_s` from now, moving at `velocities` (n,), rad/s."""
        point = JointTrajectoryPoint(
            positions=positions.tolist(),
            velocities=velocities.tolist(),
            time_from_start=rospy.Duration(period_s),
        )
        self._publisher.publish(JointTrajectory(joint_names=self._joints, points=[point]))
