"""Velocities of a tool to velocities of joints: the direction holds, no limit is ever passed,
nothing explodes.
"""

import numpy as np
import pytest

from smach_oracle.geometry.chain import JointChain
from smach_oracle.interfaces.manipulation.cartesian_drive import (
    CartesianDrive,
    Clearance,
    DriveLimits,
    pulled_back,
)

PERIOD = 0.02
READY = np.array([-0.4, 0.3, -1.2, -1.4, 0.3, -0.8, 0.2])
# (axis, kind, lower, upper, length of the link before it): the joints of an arm such as the PR2's
ARM = (
    ('z', 'revolute', -2.2, 0.6, 0.0),
    ('y', 'revolute', -0.4, 1.3, 0.1),
    ('x', 'revolute', -3.8, 0.7, 0.0),
    ('y', 'revolute', -2.2, -0.1, 0.4),
    ('x', 'continuous', 0, 0, 0.0),
    ('y', 'revolute', -2.0, -0.1, 0.32),
    ('x', 'continuous', 0, 0, 0.0),
)


def urdf():
    axes = {'x': '1 0 0', 'y': '0 1 0', 'z': '0 0 1'}
    joints = ''.join(
        '<link name="l{n}"/><joint name="j{n}" type="{kind}"><parent link="{parent}"/><child '
        'link="l{n}"/>'
        '<origin xyz="{x} 0 0"/><axis xyz="{axis}"/>'
        '<limit lower="{low}" upper="{high}" velocity="3" effort="1"/></joint>'.format(
            n=n,
            kind=kind,
            parent='l{}'.format(n - 1) if n else 'base',
            x=length,
            axis=axes[axis],
            low=low,
            high=high,
        )
        for n, (axis, kind, low, high, length) in enumerate(ARM)
    )
    return (
        '<robot name="arm"><link name="base"/>{}<link name="tool"/><joint name="tip" type="fixed">'
        '<parent link="l6"/><child link="tool"/><origin xyz="0.18 0 0"/></joint></robot>'.format(
            joints
        )
    )


@pytest.fixture(scope='module')
def arm():
    return JointChain.from_urdf(urdf(), 'base', 'tool')


def run(drive, joints, twist, steps):
    taken = [drive.step(joints, twist, PERIOD)]
    for _ in range(steps - 1):
        taken.append(drive.step(taken[-1].joints, twist, PERIOD))
    return taken


def along(vector, twist):
    return vector @ twist / (np.linalg.norm(vector) * np.linalg.norm(twist))


@pytest.mark.parametrize('axis', range(6))
@pytest.mark.parametrize('sign', (1, -1))
def test_a_held_command_moves_the_tool_as_far_as_it_says_and_nowhere_else(arm, axis, sign):
    twist = np.zeros(6)
    twist[axis] = 0.1 * sign
    begin = arm.forward(READY)
    step = run(CartesianDrive(arm), READY, twist, 25)[-1]
    end = arm.forward(step.joints)
    assert step.limit == '' and step.speed == pytest.approx(1.0, abs=1e-6)
    assert end[:3, 3] - begin[:3, 3] == pytest.approx(twist[:3] * 0.5, abs=1e-3)
    turned = end[:3, :3] @ begin[:3, :3].T
    angles = (
        np.array(
            [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        )
        / 2
    )
    assert angles == pytest.approx(twist[3:] * 0.5, abs=2e-3)


def test_a_command_that_is_too_fast_is_slowed_and_keeps_its_direction(arm):
    twist = np.array([2.0, -1.0, 1.5, 0.0, 0.0, 0.0])
    step = CartesianDrive(arm).step(READY, twist, PERIOD)
    assert np.linalg.norm(step.twist[:3]) <= 0.25 + 1e-9
    assert along(step.twist, twist) == pytest.approx(1.0, abs=1e-9)
    assert (
        step.speed == pytest.approx(0.25 / np.linalg.norm(twist), rel=1e-6)
        and 'speed' in step.limit
    )


def test_joints_that_would_be_too_fast_slow_the_whole_hand(arm):
    slow = DriveLimits(joint_share=0.02)
    twist = np.array([0.1, 0.1, 0.0, 0.0, 0.3, 0.0])
    step = CartesianDrive(arm, slow).step(READY, twist, PERIOD)
    assert np.abs(step.velocities).max() == pytest.approx(0.06, abs=1e-9)
    assert along(step.twist, twist) == pytest.approx(1.0, abs=1e-9) and step.limit.startswith(
        'speed limit of j'
    )


def test_no_joint_passes_its_limits_whatever_is_commanded(arm):
    generator = np.random.default_rng(3)
    drive = CartesianDrive(arm)
    for _ in range(40):
        twist = generator.normal(size=6) * [0.3, 0.3, 0.3, 1.0, 1.0, 1.0]
        for step in run(drive, READY, twist, 60):
            assert np.abs(step.joints - arm.clip(step.joints)).max() < 1e-6
            assert np.isfinite(step.joints).all() and np.abs(step.velocities).max() <= 1.5 + 1e-9


def test_a_joint_at_its_limit_is_named_and_spares_the_rest_of_the_way(arm):
    drive = CartesianDrive(arm)
    steps = run(drive, READY, np.array([0.0, 0.0, -0.2, 0.0, 0.0, 0.0]), 400)
    assert 'joint limit' in steps[-1].limit
    assert np.abs(steps[-1].velocities).max() == 0.0 and steps[-1].speed == 0.0
    back = drive.step(steps[-1].joints, np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.0]), PERIOD)
    assert back.twist[2] > 0.05, 'and there is a way back'


