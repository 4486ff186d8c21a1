"""What planning and perception cost in the world's time, and how it is charged."""

from types import SimpleNamespace

import numpy as np
import pytest
import rospy

from smach_oracle.pr2 import ros_time
from smach_oracle.pr2.nodes.perception_node import pass_time_service
from smach_oracle.pr2.planning.arm import Arm, SkillContext
from smach_oracle.pr2.planning.collision import installed_model
from smach_oracle.pr2.ros_time import WorldTime
from smach_oracle.pr2.work_costs import CHECK_S, IMAGE_S, SAMPLE_S, Work
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot


class Service:
    """A service that notes its calls, and fails so many times."""

    def __init__(self):
        self.calls, self.failures, self.closed = [], 0, 0

    def __call__(self, *call):
        if self.failures:
            self.failures -= 1
            raise rospy.ServiceException('gone')
        self.calls.append(call)

    def close(self):
        self.closed += 1


@pytest.fixture
def service(monkeypatch):
    made = Service()
    monkeypatch.setattr(rospy, 'resolve_name', lambda name: '/' + name)
    monkeypatch.setattr(rospy, 'get_name', lambda: '/node')
    monkeypatch.setattr(rospy, 'ServiceProxy', lambda name, kind, persistent: made)
    monkeypatch.setattr(
        ros_time.rosgraph,
        'Master',
        lambda caller: SimpleNamespace(lookupService=lambda name: 'rosrpc://here'),
    )
    return made


def test_the_time_is_charged_where_there_is_some(service):
    time = WorldTime('world/pass_time')
    time.spend(1.5, 'planning')
    time.spend(0.0, 'planning')
    assert service.calls == [(1.5, 'planning')]


def test_a_world_that_was_started_again_is_charged_all_the_same(service):
    time = WorldTime('world/pass_time')
    time.spend(1.0, 'planning')
    service.failures = 1
    time.spend(2.0, 'planning')
    assert service.calls == [(1.0, 'planning'), (2.0, 'planning')] and service.closed == 1


def test_a_robot_without_the_service_is_charged_nothing(service, monkeypatch):
    WorldTime('').spend(1.0, 'planning')

    def unknown(name):
        raise ros_time.rosgraph.MasterError('unknown service')

    monkeypatch.setattr(
        ros_time.rosgraph, 'Master', lambda caller: SimpleNamespace(lookupService=unknown)
    )
    WorldTime('world/pass_time').spend(1.0, 'planning')
    assert not service.calls


@pytest.mark.parametrize(
    'given, service_name',
    [
        ({}, 'world/pass_time'),
        ({'~snapshot': 'none'}, 'none'),
        ({'~pass_time': 'none'}, 'none'),
        ({'~pass_time': '/other/pass_time'}, '/other/pass_time'),
    ],
)
def test_a_robot_without_snapshots_has_no_service_for_time_either(monkeypatch, given, service_name):
    monkeypatch.setattr(rospy, 'get_param', lambda name, default: given.get(name, default))
    assert pass_time_service() == service_name


def test_planning_takes_the_time_of_its_checks_and_samples_before_the_arm_moves():
    world = World()
    try:
        robot, spent = DirectRobot(world), []
        robot.spend = lambda what, work: spent.append((what, work))
        with Arm(SkillContext(robot, installed_model()), 'right', {}, 1) as arm:
            pose = arm.pose()
            pose[0, 3] -= 0.05
            goal = arm.reach(pose)[0]
            path = arm.path(goal)
            checks = arm.space.checks
            assert not spent and checks > 0
            arm.follow(path)
            assert spent == [('planning', Work(checks=checks, samples=13))]
            arm.space.is_free(goal)
        assert spent[1:] == [('planning', Work(checks=1))]
    finally:
        world.close()


def test_work_takes_the_worlds_time():
    world = World()
    try:
        robot, before = DirectRobot(world), world.time
        robot.spend('planning', Work(checks=1000, samples=100))
        assert world.time - before == pytest.approx(1000 * CHECK_S + 100 * SAMPLE_S, abs=1 / 60)
        before = world.time
        robot.see()
        assert world.time - before == pytest.approx(1 / 30 + IMAGE_S, abs=1 / 60)
        assert np.isfinite(world.time)
    finally:
        world.close()
