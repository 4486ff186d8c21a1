"""What the world node tells: transforms as the physics has them, streams of targets, what an expert
sees, the truth.
"""

import json

import numpy as np
import pytest
from rospy import Time
from std_msgs.msg import Header

from smach_oracle.analysis.truth import read_truth
from smach_oracle.geometry.transform_tree import TransformTree
from smach_oracle.geometry.transforms import from_quaternion, from_rpy, inverse
from smach_oracle.pr2.kitchen import Kitchen
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.robot import ARM_JOINTS, BASE_FRAME, CAMERA_FRAME, TOOL_FRAME
from smach_oracle.simulation.node.camera_publisher import camera_info
from smach_oracle.simulation.node.reveal import reveal
from smach_oracle.simulation.node.state_publisher import odometry, transforms
from smach_oracle.simulation.node.streamed_target import StreamedTarget
from smach_oracle.simulation.node.truth import TrialTruth
from smach_oracle.simulation.node.truth_file import append_line
from smach_oracle.simulation.physics.camera import INTRINSICS
from smach_oracle.simulation.physics.cause_log import CauseSpan
from smach_oracle.simulation.physics.harm import DROPPED, Harm
from smach_oracle.simulation.physics.judge import TrialVerdict
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT, fridge_urdf
from smach_oracle.simulation.scenes.scene import Body, Goal, RobotStart, Scene, SceneCause

TABLE = Body('table', 'box', (0.6, 1.2, 0.04), (0.9, 0.0, 0.70))
CAN = Body('can', 'cylinder', (0.03, 0.03, 0.12), (0.8, 0.0, 0.781), mass=0.3)
WALL = Body('wall', 'box', (0.02, 0.2, 0.09), (0.72, 0.0, 0.766))
FRIDGE = Body(
    'fridge',
    'urdf',
    (0.0, 0.0, 0.0),
    (3.0, 3.0, 0.0),
    urdf=fridge_urdf(Kitchen()),
    joints=((DOOR_JOINT, 0.5),),
    joint_friction=((DOOR_JOINT, 3.0),),
)
HEAD = RobotStart(
    (('head_tilt_joint', 0.6), ('torso_lift_joint', 0.2), ('r_elbow_flex_joint', -1.2))
)


def scene(*bodies):
    return Scene(
        'test', 7, bodies, Goal('stands_at', ''), HEAD, causes=(SceneCause('crowded', 'by much'),)
    )


@pytest.fixture(scope='module')
def world():
    one = World(scene(TABLE, CAN, FRIDGE))
    yield one
    one.close()


def test_the_transforms_take_every_link_to_where_the_physics_has_it(world):
    tree = TransformTree(pr2_urdf().read_text(encoding='utf-8'), list(world.joints()))
    message = transforms(tree, world.joints(), world.odom_from_base(), Time(1))
    links = {
        each.child_frame_id: (each.header.frame_id, each.transform) for each in message.transforms
    }
    assert sorted(set(world.joints())) == sorted(tree.names)

    def base_from(link):
        if link == BASE_FRAME:
            return np.eye(4)
        if link in links:
            parent, found = links[link]
            place, turn = found.translation, found.rotation
            return base_from(parent) @ from_quaternion(
                (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)
            )
        fixed = next(each for each in tree.fixed if each.child == link)
        return base_from(fixed.parent) @ from_quaternion(fixed.position, fixed.turn)

    for link in (
        *TOOL_FRAME.values(),
        CAMERA_FRAME,
        'base_link',
        'l_gripper_l_finger_tip_link',
        'laser_tilt_link',
    ):
        assert np.allclose(
            base_from(link), inverse(world.true_base()) @ world.link_pose(link), atol=2e-4
        ), link


def test_odometry_tells_where_the_robot_believes_to_stand_and_how_it_moves_in_its_own_axes():
    driving = World(
        Scene('test', 7, (), Goal('stands_at', ''), RobotStart((), (0.5, -0.2, np.pi / 2)))
    )
    driving.belief_error = from_rpy((0.1, 0.0, 0.0))
    for _ in range(30):  # forward, which is along y of the world, and turning
        y, turn = (
            driving.robot.target('base_y') + 0.3 / 60,
            driving.robot.target('base_theta') + 0.1 / 60,
        )
        driving.robot.set_target('base_y', y, 0.3, None)
        driving.robot.set_target('base_theta', turn, 0.1, None)
        driving.step()
    said = odometry(driving.odom_from_base(), driving.robot.base_velocity(), Time(3))
    assert (said.header.frame_id, said.child_frame_id) == ('odom_combined', BASE_FRAME)
    place, true = said.pose.pose.position, driving.true_base()[:3, 3]
    assert np.hypot(place.x - true[0], place.y - true[1]) == pytest.approx(0.1, abs=1e-6)
    moves = said.twist.twist
    # a little to the right
    assert (moves.linear.x, moves.linear.y) == pytest.approx((0.3, -0.015), abs=0.005)
    assert moves.angular.z == pytest.approx(0.1, abs=0.02)
    assert len(said.pose.covariance) == len(said.twist.covariance) == 36
    driving.close()


def test_camera_info_is_that_of_the_camera():
    info = camera_info(INTRINSICS, (480, 640, 3), Header(frame_id=CAMERA_FRAME))
    assert (info.width, info.height, len(info.D), len(info.R)) == (640, 480, 5, 9)
    assert (
        info.K == INTRINSICS.ravel().tolist() and info.P[2] == info.K[2] and info.P[5] == info.K[4]
    )


