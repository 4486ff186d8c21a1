"""Driving through the console: what is said is checked, what is late stops the hand, one page has
the wheel.
"""

import json

import console_case
import pytest
import tornado.testing
import tornado.websocket

from smach_oracle.expert.console.answering.driving_control import (
    LATE_S,
    SILENT_S,
    DelayCheck,
    DrivingControl,
    DrivingSession,
    along,
)
from smach_oracle.expert.console.commands.commands import CommandError, parse
from smach_oracle.expert.console.web.audit import Person

DRIVE = {
    'do': 'drive',
    'question': 'q',
    'held': True,
    'frame': 'tool',
    'linear': [1, 0, -0.5],
    'angular': [0, 0, 0],
    'gripper': '',
    'sent': 12.5,
    'arm': 'right',
}


def text(**fields):
    return json.dumps(dict({'id': 1}, **fields))


def test_a_driving_command_is_taken_apart():
    info = parse(text(**DRIVE)).arguments
    assert (info['held'], info['linear'], info['sent'], info['arm']) == (
        True,
        (1.0, 0.0, -0.5),
        12.5,
        'right',
    )


@pytest.mark.parametrize(
    'wrong',
    [
        {'held': 1},
        {'held': 'true'},
        {'held': None},
        {'frame': 'map'},
        {'frame': 'base_footprint'},
        {'frame': ['tool']},
        {'linear': [2, 0, 0]},
        {'linear': [0, 0]},
        {'linear': [0, 0, 0, 0]},
        {'linear': [True, 0, 0]},
        {'linear': ['1', 0, 0]},
        {'linear': {'x': 1}},
        {'linear': None},
        {'angular': [0, 0, -1.01]},
        {'gripper': 0.05},
        {'gripper': 'crush'},
        {'sent': -1},
        {'sent': '0'},
        {'sent': 1e13},
        {'arm': 3},
        {'arm': 'x' * 101},
        {'operator': 'bob'},
        {'topic': '/cmd_vel'},
        {'gripper_effort': 500},
    ],
)
def test_anything_else_is_refused(wrong):
    with pytest.raises(CommandError):
        parse(text(**dict(DRIVE, **wrong)))


@pytest.mark.parametrize('number', ['NaN', 'Infinity', '1e999', '-1e999'])
def test_no_speed_without_end(number):
    with pytest.raises(CommandError):
        parse(text(**DRIVE).replace('-0.5', number))


def test_what_a_slow_link_has_held_back_is_not_fresh():
    check = DelayCheck()
    # a stall of a second, and what comes after it in a burst
    delays = [0.005, 0.02, 0.004, 0.05, 1.0, 0.9, 0.1, 0.03]
    shown = [
        check.is_in_time(5000.0 + 0.03 * at, 20.0 + 0.03 * at + delay)
        for at, delay in enumerate(delays)
    ]
    assert shown == [True, True, True, True, False, False, False, True]


def test_clocks_that_run_apart_do_no_harm():
    check = DelayCheck()
    assert all(check.is_in_time(0.03 * at * 1.0003, 7.0 + 0.03 * at) for at in range(20000))
    check = DelayCheck()
    assert all(check.is_in_time(0.03 * at, 7.0 + 0.03 * at * 1.0003) for at in range(20000))
    assert not check.is_in_time(600.0, 7.0 + 600.18 + LATE_S + 0.05)


def drive(page, name='ann'):
    return DrivingSession('q', page, Person('127.0.0.1', 's', 'teleoperator', name), None, 0.0)


def test_one_page_at_a_time_has_the_wheel_until_it_leaves_or_falls_silent():
    control = DrivingControl()
    assert control.take(drive(1), 0.0) == ''
    assert control.take(drive(2, 'bob'), 1.0) == 'ann drives; one at a time'
    assert control.accept(0.0, True, 1.5)
    assert control.take(drive(2, 'bob'), 1.5 + SILENT_S + 0.1) == ''
    assert control.leave(6.0) == {'relayed': 0, 'late': 0, 'seconds': 6.0}
    assert control.take(drive(1), 6.0) == ''


def test_a_late_command_is_counted_and_not_held():
    control = DrivingControl()
    control.take(drive(1), 0.0)
    assert control.accept(10.0, True, 1.0) and control.held
    assert not control.accept(10.02, True, 1.3) and not control.held
    assert control.leave(2.0) == {'relayed': 1, 'late': 1, 'seconds': 2.0}


def test_a_camera_s_axes_are_right_down_forward():
    assert along('camera', (1.0, 0.0, 0.0), 0.5) == (0.0, 0.0, 0.5)
    assert along('camera', (0.0, 1.0, 1.0), 0.5) == (-0.5, -0.5, 0.0)
    assert along('tool', (1.0, 0.5, -1.0), 0.5) == (0.5, 0.25, -0.5)


class TestDriving(console_case.ConsoleCase):
    @tornado.testing.gen_test
    async def test_it_needs_the_role_and_the_wheel(self):
        page = await self.open_page(*await self.signed('operator'))
        for command in (DRIVE, {'do': 'take_wheel', 'question': 'q'}):
            reply = await self.say(page, 2, **command)
            assert (reply['ok'], reply['message']) == (
                False,
                'operators may not {} (sign in as teleoperator)'.format(
                    command['do'].replace('_', ' ')
                ),
            )
        page = await self.open_page(*await self.signed('teleoperator'))
        assert (await self.say(page, 2, **DRIVE))['message'] == 'Take the wheel first.'
        assert self.teleoperation.relayed == []
        assert [
            record[:2] for record in self.audit.records if record[0] in ('drive', 'take_wheel')
        ] == [('drive', False), ('take_wheel', False)]

    @tornado.testing.gen_test
    async def test_thirty_commands_a_second_pass_and_a_flood_ends_the_connection(self):
        page = await self.open_page(*await self.signed('teleoperator'))
        assert (await self.say(page, 2, do='take_wheel', question='q'))['data']
        for number in range(60):  # more than other commands may be
            await page.write_message(json.dumps(dict(DRIVE, id=10 + number)))
        assert (await self.say(page, 3, do='watch', trial=''))['ok']
        assert len(self.teleoperation.relayed) == 60
        for number in range(1000):
            try:
                await page.write_message(json.dumps(dict(DRIVE, id=100 + number)))
            except tornado.websocket.WebSocketClosedError:
                break
        while await page.read_message() is not None:
            pass
        assert len(self.teleoperation.relayed) < 300
        # a page that is gone drives nothing
        await self.until(lambda: not self.teleoperation.drivers)

    @tornado.testing.gen_test
    async def test_a_page_that_has_not_said_hello_drives_nothing(self):
        socket = await self.connect((await self.signed('teleoperator'))[0])
        assert (await self.say(socket, 2, **DRIVE))['message'] == 'say hello first'
        assert self.teleoperation.relayed == []
