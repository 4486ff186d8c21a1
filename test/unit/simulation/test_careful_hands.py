"""Hands that come off a door, set a drink down until it stands, and reach it from elsewhere."""

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from std_msgs.msg import Header
from worlds import CAN, TABLE, scene

from smach_oracle.geometry.box import UprightBox
from smach_oracle.pr2.fingers import may_hold
from smach_oracle.pr2.kitchen import Kitchen, MapBox
from smach_oracle.pr2.nodes import kitchen_skills
from smach_oracle.pr2.planning.arm import Arm, SkillContext, SkillError
from smach_oracle.pr2.planning.collision import installed_model
from smach_oracle.pr2.planning.travel import stow
from smach_oracle.pr2.robot import ARMS
from smach_oracle.pr2.skills import door, fridge_pick, hand_off
from smach_oracle.pr2.skills.fridge_pick import STANCES
from smach_oracle.pr2.skills.pick import HeldObject, NoGrasp, pick
from smach_oracle.pr2.skills.place import place
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.rehearsal.drink_retrieval import TORSO_HEIGHT, DrinkRetrievalRehearsal
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT
from smach_oracle.simulation.scenes.kitchen_scene import draw

CAN_POSE = Pose(Point(0.7, 0.0, 0.8), Quaternion(0.0, 0.0, 0.0, 1.0))
CAN_SIZE = Vector3(0.06, 0.06, 0.12)
UNDER_CAN = MapBox(np.array([0.85, 0.0, 0.70]), np.array([0.35, 0.7, 0.02]), 0.0)


def after(seed, states):
    """The world after the first states of a trial without a cause."""
    world = World(draw(seed, benign=True), binning=2)
    for _, work in DrinkRetrievalRehearsal(world).states[:states]:
        work()
    return world


def test_a_door_whose_handle_slips_out_of_the_hand_is_opened_all_the_same():
    world = after(39, 3)
    assert world.body_joint('fridge', DOOR_JOINT) > np.radians(82.0)
    world.close()


def test_a_door_is_pressed_shut_and_the_hand_does_not_open_it_again():
    kitchen = draw(114, benign=True)
    fridge = kitchen.bodies[0]._replace(joints=((DOOR_JOINT, np.radians(95.0)),))
    world = World(
        kitchen._replace(
            bodies=(fridge,) + kitchen.bodies[1:],
            robot=kitchen.robot._replace(base=(0.68, -0.30, 0.0)),
        )
    )
    robot = DirectRobot(world)
    context = SkillContext(robot, installed_model())
    robot.torso(TORSO_HEIGHT)
    stow(context, ARMS, {})
    door.close_door(context, Kitchen(), 'left')
    assert world.body_joint('fridge', DOOR_JOINT) < np.radians(1.5)
    world.close()


def test_a_hand_that_has_found_no_grasp_does_not_look_as_if_it_held_something(monkeypatch):
    monkeypatch.setattr('smach_oracle.pr2.skills.pick.EFFORT', 1000)
    world = World(scene(TABLE, CAN))
    context = SkillContext(DirectRobot(world), installed_model())
    target = UprightBox(np.array(CAN.position), np.array([0.062, 0.062, 0.12]), 0.0)
    cage = {
        name: MapBox(target.centre + [x, y, z], np.array([0.08, 0.08, 0.08]), 0.0)
        for name, x, y, z in (
            ('before', -0.12, 0.0, 0.0),
            ('left', 0.0, 0.12, 0.0),
            ('right', 0.0, -0.12, 0.0),
            ('above', 0.0, 0.0, 0.15),
        )
    }
    with pytest.raises(NoGrasp):
        pick(context, 'right', target, {'table': UNDER_CAN, **cage})
    assert not may_hold(world.joints(), 'right')
    world.close()


@pytest.mark.parametrize('too_low', [0.012, -0.012])
def test_what_is_set_down_gently_stands_before_the_hand_lets_go(too_low):
    """Also where the support is higher or lower than the robot saw it, m."""
    world = World(scene(TABLE, CAN))
    robot = DirectRobot(world)
    context = SkillContext(robot, installed_model())
    target = UprightBox(np.array(CAN.position), np.array([0.062, 0.062, 0.12]), 0.0)
    held = pick(context, 'right', target, {'table': UNDER_CAN})
    let_go_at, gripper = [], robot.gripper

    def told(arm, position, max_effort=50.0):
        if position > 0:
            let_go_at.append(world.body_pose('can')[2, 3] - CAN.position[2])
        return gripper(arm, position, max_effort)

    robot.gripper = told
    support = UNDER_CAN._replace(centre=UNDER_CAN.centre - [0.0, 0.0, too_low])
    place(context, 'right', np.array([0.65, -0.25, 0.78]), held, {'table': support}, gently=True)
    assert abs(let_go_at[0]) < 0.003
    world.step(60)
    assert world.body_pose('can')[2, 2] > 0.999 and not world.holding('can')
    world.close()


def test_a_drink_that_is_out_of_reach_from_one_place_is_picked_from_another(monkeypatch):
    """The hand comes from above, or pushes others aside, only where nothing else can be done."""
    world = World(draw(1, benign=True))
    trial = DrinkRetrievalRehearsal(world)
    trial.data = {'drink': PoseStamped(Header(frame_id='base_link'), CAN_POSE), 'size': CAN_SIZE}
    tried, held = [], HeldObject(np.eye(4), np.eye(4), np.ones(3))

    def grasp(*given):
        tried.append(given[-2])
        if len(tried) < len(STANCES):
            raise NoGrasp('none')
        return held

    monkeypatch.setattr(kitchen_skills, 'come_near', lambda *given: given[2])
    monkeypatch.setattr(trial.skills, '_pick_inside', grasp)
    trial.states[5][1]()
    assert tuple(tried) == STANCES and not any(STANCES[0][1:])
    monkeypatch.setattr(trial.skills, '_pick_inside', lambda *_: raising(NoGrasp('none')))
    with pytest.raises(NoGrasp):
        trial.states[5][1]()
    world.close()


def raising(error):
    """Raise it."""
    raise error


def test_a_hand_that_is_held_up_is_drawn_back_along_its_own_axis(monkeypatch):
    """By the base, which can go sideways."""
    world = World(draw(1, benign=True)._replace(robot=draw(1).robot._replace(base=(0.6, 0.0, 0.0))))
    context = SkillContext(DirectRobot(world), installed_model())
    with Arm(context, 'right', {}, 1) as limb:
        away = limb.reach(hand_off.from_rpy((0.55, -0.1, 1.0), yaw=0.6))[0]
        limb.go(away)
    go_away, failures = hand_off.go_away, [SkillError('held up')]

    def fail_first(*given):
        if failures:
            raise failures.pop()
        go_away(*given)

    monkeypatch.setattr(hand_off, 'go_away', fail_first)
    before = world.true_base()
    assert hand_off.take_hands_off(context, Kitchen())
    way = world.true_base()[:2, 3] - before[:2, 3]
    assert way[1] < -0.03, 'it has gone to the right, and back'
    world.close()


def test_a_drink_stands_where_it_is_seen_last():
    target = UprightBox(np.array([0.8, 0.0, 0.86]), np.array([0.06, 0.06, 0.12]), 0.0)
    near, far = (UprightBox(target.centre + [x, 0.0, 0.0], target.size, 0.0) for x in (0.02, 0.09))
    larger = UprightBox(target.centre, target.size * 2, 0.0)
    assert fridge_pick.seen_again(target, [far, larger, near]) is near
    assert fridge_pick.seen_again(target, [far, larger]) is target
