"""Settings of the manipulation interface: what cannot be is refused by name, before anything
moves.
"""

import math
import sys
from pathlib import Path

import pytest
import rospy

from smach_oracle.interfaces.manipulation.clearance import PYBULLET
from smach_oracle.interfaces.manipulation.settings import TeleoperationSettings
from smach_oracle.oracle.errors import SettingsError

ARMS = {'right': {'base': 'torso', 'tool': 'hand', 'command': 'arm/command', 'gripper': 'gripper'}}


@pytest.fixture(name='read')
def make_read(monkeypatch):
    def read(**given):
        values = dict({'arms': ARMS}, **given)
        monkeypatch.setattr(
            rospy, 'get_param', lambda key, default=None: values.get(key.lstrip('~'), default)
        )
        monkeypatch.setattr(rospy, 'resolve_name', lambda name: '/node/' + name.lstrip('~'))
        return TeleoperationSettings.from_parameters()

    return read


def test_what_is_not_given_has_its_default(read):
    settings = read(
        limits={'linear': 0.1, 'workspace': [[-1, -1, 0], [1, 1, 2]]},
        states={'PICK': {'arm': 'right'}},
    )
    assert settings.limits.linear == 0.1 and settings.limits.angular == 1.0
    assert settings.limits.workspace == ((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0))
    assert (
        settings.watchdog_s == 0.06
        and settings.period_s == pytest.approx(1 / 60)
        and not settings.lock_step
    )
    assert (
        settings.arm_of('PICK', {}, 'left') == 'right'
        and settings.arm_of('OTHER', {}, 'left') == 'left'
    )
    assert settings.outputs_of('PICK') == {}


@pytest.mark.parametrize(
    'userdata, arm',
    [
        ({'arm': 'left'}, 'left'),
        ({'arm': 'LEFT_ARM'}, 'left'),
        ({'arm': 'upright'}, 'right'),
        ({'arm': 7}, 'right'),
        ({'arm': 'left or right'}, 'right'),
        ({'hand': 'left'}, 'right'),
        ({'side': 'left'}, 'left'),
        ({'arm': None, 'side': 'left'}, 'left'),
    ],
)
def test_the_arm_is_the_one_that_the_userdata_names_else_the_state_s(read, userdata, arm):
    settings = read(
        arms=dict(ARMS, left=ARMS['right']),
        states={'PICK': {'arm': 'right'}},
        arm_keys=['arm', 'side'],
    )
    assert settings.arm_of('PICK', userdata, 'left') == arm


@pytest.mark.parametrize(
    'given, says',
    [
        ({'arms': {}}, 'arms'),
        ({'arms': 7}, 'arms'),
        ({'base_frame': ''}, 'base_frame'),
        ({'snapshot': 3}, 'snapshot'),
        ({'states': ['PICK']}, 'states'),
        ({'arms': {'right': {'base': 'torso'}}}, 'arms/right'),
        ({'arms': {'right': dict(ARMS['right'], tool='')}}, 'arms/right.tool'),
        ({'arms': {'right': dict(ARMS['right'], posture=[0.0, math.nan])}}, 'posture'),
        ({'arm_keys': 'arm'}, 'arm_keys'),
        ({'lease_s': 0.0}, 'lease_s'),
        ({'rate_hz': 10}, 'rate_hz'),
        ({'rate_hz': 50, 'lock_step': True}, 'rate_hz: 50.0 .* 30 or 60'),
        ({'rate_hz': 120, 'lock_step': True}, 'rate_hz'),
        ({'watchdog_s': math.nan}, 'watchdog_s'),
        ({'watchdog_s': 3.0}, 'watchdog_s'),
        ({'lead': True}, 'lead'),
        ({'lock_step': 'yes'}, 'lock_step'),
        ({'success': 'succeeded'}, 'success'),
        ({'limits': {'speed': 1.0}}, 'limits/speed'),
        ({'limits': {'linear': 0.0}}, 'limits/linear'),
        ({'limits': {'joint_share': 0.0}}, 'limits/joint_share'),
        ({'limits': {'angular': 0}}, 'limits/angular'),
        ({'limits': {'stop_below': 0.2}}, 'limits/stop_below'),
        ({'limits': {'workspace': [[0, 0, 0], [1, 1]]}}, 'limits/workspace'),
        ({'limits': {'workspace': [[0, 0, 0], [1, 1, -1]]}}, 'limits/workspace'),
        ({'states': {'PICK': {'arm': 'left'}}}, 'states/PICK/arm'),
        ({'states': {'PICK': {'outputs': {'grasp': 'pose'}}}}, 'states/PICK/outputs/grasp'),
    ],
)
def test_what_cannot_be_is_refused_by_name(read, given, says):
    with pytest.raises(SettingsError, match=says):
        read(**given)


def test_the_keys_of_refusals_are_whole_names(read):
    with pytest.raises(SettingsError, match='/node/limits/linear: -1'):
        read(limits={'linear': -1})


@pytest.mark.parametrize('rate_hz, lock_step', [(30, True), (60, True), (50, False), (120, False)])
def test_rates_that_can_be_are_taken(read, rate_hz, lock_step):
    assert read(rate_hz=rate_hz, lock_step=lock_step).rate_hz == rate_hz


def test_without_pybullet_the_clearance_is_refused_at_once_and_all_else_goes_on(read, monkeypatch):
    monkeypatch.setitem(sys.modules, 'pybullet', None)
    with pytest.raises(
        SettingsError, match='/node/clearance: True .* allowed: false, .*pip install pybullet=='
    ):
        read().build()
    # the next thing that it needs
    with pytest.raises(SettingsError, match='/node/robot_description'):
        monkeypatch.setattr(rospy, 'has_param', lambda _name: True)
        read(clearance=False).build()


@pytest.mark.parametrize('file', ['requirements.txt', 'requirements-noetic.txt'])
def test_the_pybullet_that_is_asked_for_is_the_pinned_one(file):
    lines = (Path(__file__).resolve().parents[4] / file).read_text(encoding='utf-8').splitlines()
    assert PYBULLET in [line.split()[0].rstrip(';') for line in lines if line]
