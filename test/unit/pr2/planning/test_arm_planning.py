"""Collision checks, ways and their timing, for the right arm of the PR2."""

from types import SimpleNamespace

import numpy as np
import pybullet
import pytest
from arms import REST, box, clutter, deepest, model, right_arm

from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.pr2.planning import collision
from smach_oracle.pr2.planning.arm import READY, Arm, SkillContext, SkillError
from smach_oracle.pr2.planning.collision import CollisionWorld, model_from
from smach_oracle.pr2.planning.collision_body import BodyPool
from smach_oracle.pr2.planning.planner import ACCELERATION, PlanningError, plan, straight, timed
from smach_oracle.pr2.robot import ARM_JOINTS
from smach_oracle.pr2.skills.arms_aside import ASIDE

# stands in the way from the robot's side to its front
WALL = box(0.62, -0.45, 1.05, 0.2, 0.02, 0.3)


def in_front(space: CollisionWorld, seed: int) -> np.ndarray:
    """Joint positions free of collision, the hand over the table."""
    generator = np.random.default_rng(seed)
    for _ in range(60):
        pose = from_rpy(
            (generator.uniform(0.5, 0.7), generator.uniform(-0.3, 0.1), 0.85),
            yaw=generator.uniform(-0.8, 0.8),
        )
        q = space.chain.inverse(pose, READY['right'], generator)
        if q is not None and space.is_free(q):
            return q
    raise AssertionError('no posture over the table')


def test_ways_are_free_of_collision_by_another_check():
    for seed in (1, 2, 3):
        boxes = dict(clutter(seed), wall=WALL)
        with right_arm(boxes) as space:
            way = plan(space, ASIDE['right'], in_front(space, seed), seed)
            assert np.allclose(way[0], ASIDE['right'])
            points, _ = timed(space.chain, way)
        assert deepest(np.vstack([way[:1], points]), boxes) < 0.004


def test_the_other_check_would_see_a_way_that_is_not():
    boxes = dict(clutter(1), wall=WALL)
    with right_arm(boxes) as space:
        goal = in_front(space, 1)
        through = np.array([ASIDE['right'], goal])
        assert deepest(through[:1], boxes) < 0.004 and deepest(through[1:], boxes) < 0.004
        # both ends are free, the straight way between them is not
        assert deepest(through, boxes) > 0.02


def test_a_way_around_something_repeats_exactly_and_depends_on_its_seed():
    boxes = dict(clutter(2), wall=WALL)
    ways = []
    for seed in (5, 5, 6):
        with right_arm(boxes) as space:
            ways.append(plan(space, ASIDE['right'], in_front(space, 2), seed))
            assert len(ways[-1]) > 2  # around it
    assert np.array_equal(ways[0], ways[1])
    assert not np.array_equal(ways[0], ways[2])


def test_the_budget_is_kept_and_named():
    with right_arm(dict(clutter(2), wall=WALL)) as space:
        goal = in_front(space, 2)
        before = space.checks
        with pytest.raises(
            PlanningError, match='no way around the obstacles was found within 40 collision checks'
        ):
            plan(space, ASIDE['right'], goal, 1, budget=40)
        assert space.checks - before < 400


def test_a_goal_in_collision_says_what_touches_what():
    with right_arm(clutter(1)) as space:
        goal = space.chain.inverse(
            from_rpy((0.7, 0.0, 0.70)), READY['right'], np.random.default_rng(1)
        )
        with pytest.raises(
            PlanningError, match='the goal is in collision: .*r_gripper.* touches table'
        ):
            plan(space, ASIDE['right'], goal, 1)


def test_an_arm_that_touches_something_steps_out_of_it():
    with right_arm({}) as space:
        start = in_front(space, 3)
        tip = space.chain.forward(start)[:3, 3]
    with right_arm({'thing': box(*tip, 0.05, 0.05, 0.05)}) as space:
        assert not space.is_free(start)
        way = plan(space, start, ASIDE['right'], 1)
        assert np.array_equal(way[0], start) and space.is_free(way[1])
        assert np.abs(way[1] - start).max() < 1.0


def test_a_straight_way_keeps_the_tool_on_its_line_and_heading():
    with right_arm({}) as space:
        start = space.chain.inverse(
            from_rpy((0.5, -0.2, 0.9)), READY['right'], np.random.default_rng(1)
        )
        way = straight(space, start, from_rpy((0.65, -0.2, 0.9)))
        tools = [space.chain.forward(q) for q in way]
        assert max(np.abs(tool[1:3, 3] - [-0.2, 0.9]).max() for tool in tools) < 0.003
        assert max(np.abs(tool[:3, :3] - np.eye(3)).max() for tool in tools) < 0.01
        assert abs(tools[-1][0, 3] - 0.65) < 0.002
        assert straight(space, start, from_rpy((1.6, -0.2, 0.9))) is None
        space.add_box('thing', box(0.62, -0.2, 0.9, 0.03, 0.03, 0.03))
        assert straight(space, start, from_rpy((0.65, -0.2, 0.9))) is None
        with space.touchable(['thing']):
            assert straight(space, start, from_rpy((0.65, -0.2, 0.9))) is not None


