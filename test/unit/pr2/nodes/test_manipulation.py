"""Pick, place and arms aside on the simulated PR2, held against the physical truth; and goals that
cannot be.
"""

import math

import numpy as np
import pytest
from forked import in_own_fork
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from std_msgs.msg import Header
from worlds import CAN, CARTON, TABLE, scene

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import yaw_of
from smach_oracle.msg import (
    BuildCollisionMapGoal,
    MoveArmsAsideGoal,
    PickGoal,
    PlaceGoal,
    PointHeadGoal,
)
from smach_oracle.pr2.nodes.manipulation import Manipulation, elsewhere_of
from smach_oracle.pr2.planning.arm import SkillContext, SkillError
from smach_oracle.pr2.planning.collision import installed_model
from smach_oracle.pr2.planning.grasps import grasps, others_first
from smach_oracle.pr2.robot import ARM_JOINTS, RobotError
from smach_oracle.pr2.skills.arms_aside import ASIDE, is_aside
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.scene import RobotStart

BASE = 'base_footprint'
CAN_SIZE = Vector3(0.062, 0.062, 0.12)


def say(status):
    """Nobody listens."""


def pose(x, y, z, frame=BASE, w=1.0):
    return PoseStamped(Header(frame_id=frame), Pose(Point(x, y, z), Quaternion(0.0, 0.0, 0.0, w)))


def picking(arm, target, size, map_id):
    return PickGoal(arm=arm, object=target, size=size, map_id=map_id)


def placing(arm, place, grasp, map_id, tolerance=0.0):
    return PlaceGoal(arm=arm, pose=place, grasp=grasp, map_id=map_id, tolerance=tolerance)


class Bench:
    """A world and the skills in it, with a map of what stands on the table."""

    def __init__(self, *bodies, **more):
        self.world = World(scene(*bodies, **more), binning=2)
        self.robot = DirectRobot(self.world)
        self.skills = Manipulation(SkillContext(self.robot, installed_model()))

    def map(self):
        goal = BuildCollisionMapGoal(
            pose(0.85, 0.0, 0.72),
            [pose(*CAN.position), pose(*CARTON.position)],
            [CAN_SIZE, Vector3(*CARTON.size)],
        )
        goal.table.pose.orientation = Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
        return self.skills.build_collision_map(goal, say)

    def pick(self, map_id, arm='right'):
        return self.skills.pick(picking(arm, pose(*CAN.position), CAN_SIZE, map_id), say).grasp


@pytest.fixture(name='bench', scope='module')
def _bench():
    bench = Bench()
    yield bench
    bench.world.close()


@pytest.fixture(name='held', scope='module')
def _held():
    """A bench where the right hand holds the can, with the map and the grasp."""
    bench = Bench()
    bench.made = bench.map()
    bench.grasp = bench.pick(bench.made.map_id)
    yield bench
    bench.world.close()


@in_own_fork
def test_a_grasp_survives_a_shake_and_the_object_then_stands_where_it_was_to_be(held):
    assert held.made.boxes == 3
    assert held.world.body_pose('can')[2, 3] > CAN.position[2] + 0.08
    shake(held)
    assert held.world.holding('can') == 'right'
    held.robot.look_at((0.6, -0.2, 0.8))
    held.skills.place(placing('right', pose(0.6, -0.35, 0.79), held.grasp, held.made.map_id), say)
    there = held.world.body_pose('can')
    assert np.hypot(there[0, 3] - 0.6, there[1, 3] + 0.35) < 0.03
    assert there[2, 2] > 0.99 and abs(there[2, 3] - 0.78) < 0.01
    assert np.hypot(*(held.world.body_pose('carton')[:2, 3] - CARTON.position[:2])) < 0.01
    assert is_aside(held.robot.joints(), 'right')


@in_own_fork
def test_a_place_goal_that_is_sent_again_succeeds_where_its_object_is_seen_and_only_there(held):
    goal = placing('right', pose(0.6, -0.35, 0.79), held.grasp, held.made.map_id)
    held.robot.look_at((0.6, -0.2, 0.8))
    held.skills.place(goal, say)
    before = held.world.body_pose('can')
    held.skills.place(goal, say)
    held.robot.gripper('right', 0.03)  # stopped as it closed
    held.skills.place(goal, say)
    assert np.allclose(held.world.body_pose('can'), before, atol=1e-3)
    goal.pose = pose(*CARTON.position)  # where the map has another thing
    with pytest.raises(SkillError, match='the right hand holds nothing'):
        held.skills.place(goal, say)
    goal.pose = pose(0.6, -0.15, 0.79)
    with pytest.raises(SkillError, match='the right hand holds nothing'):
        held.skills.place(goal, say)


