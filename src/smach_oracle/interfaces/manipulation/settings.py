"""The settings of the manipulation interface, from its node's parameters."""

import re
import time
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np
import rospy

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.ros.parameters import (
    checked_mapping,
    checked_number,
    flag_of,
    mapping_of,
    name_of,
    names_of,
    number_of,
)

from .arm_port import ArmNames, JointListener
from .cartesian_drive import DriveLimits
from .clearance import ClearanceError, load_pybullet
from .surroundings import Surroundings
from .teleoperated_arm import DescribedRobot, TeleoperatedArm

NO_SNAPSHOT = 'none'
# of the tool, when the gripper last closed on something, else where it is now
GRASP_POSE = 'grasp_pose'
TOOL_POSE = 'tool_pose'  # of the tool, now
_WORLD_HZ = 60.0  # control periods in a second of a world in lock-step
_DESCRIPTION_S = 60.0
_OUTPUTS = (GRASP_POSE, TOOL_POSE)
_NEVER_ZERO = ('linear', 'angular', 'joint_share')  # of the limits: what is divided by


class StateTeleoperation(NamedTuple):
    """The interface's settings for one state."""

    arm: str = ''  # which one the person begins with. '' means the one driven last
    outputs: Mapping[str, str] = {}  # output key: one of _OUTPUTS


class TeleoperationSettings(NamedTuple):
    """The node's settings. launch/manipulation_interface.yaml explains each."""

    arms: Dict[str, ArmNames]
    base: str
    limits: DriveLimits
    states: Dict[str, StateTeleoperation]
    arm_keys: List[str]  # of input userdata whose value names an arm
    success: List[str]
    rate_hz: float
    watchdog_s: float
    lease_s: float
    lead: float
    gripper_effort: float
    lock_step: bool
    snapshot: str  # service of a world in lock-step that publishes the joints as they are, or none
    clearance: bool

    @classmethod
    def from_parameters(cls) -> 'TeleoperationSettings':
        """Read the settings from the node's private parameters.

        :raises SettingsError: naming the parameter, its value and what is allowed.
        """
        arms = mapping_of('~arms')
        if not arms:
            raise SettingsError(
                rospy.resolve_name('~arms'),
                arms,
                'one arm or more; see manipulation_interface.yaml',
            )
        names = {name: ArmNames.parse('~arms/' + name, value) for name, value in arms.items()}
        states = {
            state: _state(state, value, names) for state, value in mapping_of('~states').items()
        }
        return cls(
            names,
            name_of('~base_frame', 'base_footprint'),
            _limits(),
            states,
            names_of('~arm_keys', ['arm']),
            names_of('~success', ['succeeded']),
            _rate_hz(),
            number_of('~watchdog_s', 0.06, 0.01, 0.5),
            number_of('~lease_s', 3.0, 0.5, 60.0),
            number_of('~lead', 0.12, 0.01, 1.0),
            number_of('~gripper_effort', 60.0, 1.0, 500.0),
            flag_of('~lock_step', False),
            name_of('~snapshot', NO_SNAPSHOT),
            flag_of('~clearance', True),
        )

    @property
    def period_s(self) -> float:
        """One control period, s."""
        return 1.0 / self.rate_hz

    def outputs_of(self, state: str) -> Mapping[str, str]:
        """The outputs that the interface gives for a state: by key, one of those above."""
        return self.states.get(state, StateTeleoperation()).outputs

    def arm_of(self, state: str, userdata: Mapping[str, Any], otherwise: str) -> str:
        """The arm for a state: the one that its userdata names, else the one that is set for it."""
        for key in self.arm_keys:
            # of 'right_arm', too
            words = re.split('[^a-z0-9]+', str(userdata.get(key, '')).lower())
            named = [arm for arm in self.arms if arm.lower() in words]
            if len(named) == 1:
                return named[0]
        return self.states.get(state, StateTeleoperation()).arm or otherwise

    def build(self) -> Tuple[Dict[str, TeleoperatedArm], Optional[Surroundings]]:
        """Make the arms and their surroundings.

        :raises SettingsError: where no robot description is set within 60 s of wall time, or
            `~clearance` lacks PyBullet.
        :raises ValueError: where it lacks a link that is named, or cannot be loaded.
        """
        if self.clearance:
            _need_pybullet()
        urdf = _description()
        if not isinstance(urdf, str) or not urdf:
            raise SettingsError(rospy.resolve_name('robot_description'), urdf, 'the text of a URDF')
        robot = DescribedRobot(urdf, self.base, JointListener())
        arms = {
            name: TeleoperatedArm(robot, names, self.limits, self.lead)
            for name, names in self.arms.items()
        }
        surroundings = Surroundings(robot, self.limits.slow_below) if self.clearance else None
        if surroundings is not None:
            for arm in arms.values():
                surroundings.watch_over(arm)
        return arms, surroundings