def test_near_a_singularity_joint_speeds_stay_bounded_where_plain_least_squares_explode(arm):
    stretched = np.array([0.0, 0.3, -1.2, -0.13, 0.0, -0.8, 0.0])
    values, worst = (
        np.linalg.svd(arm.jacobian(stretched))[1],
        np.linalg.svd(arm.jacobian(stretched))[0][:, -1],
    )
    assert values[-1] < 0.03
    twist = worst * 0.1
    plain = np.linalg.pinv(arm.jacobian(stretched)) @ twist
    for sign in (1, -1):
        damped = CartesianDrive(arm, DriveLimits(joint_share=1e3)).step(
            stretched, sign * twist, PERIOD
        )
        assert np.linalg.norm(damped.velocities) < 0.4 * np.linalg.norm(plain)
        assert damped.limit == 'singular posture' and damped.speed < 0.5


def test_far_from_a_singularity_nothing_is_damped(arm):
    twist = np.array([0.05, 0.02, -0.03, 0.1, -0.1, 0.05])
    assert CartesianDrive(arm).step(READY, twist, PERIOD).twist == pytest.approx(twist, abs=1e-9)


def test_the_tool_stays_in_its_workspace(arm):
    edge = arm.forward(READY)[0, 3] + 0.03
    drive = CartesianDrive(arm, DriveLimits(workspace=((-2.0, -2.0, -2.0), (edge, 2.0, 2.0))))
    steps = run(drive, READY, np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]), 50)
    assert arm.forward(steps[-1].joints)[0, 3] == pytest.approx(edge, abs=1e-3)
    assert steps[-1].limit == 'end of the workspace in x'
    assert drive.step(
        steps[-1].joints, np.array([-0.1, 0, 0, 0, 0, 0]), PERIOD
    ).speed == pytest.approx(1.0)


def wall(arm, x, touchable):
    return lambda joints: [Clearance(x - arm.forward(joints)[0, 3], 'hand and wall', touchable)]


@pytest.mark.parametrize('touchable, comes_to', [(False, 0.01), (True, 0.0)])
def test_it_slows_before_what_is_near_and_stops_before_what_must_not_be_touched(
    arm, touchable, comes_to
):
    surface = arm.forward(READY)[0, 3] + 0.1
    drive = CartesianDrive(arm, near=wall(arm, surface, touchable))
    steps = run(drive, READY, np.array([0.2, 0.0, 0.05, 0.0, 0.0, 0.0]), 150 if touchable else 400)
    speeds = [step.twist[0] for step in steps]
    assert all(later <= earlier + 1e-9 for earlier, later in zip(speeds, speeds[1:]))
    assert all(along(step.twist, np.array([0.2, 0, 0.05, 0, 0, 0])) > 0.99 for step in steps[:60])
    gap = surface - arm.forward(steps[-1].joints)[0, 3]
    assert gap < 0.0 if touchable else gap == pytest.approx(comes_to, abs=3e-3)
    assert steps[-1].limit == 'near: hand and wall'