@in_own_fork
def test_what_cannot_be_put_down_there_stays_in_the_hand_and_the_reason_is_told(held):
    for place, text in (
        (pose(2.5, 0.0, 0.79), 'there is nothing to stand on at x 2.50.* beyond its edge'),
        (pose(1.1, 0.55, 0.79), 'no way to put the object down at x 1.10.*out of reach'),
        (pose(*CARTON.position), 'no free spot within 2 cm of x 0.75.*: object 1 stands there'),
    ):
        with pytest.raises(SkillError, match=text):
            held.skills.place(placing('right', place, held.grasp, held.made.map_id), say)
        assert held.world.holding('can') == 'right'
    assert np.hypot(*(held.world.body_pose('carton')[:2, 3] - CARTON.position[:2])) < 0.01


@in_own_fork
def test_arms_that_go_aside_put_back_first_what_a_hand_still_holds(held):
    assert held.world.holding('can') == 'right'
    held.skills.move_arms_aside(MoveArmsAsideGoal(), say)
    assert is_aside(held.robot.joints(), 'right') and not held.world.holding('can')
    assert held.world.body_pose('can')[:3, 3] == pytest.approx(CAN.position, abs=0.01)
    assert not held.world.harm.found(held.world)


def test_what_has_come_to_stand_at_the_place_is_seen_and_a_spot_beside_it_taken():
    """The map was made before that, and the place is 4.5 cm wide. The arm does not hide it."""
    box = CARTON._replace(name='late', size=(0.05, 0.05, 0.1), position=(0.515, 0.1, 0.77))
    bench = Bench(TABLE, CAN, CARTON, box)
    made = bench.map()
    grasp = bench.pick(made.map_id)
    bench.skills.place(placing('right', pose(0.58, 0.1, 0.79), grasp, made.map_id, 0.045), say)
    there = bench.world.body_pose('can')[:2, 3]
    assert 0.01 < np.hypot(there[0] - 0.58, there[1] - 0.1) < 0.06
    assert np.hypot(*(bench.world.body_pose('late')[:2, 3] - box.position[:2])) < 0.005
    with pytest.raises(SkillError, match='tolerance is 7'):
        bench.skills.place(placing('right', pose(0.58, 0.1, 0.79), grasp, made.map_id, 7.0), say)
    bench.world.close()


def test_a_thing_of_another_width_is_let_go_where_it_stands():
    bench = Bench(TABLE, CARTON, CAN._replace(size=(0.012, 0.012, 0.12)))
    with pytest.raises(SkillError, match='closed on something 2.[0-9] cm wide'):
        bench.pick(bench.map().map_id)
    assert bench.world.holding('can') == ''
    bench.world.close()


def test_the_third_try_takes_another_kind_of_grasp():
    can = UprightBox(np.array(CAN.position), np.array([0.062, 0.062, 0.12]), 0.0)
    found = grasps(can, 'right')
    later = others_first(found, elsewhere_of(2))
    assert others_first(found, elsewhere_of(1)) == found and len(later) == len(found)
    assert abs(later[0][2, 0] - found[0][2, 0]) > 0.2, 'the hand is inclined otherwise'


def shake(bench):
    """Turn the wrist and the shoulder to and fro, four times a second."""
    names = ARM_JOINTS['right']
    here = np.array([bench.robot.joints()[name] for name in names])
    moves = [here + np.array([0.04, 0, 0, 0, 0.15, 0, 0.3]) * (-1) ** k for k in range(8)] + [here]
    bench.robot.follow(names, np.array(moves), 0.25 * np.arange(1, len(moves) + 1))


def test_the_other_arm_is_moved_out_of_the_view():
    front = dict(zip(ARM_JOINTS['left'], (0.3, 0.0, 1.2, -1.4, 0.0, -0.8, 0.0)))
    bench = Bench(robot=RobotStart(tuple(front.items())))
    assert not is_aside(bench.robot.joints(), 'left')
    bench.skills.move_arms_aside(MoveArmsAsideGoal(), say)
    left = np.array([bench.robot.joints()[name] for name in ARM_JOINTS['left']])
    assert np.abs(left - ASIDE['left']).max() < 0.03
    bench.world.close()


@in_own_fork
def test_an_arm_that_is_held_is_noticed(bench, monkeypatch):
    bench.robot.follow(
        ARM_JOINTS['left'], np.array([[0.3, 0.0, 1.2, -1.4, 0.0, -0.8, 0.0]]), np.array([2.0])
    )
    monkeypatch.setattr(DirectRobot, 'follow', lambda *_: None)
    with pytest.raises(SkillError, match='the left arm is not at the side'):
        bench.skills.move_arms_aside(MoveArmsAsideGoal(['left']), say)