def _need_pybullet() -> None:
    try:
        load_pybullet()
    except ClearanceError as err:
        raise SettingsError(
            rospy.resolve_name('~clearance'),
            True,
            'false, with which all works but slowing down near '
            "the robot's own body and the collision map; true {}".format(err),
        ) from err


def _description() -> object:
    """The robot description, which another node of the same launch may still be about to set."""
    until_s = time.monotonic() + _DESCRIPTION_S
    while (
        time.monotonic() < until_s
        and not rospy.is_shutdown()
        and not rospy.has_param('robot_description')
    ):
        time.sleep(0.1)
    return rospy.get_param('robot_description', '')


def _rate_hz() -> float:
    rate_hz = number_of('~rate_hz', _WORLD_HZ, 30.0, 500.0)
    if flag_of('~lock_step', False) and _WORLD_HZ % rate_hz:
        raise SettingsError(
            rospy.resolve_name('~rate_hz'),
            rate_hz,
            "30 or 60 in lock-step: a period is a whole number of the world's, of which a second "
            'has 60',
        )
    return rate_hz


def _limits() -> DriveLimits:
    given = dict(mapping_of('~limits'))
    workspace = given.pop('workspace', None)
    unknown = sorted(set(given) - set(DriveLimits._fields))
    if unknown:
        raise SettingsError(
            '~limits/' + unknown[0], given[unknown[0]], 'the keys ' + ', '.join(DriveLimits._fields)
        )
    values: Dict[str, Any] = {
        key: checked_number('~limits/' + key, value, 1e-3 if key in _NEVER_ZERO else 0.0, 100.0)
        for key, value in given.items()
    }
    if workspace is not None:
        values['workspace'] = _corners(workspace)
    limits = DriveLimits(**values)
    if not limits.stop_below < limits.slow_below:
        raise SettingsError('~limits/stop_below', limits.stop_below, 'less than slow_below')
    return limits


def _corners(value: object) -> Tuple[Tuple[float, ...], Tuple[float, ...]]:
    allowed = 'two corners [[x, y, z], [x, y, z]] (m), the lower one first'
    try:
        corners = np.array(value, float)
    except (TypeError, ValueError, OverflowError) as err:
        raise SettingsError('~limits/workspace', value, allowed) from err
    if corners.shape != (2, 3) or not (corners[0] < corners[1]).all():
        raise SettingsError('~limits/workspace', value, allowed)
    low, high = corners.tolist()
    return tuple(low), tuple(high)


def _state(state: str, value: object, arms: Mapping[str, ArmNames]) -> StateTeleoperation:
    key = '~states/' + state
    found = dict(checked_mapping(key, value))
    unknown = sorted(set(found) - {'arm', 'outputs'})
    if unknown:
        raise SettingsError(
            '{}/{}'.format(key, unknown[0]), found[unknown[0]], 'the keys arm, outputs'
        )
    if found.get('arm', next(iter(arms))) not in list(arms):  # a list: it need not be hashable
        raise SettingsError(key + '/arm', found['arm'], ', '.join(sorted(arms)))
    outputs = checked_mapping(key + '/outputs', found.get('outputs', {}))
    for name, pose in outputs.items():
        if pose not in _OUTPUTS:
            raise SettingsError('{}/outputs/{}'.format(key, name), pose, ', '.join(_OUTPUTS))
    return StateTeleoperation(found.get('arm', ''), outputs)