def test_a_target_of_a_stream_is_reached_at_the_end_of_its_period_and_what_is_too_fast_is_cut_off(
    world,
):
    name = ARM_JOINTS['right'][0]
    start = world.robot.position(name)
    for target, periods in ((start + 0.02, 3), (start + 0.04, 3)):
        motion, begun = StreamedTarget({name: target}, periods / 60), world.periods
        while motion.tick(world) is None:
            world.step()
        assert world.periods - begun == periods
        assert world.robot.target(name) == pytest.approx(target)
    motion = StreamedTarget({name: start - 1.0}, 1 / 60)
    assert motion.tick(world) is None
    assert abs(world.robot.target(name) - target) <= 1.11 * world.robot.speeds[name] / 60


def test_an_expert_sees_where_things_are_and_what_the_camera_has_of_them(world):
    can = reveal(world, ['can'], Time(1))[0]
    assert (can.size.x, can.size.z, can.movable, can.held) == (0.06, 0.12, True, '')
    assert can.pose.header.frame_id == BASE_FRAME
    assert can.pose.pose.position.x == pytest.approx(0.8, abs=0.01)
    assert 20 < can.region.width < 80 and can.region.height > can.region.width
    assert can.visible > 0.8


def test_of_what_stands_behind_another_thing_less_is_seen(world):
    hidden = World(scene(TABLE, CAN, WALL))
    try:
        free, behind = (reveal(one, ['can'], Time(1))[0] for one in (world, hidden))
    finally:
        hidden.close()
    assert 0.1 < behind.visible < 0.8 * free.visible
    assert behind.region.height < free.region.height


def test_a_refrigerator_has_a_door_and_a_handle(world):
    fridge, door, handle = reveal(world, ['fridge', 'door', 'handle'], Time(1))
    assert door.angle == handle.angle == pytest.approx(0.5, abs=0.02)
    assert handle.size.z > 0.2 > handle.size.x and not fridge.movable
    off = np.hypot(
        handle.pose.pose.position.x - door.pose.pose.position.x,
        handle.pose.pose.position.y - door.pose.pose.position.y,
    )
    assert 0.1 < off < 0.5


def test_what_is_not_there_is_named(world):
    with pytest.raises(ValueError, match="no body 'cup' in this scene; there: table, can"):
        reveal(world, ['cup'], Time(1))


def test_the_truth_is_a_line_for_each_trial(tmp_path):
    path = tmp_path / 'truth.jsonl'
    for seconds in (12.0, 14.0):
        append_line(
            str(path),
            TrialTruth(scene(), 10.0).record(
                TrialVerdict(False, 'wrong', 'cup'),
                (Harm(DROPPED, 'can'),),
                seconds,
                {'physics': 0.5},
                {'physics': 0.25},
            ),
        )
    lines = [json.loads(line) for line in path.read_text(encoding='utf-8').splitlines()]
    assert [line['sim_s'] for line in lines] == [2.0, 4.0]
    assert lines[0]['causes'] == [
        {'kind': 'crowded', 'text': 'by much', 'lasting': False, 'began_s': None, 'ended_s': None}
    ]
    assert {key: lines[0][key] for key in ('seed', 'task', 'success', 'why')} == {
        'seed': 7,
        'task': 'test',
        'success': False,
        'why': 'wrong',
    }
    truth = read_truth(str(path))[7]
    assert truth.wrong_object == 'cup' and truth.damage == ((DROPPED, 'can'),)
    assert lines[0]['share']['physics'] > 0 and lines[0]['cpu_s'] == {'physics': 0.25}


def test_the_truth_adds_up_the_time_that_was_let_pass():
    truth = TrialTruth(scene(), 0.0)
    for seconds, what in ((2.0, 'planning'), (5.0, 'expert'), (0.5, 'planning')):
        truth.passed(seconds, what)
    record = truth.record(TrialVerdict(True, ''), (), 9.0, {}, {})
    assert record['passed_s'] == {'planning': 2.5, 'expert': 5.0}


def test_work_that_moves_the_robot_is_charged_from_its_begin_to_its_end_and_no_time_twice():
    truth = TrialTruth(scene(), 100.0)
    truth.charge('expert', True, 104.0)
    truth.passed(5.0, 'expert')
    truth.passed(0.5, 'planning')
    truth.charge('expert', True, 110.0)
    truth.charge('expert', False, 134.0)
    truth.charge('expert', False, 140.0)
    truth.passed(2.0, 'expert')
    truth.charge('expert', True, 150.0)
    record = truth.record(TrialVerdict(True, ''), (), 153.0, {}, {})
    assert record['passed_s'] == {'planning': 0.5, 'expert': 30.0 + 2.0 + 3.0}


def test_the_truth_tells_when_a_cause_was_there():
    truth = TrialTruth(scene(), 0.0)
    truth.happened([CauseSpan('crowded', 'by much', True, 0.0, 7.5)])
    assert truth.record(TrialVerdict(True, ''), (), 9.0, {}, {})['causes'] == [
        {'kind': 'crowded', 'text': 'by much', 'lasting': True, 'began_s': 0.0, 'ended_s': 7.5}
    ]
