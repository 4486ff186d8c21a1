"""Whose battery and whose diagnostics, and what is shown of them."""

import math

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import BatteryState

from smach_oracle.expert.console.robots import robot_health
from smach_oracle.expert.console.robots.robot_health import RobotHealth
from smach_oracle.expert.console.web.sections import PageSections


class Known:
    """What is known of robots after some messages."""

    def __init__(self, *robots):
        self.robots, self.health, self.sections = robots, RobotHealth(), PageSections()

    def say(self, *statuses, topic='/diagnostics'):
        parts = [
            DiagnosticStatus(level=level, name=name, message=text) for level, name, text in statuses
        ]
        self.health.on_diagnostics(topic, DiagnosticArray(status=parts))

    def charge(self, topic, **fields):
        self.health.on_battery(topic, BatteryState(**fields))

    def shown(self, robot):
        self.health.write_sections(self.sections, self.robots)
        return self.sections.get('health').get(robot)

    def problems(self, robot):
        found = self.shown(robot)
        return [(each['part'], each['level']) for each in found['problems']] if found else []


@pytest.mark.parametrize(
    'robots, topic, owner',
    [
        (['/a', '/b'], '/a/battery', '/a'),
        (['/a', '/ab'], '/ab/battery', '/ab'),
        (['/one/task', '/two/task'], '/two/base/battery', '/two/task'),
        (['/a'], '/battery', '/a'),
        (['/a', '/b'], '/battery', None),
        (['/one/task', '/one/other'], '/one/battery', None),
    ],
)
def test_a_battery_is_the_robot_s_below_whose_name_or_namespace_it_lies(robots, topic, owner):
    known = Known(*robots)
    known.charge(topic, percentage=0.5)
    assert [robot for robot in robots if known.shown(robot)] == ([owner] if owner else [])


@pytest.mark.parametrize(
    'fields, share, volts, low',
    [
        (dict(percentage=0.81, voltage=25.13), 0.81, 25.1, False),
        (dict(percentage=0.12, voltage=math.nan), 0.12, None, True),
        (dict(percentage=math.nan, voltage=24.0), None, 24.0, False),
        (dict(voltage=25.2), None, 25.2, False),
        (dict(percentage=81.0), None, 0.0, False),
        (dict(percentage=0.0), 0.0, 0.0, True),
    ],
)
def test_what_a_battery_does_not_measure_is_not_shown(fields, share, volts, low):
    known = Known('/a')
    known.charge('/battery', **fields)
    battery = known.shown('/a')['battery']
    assert (battery['share'], battery['volts'], battery['low']) == (share, volts, low)


def test_of_diagnostics_the_worst_of_a_robot_come_first():
    known = Known('/a', '/b')
    known.say(
        (1, 'a: laser', 'slow'), (2, 'a: motor', 'hot'), (3, 'a: camera', ''), (0, 'a: x', '')
    )
    known.say((2, 'b/arm', 'stuck'), (2, 'abc: arm', 'whose?'), (2, 'motor', 'whose?'))
    assert known.problems('/a') == [
        ('a: motor', 'error'),
        ('a: camera', 'stale'),
        ('a: laser', 'warn'),
    ]
    assert known.problems('/b') == [('b/arm', 'error')]
    known.say((0, 'a: motor', 'cool'))
    assert known.problems('/a')[0] == ('a: camera', 'stale'), 'it is well again'


def test_diagnostics_in_a_robot_s_namespace_are_its_own():
    known = Known('/one/task', '/two/task')
    known.say((2, 'motor', 'hot'), topic='/two/diagnostics')
    assert (known.problems('/one/task'), known.problems('/two/task')) == ([], [('motor', 'error')])


def test_what_the_page_shows_of_a_question_anyway_is_left_out():
    known = Known('/a')
    known.say((1, 'a: oracle questions', '1 open question'), (1, 'a: oracle states', 'x'))
    known.say((2, 'a: oracle recorder', 'the disk does not take the events'))
    assert known.problems('/a') == [('a: oracle recorder', 'error')]


def test_what_is_not_heard_any_more_is_old_and_then_forgotten(monkeypatch):
    known = Known('/a')
    known.charge('/battery', percentage=0.5)
    known.say((2, 'motor', 'hot'))
    assert known.shown('/a')['battery']['old'] is False
    now_s = robot_health.time.monotonic()
    monkeypatch.setattr(robot_health.time, 'monotonic', lambda: now_s + robot_health.OLD_S)
    assert known.shown('/a')['battery']['old'] is True
    monkeypatch.setattr(robot_health.time, 'monotonic', lambda: now_s + robot_health.FORGOTTEN_S)
    assert known.shown('/a') is None


def test_hostile_diagnostics_are_bounded(monkeypatch):
    monkeypatch.setattr(robot_health, 'MOST_STATUSES', 10)
    known = Known('/a')
    known.say(*[(2, 'part {} '.format(number) + 'x' * 1000, 'y' * 1000) for number in range(50)])
    problems = known.shown('/a')['problems']
    assert len(problems) == robot_health.MOST_SHOWN and len(known.health._statuses) == 10
    assert all(len(each['part']) <= 200 and len(each['message']) <= 200 for each in problems)
