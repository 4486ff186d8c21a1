"""A joystick's messages: what they move, what they do not, and settings that are refused."""

import math
from pathlib import Path

import pytest
import yaml

from smach_oracle.interfaces.manipulation.cartesian_drive import GRIPPER_OPEN
from smach_oracle.interfaces.manipulation.joy_teleoperation import (
    RELEASED,
    GripperToggle,
    JoySettings,
    JoystickCommand,
    joystick_command,
)
from smach_oracle.oracle.errors import SettingsError

GIVEN = {
    'axes': {'x': [1, 0.2], 'y': [0, -0.2], 'yaw': [3, 0.5]},
    'buttons': {'dead_man': 5, 'open': 1, 'close': 0},
    'frame': 'base_footprint',
}
LAUNCH = Path(__file__).resolve().parents[4] / 'launch'
HELD = [0, 0, 0, 0, 0, 1]


def test_axes_move_only_while_the_dead_man_button_is_held():
    settings = JoySettings.from_dict(GIVEN)
    assert joystick_command(settings, [1.0, 0.5, 0.0, -1.0], HELD) == JoystickCommand(
        True, (0.1, -0.2, 0.0), (0.0, 0.0, -0.5), None
    )
    assert joystick_command(settings, [1.0, 0.5, 0.0, -1.0], [1, 1, 1, 1, 1, 0]) == RELEASED
    assert joystick_command(settings, [1.0, 0.5, 0.0, -1.0], [1]) == RELEASED, (
        'a joystick without that button'
    )


def test_a_stick_at_rest_or_beyond_its_range():
    settings = JoySettings.from_dict(GIVEN)
    assert joystick_command(settings, [0.04, -0.05, 0, 0], HELD).linear == (0.0, 0.0, 0.0)
    assert joystick_command(settings, [0, 350.0, 0, 0], HELD).linear == (0.2, 0.0, 0.0)
    assert joystick_command(settings, [], HELD) == JoystickCommand(
        True, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), None
    )


@pytest.mark.parametrize('value', [math.nan, math.inf])
def test_what_is_not_finite_stops(value):
    assert joystick_command(JoySettings.from_dict(GIVEN), [value, 1.0, 0, 0], HELD) == RELEASED


def test_the_gripper():
    settings = JoySettings.from_dict(dict(GIVEN, gripper_open=0.07))
    assert joystick_command(settings, [], [1, 0, 0, 0, 0, 1]).gripper == 0.0
    assert joystick_command(settings, [], [0, 1, 0, 0, 0, 1]).gripper == 0.07
    assert joystick_command(settings, [], [1, 1, 0, 0, 0, 1]).gripper is None


def test_one_button_closes_and_opens_the_gripper_by_turns_while_the_dead_man_is_held():
    settings = JoySettings.from_dict(
        dict(GIVEN, buttons={'dead_man': 0, 'toggle': 1}, gripper_open=0.07)
    )
    toggle = GripperToggle(settings)
    presses = [[1, 0], [1, 1], [1, 1], [1, 0], [1, 1], [1, 0], [0, 1], [0, 0], [1, 1]]
    assert [
        toggle.applied(joystick_command(settings, [], buttons), buttons).gripper
        for buttons in presses
    ] == [None, 0.0, 0.0, None, 0.07, None, None, None, 0.0]