@in_own_fork
def test_nothing_in_the_hand_is_felt(bench):
    made = bench.map()
    goal = picking('right', pose(0.62, -0.35, 0.78), CAN_SIZE, made.map_id)
    bench.robot.look_at((2.0, 1.5, 1.2))  # where the place is not in view
    with pytest.raises(SkillError, match='closed on nothing, 2 times'):
        bench.skills.pick(goal, say)
    assert is_aside(bench.robot.joints(), 'right')
    with pytest.raises(SkillError, match='the right hand holds nothing'):
        bench.skills.place(
            placing('right', pose(0.6, -0.35, 0.79), pose(0.6, 0, 0.8), made.map_id), say
        )


@in_own_fork
def test_what_somebody_has_taken_away_is_not_reached_for(bench):
    made = bench.map()
    bench.robot.look_at((0.65, 0.0, 0.75))
    before = bench.robot.joints()
    with pytest.raises(SkillError, match='no longer where it was seen'):
        bench.skills.pick(picking('right', pose(0.62, -0.20, 0.78), CAN_SIZE, made.map_id), say)
    after = bench.robot.joints()
    assert all(abs(after[name] - before[name]) < 0.01 for name in ARM_JOINTS['right'])


@in_own_fork
def test_a_place_may_be_given_some_centimetres_higher_than_the_object_will_stand(held):
    held.robot.look_at((0.6, -0.2, 0.8))
    with pytest.raises(SkillError, match='nothing to stand on at x 0.60.*z 1.05'):
        held.skills.place(
            placing('right', pose(0.6, -0.35, 1.05), held.grasp, held.made.map_id), say
        )
    held.skills.place(placing('right', pose(0.6, -0.35, 0.91), held.grasp, held.made.map_id), say)
    assert abs(held.world.body_pose('can')[2, 3] - 0.78) < 0.01


def test_what_slipped_is_gripped_firmer_until_the_arms_go_aside_again():
    bench = Bench(TABLE, CAN._replace(friction=0.05, mass=0.69), CARTON)
    made = bench.map()
    with pytest.raises(SkillError, match='slipped out'):
        bench.pick(made.map_id)
    bench.world.reset(bench.world.scene)  # where it had fallen to is another question
    grasp = bench.pick(made.map_id)
    assert bench.world.holding('can') == 'right'
    bench.robot.look_at((0.6, -0.2, 0.8))
    bench.skills.place(placing('right', pose(0.6, -0.35, 0.79), grasp, made.map_id), say)
    assert np.hypot(*(bench.world.body_pose('can')[:2, 3] - (0.6, -0.35))) < 0.03
    bench.skills.move_arms_aside(MoveArmsAsideGoal(), say)
    bench.world.reset(bench.world.scene)
    with pytest.raises(SkillError, match='slipped out'):
        bench.pick(made.map_id)
    bench.world.close()


@in_own_fork
def test_what_a_hand_held_in_another_trial_does_not_count(held):
    held.world.reset(scene(TABLE, CAN._replace(position=(0.72, -0.1, 0.78)), CARTON))
    made, before = held.map(), held.world.periods
    with pytest.raises(SkillError, match='too wide for the gripper'):
        held.skills.pick(
            picking('right', pose(*CAN.position), Vector3(0.2, 0.2, 0.1), made.map_id), say
        )
    fresh = held.world.periods - before
    held.skills.hands.forget('right')
    held.world.reset(held.world.scene)
    before = held.world.periods
    with pytest.raises(SkillError, match='too wide for the gripper'):
        held.skills.pick(
            picking('right', pose(*CAN.position), Vector3(0.2, 0.2, 0.1), made.map_id), say
        )
    assert held.world.periods - before == fresh  # as in a process that has run no trial before


@pytest.mark.parametrize('gap', [0.09, 0.075])
@in_own_fork
def test_a_hand_that_has_opened_holds_nothing(held, gap):
    assert held.skills.hands.find('right') is not None
    held.skills.context.robot.gripper('left', 0.0)
    held.skills.context.robot.gripper('right', 0.0, 40.0)  # feels it
    assert held.skills.hands.find('right') is not None
    held.skills.context.robot.gripper('right', gap)
    assert held.skills.hands.find('right') is None


@in_own_fork
def test_a_hand_that_was_emptied_by_somebody_else_holds_nothing_at_the_next_goal(held):
    held.robot.gripper('right', 0.09)
    held.robot.gripper('right', 0.0)
    held.skills.move_arms_aside(MoveArmsAsideGoal(), say)
    assert held.skills.hands.find('right') is None


@in_own_fork
def test_without_a_map_pick_makes_its_own_of_what_the_camera_sees(bench):
    bench.robot.look_at((0.7, -0.1, 0.75))
    bench.pick('')
    assert bench.world.holding('can') == 'right'


