"""Serial chains: positions, Jacobians, limits and inverse kinematics, on an arm with the PR2's
proportions.
"""

import time

import numpy as np
import pytest

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import from_rpy, rotation_vector

LINKS = [
    ('lift', 'prismatic', '0 0 0.7', '0 0 0', '0 0 1', 0.0, 0.3),
    ('pan', 'revolute', '0 -0.19 0.1', '0 0 0', '0 0 1', -2.28, 0.71),
    ('shoulder', 'revolute', '0.1 0 0', '0 0 0', '0 1 0', -0.52, 1.39),
    ('roll', 'revolute', '0 0 0', '0 0 0', '1 0 0', -3.9, 0.8),
    ('elbow', 'revolute', '0.4 0 0', '0 0 0', '0 1 0', -2.32, 0.0),
    ('forearm', 'continuous', '0 0 0', '0 0 0', '1 0 0', 0.0, -1.0),
    ('wrist', 'revolute', '0.321 0 0', '0.1 0.2 -0.1', '0 1 0', -2.09, 0.0),
    ('hand', 'continuous', '0 0 0', '0 0 0', '1 0 0', 0.0, -1.0),
    ('tool', 'fixed', '0.18 0 0', '0 0 0', '1 0 0', 0.0, 0.0),
]
SEED = np.array([-0.4, 0.3, -1.2, -1.4, 0.0, -0.8, 0.0])


def arm_urdf() -> str:
    """A robot with one arm."""
    text, parent = ['<robot name="arm"><link name="base"/>'], 'base'
    for name, kind, xyz, rpy, axis, lower, upper in LINKS:
        text.append(
            '<link name="{0}_link"/><joint name="{0}" type="{1}"><parent link="{2}"/><child '
            'link="{0}_link"/>'
            '<origin xyz="{3}" rpy="{4}"/><axis xyz="{5}"/><limit lower="{6}" upper="{7}" '
            'velocity="2"/>'
            '</joint>'.format(name, kind, parent, xyz, rpy, axis, lower, upper)
        )
        parent = name + '_link'
    return ''.join(text) + '</robot>'


@pytest.fixture(name='arm')
def _arm() -> JointChain:
    return JointChain.from_urdf(arm_urdf(), 'base', 'tool_link', fixed={'lift': 0.2})


def test_forward_of_a_straight_arm_adds_up_its_links():
    arm = JointChain.from_urdf(arm_urdf(), 'base', 'wrist_link', fixed={'lift': 0.2})
    expected = from_rpy((0.1 + 0.4 + 0.321, -0.19, 0.7 + 0.2 + 0.1), 0.1, 0.2, -0.1)
    assert arm.names == ['pan', 'shoulder', 'roll', 'elbow', 'forearm', 'wrist']
    assert np.allclose(arm.forward(np.zeros(6)), expected)


def test_forward_turns_about_the_axes():
    arm = JointChain.from_urdf(arm_urdf(), 'base', 'forearm_link')
    tip = arm.forward([0.1, np.pi / 2, 0.0, 0.0, 0.0, 0.0])
    assert np.allclose(tip[:3, 3], [0.0, -0.19 + 0.5, 0.9])
    bent = arm.forward([0.0, 0.0, np.pi / 2, 0.0, 0.0, 0.0])
    assert np.allclose(bent[:3, 3], [0.1, -0.19, 0.8 - 0.4])


def test_jacobian_is_the_derivative_also_of_a_lift():
    arm = JointChain.from_urdf(arm_urdf(), 'base', 'tool_link')
    q = np.concatenate([[0.1], SEED + 0.3])
    step = 1e-6
    jacobian, here = arm.jacobian(q), arm.forward(q)
    for k in range(8):
        there = arm.forward(q + step * np.eye(8)[k])
        assert np.allclose((there[:3, 3] - here[:3, 3]) / step, jacobian[:3, k], atol=1e-5)
        assert np.allclose(
            rotation_vector(there @ np.linalg.inv(here)) / step, jacobian[3:, k], atol=1e-5
        )