def test_it_leaves_what_is_near_at_full_speed(arm):
    surface = arm.forward(READY)[0, 3] + 0.005
    step = CartesianDrive(arm, near=wall(arm, surface, False)).step(
        READY, np.array([-0.2, 0, 0, 0, 0, 0]), PERIOD
    )
    assert step.speed == pytest.approx(1.0) and step.clearance == pytest.approx(0.005)


def test_no_command_no_motion(arm):
    step = CartesianDrive(arm).step(READY, np.zeros(6), PERIOD)
    assert (step.joints == READY).all() and not step.velocities.any()


@pytest.mark.parametrize(
    'joints, twist, period, says',
    [
        (READY, [np.nan, 0, 0, 0, 0, 0], PERIOD, 'twist'),
        (READY, [0, 0, np.inf, 0, 0, 0], PERIOD, 'twist'),
        (READY, [0, 0, 0], PERIOD, 'twist'),
        (READY * np.nan, np.zeros(6), PERIOD, 'joints'),
        (READY[:3], np.zeros(6), PERIOD, 'joints'),
        (READY, np.zeros(6), 0.0, 'period'),
        (READY, np.zeros(6), np.nan, 'period'),
    ],
)
def test_what_is_not_finite_or_has_the_wrong_shape_is_refused(arm, joints, twist, period, says):
    with pytest.raises(ValueError, match=says):
        CartesianDrive(arm).step(joints, twist, period)


def test_targets_do_not_run_away_from_an_arm_that_is_blocked():
    assert pulled_back(np.array([1.0, -0.5]), np.zeros(2), 0.1) == pytest.approx([0.1, -0.05])
    near = np.array([0.1, -0.05])
    assert pulled_back(near, np.zeros(2), 0.1) == pytest.approx(near)


@pytest.mark.parametrize('axis', range(3))
@pytest.mark.parametrize('way', [-1.0, 1.0])
def test_targets_stay_on_course_while_the_arm_stands(arm, axis, way):
    """A blocked arm that comes free, or a robot that was late, goes where it was sent."""
    twist = way * 0.25 * np.eye(6)[axis]
    drive, targets = CartesianDrive(arm), READY
    for _ in range(50):
        targets = drive.step(pulled_back(targets, READY, 0.12), twist, PERIOD).joints
    for at in (targets, pulled_back(targets, READY, 0.05)):
        gone = (arm.forward(at) - arm.forward(READY))[:3, 3]
        assert way * gone[axis] > 0.97 * np.linalg.norm(gone)


def test_a_hand_that_may_turn_freely_keeps_its_place_while_the_arm_comes_to_its_ease(arm):
    ease = np.array([-0.76, 0.2, -1.57, -1.6, 0.8, -1.0, 0.3])
    drive = CartesianDrive(arm, posture=ease)
    begin = arm.forward(READY)[:3, 3]
    joints = READY
    for _ in range(400):
        joints = drive.step(joints, np.zeros(6), PERIOD, turn_freely=True).joints
        assert np.linalg.norm(arm.forward(joints)[:3, 3] - begin) < 0.01
    assert np.linalg.norm(joints - ease) < 0.7 * np.linalg.norm(READY - ease)
    moved = run_freely(drive, READY, np.array([0.1, 0.0, 0.0, 5.0, 5.0, 5.0]), 25)
    assert arm.forward(moved)[:3, 3] - begin == pytest.approx([0.05, 0.0, 0.0], abs=4e-3)


def run_freely(drive, joints, twist, steps):
    for _ in range(steps):
        joints = drive.step(joints, twist, PERIOD, turn_freely=True).joints
    return joints