@pytest.mark.parametrize(
    'messages, gripper',
    [
        # a moment without the dead-man, with the button down throughout
        ([([], [1, 1]), ([], [0, 1]), ([], [1, 1])], [0.0, None, 0.0]),
        (
            [([], [1, 1]), ([], [0, 1]), ([], [1, 1]), ([], [1, 0]), ([], [1, 1])],
            [0.0, None, 0.0, None, 0.07],
        ),
        # a moment with an axis that is no number
        ([([0.0], [1, 1]), ([math.nan], [1, 1]), ([0.0], [1, 1])], [0.0, None, 0.0]),
        # pressed before the dead-man
        ([([], [0, 1]), ([], [1, 1]), ([], [1, 1])], [None, None, None]),
        (
            [([], [1, 1]), ([], [1, 0]), ([], [0, 1]), ([], [1, 1]), ([], [1, 0]), ([], [1, 1])],
            [0.0, None, None, None, None, 0.07],
        ),
        # let go without the dead-man: the next press is a new one
        ([([], [1, 1]), ([], [0, 1]), ([], [0, 0]), ([], [1, 1])], [0.0, None, None, 0.07]),
    ],
)
def test_the_gripper_turns_round_only_at_a_press_that_begins_with_the_dead_man_held(
    messages, gripper
):
    settings = JoySettings.from_dict(
        dict(GIVEN, axes={'x': [0, 0.2]}, buttons={'dead_man': 0, 'toggle': 1}, gripper_open=0.07)
    )
    toggle = GripperToggle(settings)
    assert [
        toggle.applied(joystick_command(settings, axes, buttons), buttons).gripper
        for axes, buttons in messages
    ] == gripper


@pytest.mark.parametrize(
    'key, changes',
    [
        ('~axes', {'axes': {}}),
        ('~axes/up', {'axes': {'up': [0, 1]}}),
        ('~axes/x', {'axes': {'x': 0}}),
        ('~axes/x', {'axes': {'x': [-1, 0.1]}}),
        ('~axes/x', {'axes': {'x': [0, 50.0]}}),
        ('~buttons', {'buttons': {}}),
        ('~buttons/dead_man', {'buttons': {'dead_man': -1}}),
        ('~buttons/open', {'buttons': {'dead_man': 0, 'open': 'A'}}),
        ('~dead_zone', {'dead_zone': 1.0}),
        ('~rate_hz', {'rate_hz': 10}),
        ('~silent_s', {'silent_s': True}),
        ('~buttons/closed', {'buttons': {'dead_man': 0, 'closed': 1}}),
        ('~buttons/toggle', {'buttons': {'dead_man': 0, 'toggle': -2}}),
        ('~frame', {'frame': None}),
        ('~frame', {'frame': ''}),
        ('~arm', {'arm': 1}),
        ('~operator', {'operator': ''}),
    ],
)
def test_settings_that_are_refused_are_named(key, changes):
    with pytest.raises(SettingsError) as error:
        JoySettings.from_dict(dict(GIVEN, **changes))
    assert error.value.key == key


@pytest.mark.parametrize('axis', range(6))
def test_the_settings_that_come_along_are_a_spacenav_s(axis):
    """spacenav_node: x forward, y left, z up, then the turns about these; two buttons."""
    settings = JoySettings.from_dict(
        yaml.safe_load((LAUNCH / 'joy_teleoperation.yaml').read_text())
    )
    # the others are never quite still
    pushed = [1.0 if index == axis else 0.03 for index in range(6)]
    wish = joystick_command(settings, pushed, [1, 0])
    assert wish.held and wish.gripper is None
    assert [value > 0 for value in wish.linear + wish.angular] == [
        index == axis for index in range(6)
    ]
    assert all(
        value == 0.0 for index, value in enumerate(wish.linear + wish.angular) if index != axis
    )
    assert (
        joystick_command(settings, pushed, [0, 0]) == RELEASED
        and joystick_command(settings, pushed, [0, 1]) == RELEASED
    )
    toggle = GripperToggle(settings)
    assert {toggle.applied(wish, buttons).gripper for buttons in ([1, 1], [1, 0], [1, 1])} == {
        0.0,
        None,
        settings.gripper_open,
    }, 'its second button'


@pytest.mark.parametrize('file', ['joy_teleoperation.yaml', 'manipulation_interface.yaml'])
def test_what_counts_as_open_is_the_same_with_and_without_the_settings_that_come_along(file):
    assert yaml.safe_load((LAUNCH / file).read_text())['gripper_open'] == GRIPPER_OPEN
    assert JoySettings.from_dict(GIVEN).gripper_open == GRIPPER_OPEN