def test_inverse_reaches_what_can_be_reached_fast_and_within_limits(arm):
    generator = np.random.default_rng(3)
    poses = [arm.forward(q) for q in arm.random(generator, 200)]
    begin = time.process_time()
    solved = [arm.inverse(pose, SEED, generator) for pose in poses]
    per_pose = (time.process_time() - begin) / len(poses)
    reached = [q for q in solved if q is not None]
    assert len(reached) >= 0.97 * len(poses)
    assert per_pose < 0.02
    assert all(np.abs(q - arm.clip(q)).max() < 1e-6 for q in reached)
    for pose, q in zip(poses, solved):
        if q is not None:
            error = np.linalg.inv(arm.forward(q)) @ pose
            assert np.linalg.norm(error[:3, 3]) < 1e-3
            assert np.linalg.norm(rotation_vector(error)) < 5e-3


def test_inverse_repeats_with_the_same_generator(arm):
    pose = arm.forward(arm.random(np.random.default_rng(8), 1)[0])
    first = arm.inverse(pose, SEED, np.random.default_rng(5))
    assert np.array_equal(first, arm.inverse(pose, SEED, np.random.default_rng(5)))


def test_inverse_is_not_content_with_the_tool_half_a_turn_off(arm):
    for axis in ('roll', 'pitch', 'yaw'):
        goal = arm.forward(SEED) @ from_rpy((0.0, 0.0, 0.0), **{axis: np.pi})
        found = arm.inverse(goal, SEED, np.random.default_rng(1), restarts=40)
        if axis == 'roll' or found is not None:  # the last joint alone can roll it
            assert np.linalg.norm(rotation_vector(arm.forward(found) @ np.linalg.inv(goal))) < 0.006


def test_inverse_gives_none_out_of_reach(arm):
    assert arm.inverse(from_rpy((3.0, 0.0, 1.0)), SEED, np.random.default_rng(1)) is None


def test_solutions_are_all_right_and_the_nearest_comes_first(arm):
    pose = arm.forward(SEED + 0.1)
    found = arm.solutions(pose, SEED, np.random.default_rng(2), restarts=30)
    away = np.abs(found - SEED).max(axis=1)
    assert len(found) > 1 and np.all(np.diff(away) >= 0)
    assert all(np.linalg.norm(arm.forward(q)[:3, 3] - pose[:3, 3]) < 1e-3 for q in found)


def test_inverses_of_many_poses_are_those_of_each_alone(arm):
    generator = np.random.default_rng(5)
    near = [arm.forward(arm.clip(SEED + generator.normal(0.0, 0.2, 7))) for _ in range(6)]
    poses = np.array([*near, from_rpy((3.0, 0.0, 1.0))])
    found = arm.inverses(poses, SEED, iterations=15)
    alone = [arm.inverse(pose, SEED, iterations=15) for pose in poses]
    assert alone[-1] is None and any(each is not None for each in alone)
    for one, each in zip(found, alone):
        assert np.isnan(one).all() if each is None else np.allclose(one, each, atol=1e-9)


def test_continuous_joints_stay_within_half_a_turn_of_the_seed(arm):
    seed = SEED + np.array([0, 0, 0, 0, 4 * np.pi, 0, -2 * np.pi])
    solved = arm.inverse(arm.forward(SEED + 0.1), seed, np.random.default_rng(2))
    assert np.all(np.abs(solved - seed)[[4, 6]] <= np.pi)


@pytest.mark.parametrize(
    'root, tip, fixed, text',
    [
        ('base', 'nowhere', {}, "no link 'nowhere'"),
        ('tool_link', 'base', {}, "'base' does not hang below 'tool_link'"),
        ('base', 'tool_link', {'knee': 0.0}, 'no joint knee'),
        ('hand_link', 'tool_link', {}, 'no joint moves'),
    ],
)
def test_chain_that_is_not_there_is_named(root, tip, fixed, text):
    with pytest.raises(ValueError, match=text):
        JointChain.from_urdf(arm_urdf(), root, tip, fixed)


@pytest.mark.parametrize('text', ['', '<robot>', '<robot/>', '<robot><joint name="a"/></robot>'])
def test_text_that_is_no_urdf_is_refused(text):
    with pytest.raises(ValueError, match='robot description'):
        JointChain.from_urdf(text, 'base', 'tool_link')


def test_poses_that_are_not_finite_are_refused(arm):
    with pytest.raises(ValueError, match='not finite'):
        arm.inverse(np.full((4, 4), np.nan), SEED)
