"""The settings of the manipulation interface, from its node's parameters."""
import re
import time
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Tuple

import rospy

from ..oracle.errors import ConfigError
from ..ros.parameters import checked_mapping, checked_number, flag_of, mapping_of, name_of, names_of, number_of
from .arm_port import ArmNames, JointListener
from .clearance import ClearanceError, load_pybullet
from .hand import Hand, Robot
from .surroundings import Surroundings
from .teleoperation import DriveLimits

NO_SNAPSHOT = 'none'
GRASP_POSE = 'grasp_pose'  # of the tool, when the gripper last closed on something; else where it is now
TOOL_POSE = 'tool_pose'  # of the tool, now
_WORLD_HZ = 60.0  # control periods in a second of a world in lock-step
_DESCRIPTION_S = 60.0
_OUTPUTS = (GRASP_POSE, TOOL_POSE)
_NEVER_ZERO = ('linear', 'angular', 'joint_share')  # of the limits: what is divided by


class TeleoperationSettings(NamedTuple):
    """See launch/manipulation_interface.yaml for what each means and what the PR2 has."""

    arms: Dict[str, ArmNames]
    base: str
    limits: DriveLimits
    states: Dict[str, Dict[str, Any]]
    arm_keys: List[str]  # of input userdata whose value names an arm
    success: List[str]
    rate_hz: float
    watchdog_s: float
    lease_s: float
    lead: float
    gripper_effort: float
    lock_step: bool
    snapshot: str  # service of a world in lock-step that tells the joints as they are now, or none
    clearance: bool

    @classmethod
    def from_parameters(cls) -> 'TeleoperationSettings':
        """From the node's private parameters.

        :raises ConfigError: naming the parameter, its value and what is allowed.
        """
        arms = mapping_of('~arms')
        if not arms:
            raise ConfigError(rospy.resolve_name('~arms'), arms, 'one arm or more; see manipulation_interface.yaml')
        names = {name: ArmNames.parse('~arms/' + name, value) for name, value in arms.items()}
        states = {state: _state(state, value, names) for state, value in mapping_of('~states').items()}
        return cls(names, name_of('~base_frame', 'base_footprint'), _limits(), states, names_of('~arm_keys', ['arm']),
                   names_of('~success', ['succeeded']), _rate_hz(),
                   number_of('~watchdog_s', 0.06, 0.01, 0.5), number_of('~lease_s', 3.0, 0.5, 60.0),
                   number_of('~lead', 0.12, 0.01, 1.0),
                   number_of('~gripper_effort', 60.0, 1.0, 500.0), flag_of('~lock_step', False),
                   name_of('~snapshot', NO_SNAPSHOT), flag_of('~clearance', True))

    @property
    def period_s(self) -> float:
        """One control period, s."""
        return 1.0 / self.rate_hz

    def outputs_of(self, state: str) -> Mapping[str, str]:
        """Which outputs the interface tells for a state: by key, one of those above."""
        outputs: Mapping[str, str] = self.states.get(state, {}).get('outputs', {})
        return outputs

    def arm_of(self, state: str, userdata: Mapping[str, Any], otherwise: str) -> str:
        """The arm that does the state's work: the one that its userdata names, else the one that is set for it."""
        for key in self.arm_keys:
            words = re.split('[^a-z0-9]+', str(userdata.get(key, '')).lower())  # of 'right_arm', too
            named = [arm for arm in self.arms if arm.lower() in words]
            if len(named) == 1:
                return named[0]
        arm: str = self.states.get(state, {}).get('arm', otherwise)
        return arm

    def build(self) -> Tuple[Dict[str, Hand], Optional[Surroundings]]:
        """The arms, and what they could hit.

        :raises ConfigError: where no robot description is set within 60 s of wall time, or `~clearance` lacks PyBullet.
        :raises ValueError: where it lacks a link that is named, or cannot be loaded.
        """
        if self.clearance:
            _need_pybullet()
        urdf = _description()
        if not isinstance(urdf, str) or not urdf:
            raise ConfigError(rospy.resolve_name('robot_description'), urdf, 'the text of a URDF')
        robot = Robot(urdf, self.base, JointListener())
        hands = {name: Hand(robot, names, self.limits, self.lead) for name, names in self.arms.items()}
        surroundings = Surroundings(robot, self.limits.slow_below) if self.clearance else None
        if surroundings is not None:
            for hand in hands.values():
                surroundings.watch_over(hand)
        return hands, surroundings


def _need_pybullet() -> None:
    try:
        load_pybullet()
    except ClearanceError as err:
        raise ConfigError(rospy.resolve_name('~clearance'), True, 'false, with which all works but slowing down near '
                          'the robot\'s own body and the collision map; true {}'.format(err)) from err


def _description() -> object:
    """The robot description, which another node of the same launch may still be about to set."""
    until_s = time.monotonic() + _DESCRIPTION_S
    while time.monotonic() < until_s and not rospy.is_shutdown() and not rospy.has_param('robot_description'):
        time.sleep(0.1)
    return rospy.get_param('robot_description', '')


def _rate_hz() -> float:
    rate_hz = number_of('~rate_hz', _WORLD_HZ, 30.0, 500.0)
    if flag_of('~lock_step', False) and _WORLD_HZ % rate_hz:
        raise ConfigError(rospy.resolve_name('~rate_hz'), rate_hz,
                          '30 or 60 in lock-step: a period is a whole number of the world\'s, of which a second has 60')
    return rate_hz


def _limits() -> DriveLimits:
    given = dict(mapping_of('~limits'))
    workspace = given.pop('workspace', None)
    unknown = sorted(set(given) - set(DriveLimits._fields))
    if unknown:
        raise ConfigError('~limits/' + unknown[0], given[unknown[0]], 'the keys ' + ', '.join(DriveLimits._fields))
    values = {key: checked_number('~limits/' + key, value, 1e-3 if key in _NEVER_ZERO else 0.0, 100.0)
              for key, value in given.items()}
    if workspace is not None:
        values['workspace'] = _corners(workspace)
    limits = DriveLimits(**values)
    if not limits.stop_below < limits.slow_below:
        raise ConfigError('~limits/stop_below', limits.stop_below, 'less than slow_below')
    return limits


def _corners(value: Any) -> Tuple[Tuple[float, ...], Tuple[float, ...]]:
    allowed = 'two corners [[x, y, z], [x, y, z]] (m), the lower one first'
    try:
        low, high = ([float(part) for part in corner] for corner in value)
    except (TypeError, ValueError) as err:
        raise ConfigError('~limits/workspace', value, allowed) from err
    if len(low) != 3 or len(high) != 3 or not all(a < b for a, b in zip(low, high)):
        raise ConfigError('~limits/workspace', value, allowed)
    return tuple(low), tuple(high)


def _state(state: str, value: Any, arms: Mapping[str, ArmNames]) -> Dict[str, Any]:
    key = '~states/' + state
    found = dict(checked_mapping(key, value))
    unknown = sorted(set(found) - {'arm', 'outputs'})
    if unknown:
        raise ConfigError('{}/{}'.format(key, unknown[0]), found[unknown[0]], 'the keys arm, outputs')
    if found.get('arm', next(iter(arms))) not in arms:
        raise ConfigError(key + '/arm', found['arm'], ', '.join(sorted(arms)))
    for name, what in checked_mapping(key + '/outputs', found.get('outputs', {})).items():
        if what not in _OUTPUTS:
            raise ConfigError('{}/outputs/{}'.format(key, name), what, ', '.join(_OUTPUTS))
    return found