@in_own_fork
def test_a_head_that_is_told_looks_there(bench):
    bench.skills.point_head(
        PointHeadGoal(PointStamped(Header(frame_id='base_link'), Point(0.7, -0.2, 0.7))), say
    )
    camera = bench.robot.see().base_from_camera
    way = np.array([0.7, -0.2, 0.751]) - camera[:3, 3]
    assert np.dot(way / np.linalg.norm(way), camera[:3, 2]) > 0.999


BAD = [
    ('an unknown arm', "unknown arm 'third'; allowed: left, right", dict(arm='third')),
    ('NaN', 'object: .*not finite', dict(object=pose(math.nan, 0.0, 0.8))),
    (
        'a quaternion of no length',
        'object: quaternion .* is no rotation',
        dict(object=pose(0.6, 0.0, 0.8, w=0.0)),
    ),
    (
        'a quaternion beyond measure',
        'object: .*no rotation',
        dict(object=pose(0.6, 0.0, 0.8, w=1e200)),
    ),
    (
        'a wrong frame',
        "object: frame 'moon'; allowed: base_footprint, base_link, odom_combined",
        dict(object=pose(0.6, 0.0, 0.8, frame='moon')),
    ),
    ('an unknown map', "no collision map 'x'", dict(map_id='x')),
    ('no size', 'object: its size is .*each must be above 0', dict(size=Vector3(0.05, 0.0, 0.1))),
    ('a huge size', 'object: its size is .*at most 1', dict(size=Vector3(0.05, 3.0, 0.1))),
    (
        'out of reach',
        'none of .* grasps can be done: .*out of reach',
        dict(object=pose(2.5, 0.0, 0.8)),
    ),
    ('too wide', 'too wide for the gripper from every side', dict(size=Vector3(0.2, 0.2, 0.1))),
]


@pytest.fixture(name='still', scope='module')
def _still():
    bench = Bench(TABLE, CAN, CARTON)
    bench.map_id = bench.map().map_id
    yield bench
    bench.world.close()


@pytest.mark.parametrize(
    'text, change', [(text, change) for _, text, change in BAD], ids=[name for name, _, _ in BAD]
)
def test_goals_that_cannot_be_are_refused_and_say_why(still, text, change):
    goal = picking('right', pose(*CAN.position), CAN_SIZE, still.map_id)
    for name, value in change.items():
        setattr(goal, name, value)
    before = still.robot.joints()
    with pytest.raises(SkillError, match=text):
        still.skills.pick(goal, say)
    assert (
        np.abs(
            np.array(list(still.robot.joints().values())) - np.array(list(before.values()))
        ).max()
        < 0.01
    )


def test_a_map_has_its_id_from_all_that_is_in_it(still):
    turned = BuildCollisionMapGoal(pose(0.85, 0.0, 0.72), [], [])
    ids = [still.skills.build_collision_map(turned, say).map_id for _ in range(2)]
    turned.table.pose.orientation = Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    assert ids[0] == ids[1] != still.skills.build_collision_map(turned, say).map_id


def test_other_goals_that_cannot_be(still):
    with pytest.raises(SkillError, match="unknown arm 'both'"):
        still.skills.move_arms_aside(MoveArmsAsideGoal(['both']), say)
    with pytest.raises(SkillError, match='target: the point is not finite'):
        still.skills.point_head(
            PointHeadGoal(PointStamped(Header(frame_id=BASE), Point(math.inf, 0, 0))), say
        )
    with pytest.raises((SkillError, RobotError)):
        still.skills.point_head(
            PointHeadGoal(PointStamped(Header(frame_id=BASE), Point(-1.0, 0.0, 1.3))), say
        )
    with pytest.raises(SkillError, match='1 objects but 0 sizes'):
        still.skills.build_collision_map(
            BuildCollisionMapGoal(pose(0.8, 0, 0.7), [pose(0.6, 0, 0.8)], []), say
        )
    with pytest.raises(SkillError, match="table: frame 'moon'"):
        still.skills.build_collision_map(
            BuildCollisionMapGoal(pose(0.8, 0, 0.7, frame='moon'), [], []), say
        )


def test_a_large_square_thing_is_taken_by_its_sides_and_not_by_its_corners():
    straight = math.atan2(0.19, 0.65)  # from the right shoulder
    box = UprightBox(
        np.array([0.6, 0.0, 0.78]), np.array([0.068, 0.067, 0.12]), straight + math.pi / 4
    )
    off = (yaw_of(grasps(box, 'right')[0]) - box.yaw + math.pi / 4) % (math.pi / 2) - math.pi / 4
    assert abs(off) < math.radians(21)
    small = UprightBox(box.centre, np.array([0.055, 0.054, 0.12]), box.yaw)
    assert abs(yaw_of(grasps(small, 'right')[0]) - straight) < 0.11