def test_timing_keeps_the_limits_of_speed_and_acceleration():
    with right_arm(dict(clutter(1), wall=WALL)) as space:
        way = plan(space, ASIDE['right'], in_front(space, 1), 1)
        points, times = timed(space.chain, way, speed=0.4)
    steps = np.diff(np.vstack([way[:1], points]), axis=0)
    durations = np.diff(np.concatenate([[0.0], times]))
    speeds = steps / durations[:, None]
    assert np.all(durations > 0)
    assert np.allclose(points[-1], way[-1])
    assert np.all(np.abs(speeds).max(axis=0) <= 0.4 * space.chain.velocity + 1e-6)
    changes = np.abs(np.diff(speeds, axis=0)) / ((durations[1:] + durations[:-1]) / 2)[:, None]
    assert np.median(changes.max(axis=1)) < 2 * ACCELERATION
    assert np.abs(speeds[[0, -1]]).max() < 0.6


def test_what_the_hand_holds_is_part_of_it():
    with right_arm({}) as space:
        q = space.chain.inverse(
            from_rpy((0.6, -0.2, 0.9)), READY['right'], np.random.default_rng(1)
        )
        space.add_box('below', box(0.6, -0.2, 0.70, 0.05, 0.05, 0.02))
        assert space.is_free(q)
        space.attach((0.03, 0.03, 0.19), np.eye(4))
        assert space.why_not(q) == 'the held object touches below'
        with space.touchable(['below']):
            assert space.is_free(q)
        space.detach()
        assert space.is_free(q)


def test_distance_is_that_to_the_nearest_thing():
    with right_arm({}) as space:
        q = space.chain.inverse(
            from_rpy((0.6, -0.2, 0.9)), READY['right'], np.random.default_rng(1)
        )
        assert space.distance(q, reach=0.02) == 0.02
        tip = space.chain.forward(q)[:3, 3]
        space.add_box('ahead', box(tip[0] + 0.1, tip[1], tip[2], 0.04, 0.3, 0.3))
        ahead = space.distance(q)
        space.add_box('ahead', box(tip[0] + 0.12, tip[1], tip[2], 0.04, 0.3, 0.3))
        assert space.distance(q) - ahead == pytest.approx(0.02, abs=0.002)


def test_the_other_arm_is_in_the_way():
    crossed = dict(
        REST, l_shoulder_pan_joint=0.0, l_upper_arm_roll_joint=0.0, l_elbow_flex_joint=-0.3
    )
    with CollisionWorld(model(), 'right', crossed) as space:
        q = space.chain.inverse(
            from_rpy((0.6, 0.12, 0.95), yaw=0.8), READY['right'], np.random.default_rng(2)
        )
        touched = space.why_not(q) if q is not None else ''
    with CollisionWorld(model(), 'right', REST) as space:
        assert q is not None and space.is_free(q)
    assert 'l_' in touched


def test_an_unknown_arm_and_a_broken_description_are_named():
    with pytest.raises(ValueError, match="'middle'; allowed: left, right"):
        CollisionWorld(model(), 'middle', {})
    with pytest.raises(ValueError, match='robot_description_semantic'):
        model_from(model().urdf, '<robot')


def clients():
    """The numbers of the physics clients that are open."""
    return [number for number in range(50) if pybullet.isConnected(number)]


def test_what_cannot_be_built_leaves_no_physics_client_behind(monkeypatch):
    monkeypatch.setattr(collision, '_POOL', BodyPool())
    robot = SimpleNamespace(joints=lambda: REST)
    with right_arm({}):
        pass
    before = clients()  # that of the robot that waits to be lent again among them
    with pytest.raises(ValueError):
        Arm(
            SkillContext(robot, model()),
            'right',
            {'bad': box(0.5, 0.0, 0.5)._replace(half=['wide'])},
            1,
        )
    with right_arm({}) as space:
        assert clients() == before and space.names() == []

    def broken(*_, **__):
        raise pybullet.error('Cannot load URDF file.')

    monkeypatch.setattr(pybullet, 'loadURDF', broken)
    with pytest.raises(SkillError, match='robot description: Cannot load'):
        Arm(SkillContext(robot, model()), 'left', {}, 1)
    assert clients() == before


def test_an_arm_whose_encoder_reads_beyond_a_stop_is_sent_within_its_limits():
    """Encoders err; a controller takes no position beyond a joint's limits."""
    flex = ARM_JOINTS['right'].index('r_wrist_flex_joint')
    beyond = np.array(ASIDE['right'])
    sent = []
    robot = SimpleNamespace(
        joints=lambda: dict(REST, **dict(zip(ARM_JOINTS['right'], beyond))),
        follow=lambda joints, positions, times: sent.append(positions),
        spend=lambda what, work: None,
    )
    with Arm(SkillContext(robot, model()), 'right', {}, 1) as arm:
        goal = np.array(ASIDE['right']) + [0.5, 0, 0, 0, 0, 0, 0]
        goal[flex] = arm.chain.lower[flex]
        beyond[flex] = goal[flex] - 0.003
        arm.follow(np.array([arm.now(), goal]))
        assert len(sent[0]) > 2
        assert (sent[0] >= arm.chain.lower).all() and (sent[0] <= arm.chain.upper).all()
        assert np.allclose(sent[0][-1], goal)
