#!/usr/bin/env python3
"""Fetch a drink out of a refrigerator and hand it over, again and again (the paper's VI-B).

A plain SMACH script over actions. It stops a trial at the first action that fails. Whoever has a
state executed again, in the same trial, has it done otherwise: the robot looks into the fridge from
another place and head pose, and grips the drink firmer.
"""

import argparse
import math
import sys
from typing import Any, List, Optional, Sequence

import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from std_msgs.msg import Header

import smach
from control_msgs.msg import SingleJointPositionAction, SingleJointPositionGoal
from smach_oracle.msg import (
    CloseDoorAction,
    CloseDoorGoal,
    DetectDrinkAction,
    DetectDrinkGoal,
    DetectDrinkResult,
    HandOverAction,
    HandOverGoal,
    LocaliseAtFridgeAction,
    OpenDoorAction,
    OpenDoorGoal,
    PickAction,
    PickGoal,
)
from smach_oracle.srv import ResetWorld, ResetWorldRequest
from smach_ros import SimpleActionState

SERVER_WAIT_S = 20.0
ODOM = 'odom_combined'
# the collision map that PICK plans in: the known furniture, and what the camera sees on its shelf
FRIDGE = 'fridge'
TORSO_HEIGHT = 0.25  # m
MIN_HEIGHT = 0.05  # m above the shelf
ORDERED = 'red'  # the colour of the drink that the person has ordered
# x, y in m, yaw in rad, in odom_combined
IN_THE_FRIDGE = (1.00, -0.20, 0.0)
BESIDE_THE_DOOR = (1.00, -0.60, 0.0)  # from where the shelf is seen otherwise
LOOK_FROM = (IN_THE_FRIDGE, IN_THE_FRIDGE, BESIDE_THE_DOOR)
OUT_OF_THE_FRIDGE = (0.68, -0.30, 0.0)
HOME = (0.0, 0.0, math.pi / 2)
PALM = (0.0, 0.62, 0.85)  # m. The middle of the palm that waits for the drink


def begin(userdata: smach.UserData, initial_states: Sequence[str] = ()) -> None:
    """Remember nothing yet, at the beginning of a trial. One that goes on has its memory.

    The userdata has it, so it survives a crash: looks that did not show the drink, and picks.
    """
    if 'missed' not in userdata:
        userdata.missed, userdata.picks = 0, 0


def detect_goal(userdata: smach.UserData, goal: DetectDrinkGoal) -> DetectDrinkGoal:
    """Look for the drink. From another head pose after each look that did not show it."""
    return DetectDrinkGoal(MIN_HEIGHT, ORDERED, userdata.missed % 256)


def detected(userdata: smach.UserData, status: int, result: DetectDrinkResult) -> None:
    """Keep whether the drink was seen."""
    userdata.missed += status != GoalStatus.SUCCEEDED


def move_in_goal(userdata: smach.UserData, goal: MoveBaseGoal) -> MoveBaseGoal:
    """Drive before the shelf; after two looks that did not show the drink, to another place.

    A light that falls into the camera does so from one place, and what hides a drink does too.
    """
    return MoveBaseGoal(pose_on_floor(*LOOK_FROM[userdata.missed % len(LOOK_FROM)]))


def pick_goal(userdata: smach.UserData, goal: PickGoal) -> PickGoal:
    """Pick the drink with the right arm. The door stands open on the left."""
    userdata.picks += 1
    return PickGoal('right', userdata.drink, userdata.size, FRIDGE, min(userdata.picks - 1, 255))


def make_machine() -> smach.StateMachine:
    """The state machine of Fig. 7 in the paper, with a look at where it stands, without oracle."""
    sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    sm.register_start_cb(begin)
    with sm:
        smach.StateMachine.add('RAISE_TORSO', torso(TORSO_HEIGHT), {'succeeded': 'LOCALISE'})
        smach.StateMachine.add(
            'LOCALISE',
            action('localise_at_fridge', LocaliseAtFridgeAction),
            {'succeeded': 'OPEN_FRIDGE'},
        )
        smach.StateMachine.add(
            'OPEN_FRIDGE',
            action('open_door', OpenDoorAction, goal=OpenDoorGoal('right')),
            {'succeeded': 'MOVE_IN'},
        )
        smach.StateMachine.add(
            'MOVE_IN',
            action('move_base', MoveBaseAction, goal_cb=move_in_goal, input_keys=['missed']),
            {'succeeded': 'DETECT_DRINK'},
        )
        smach.StateMachine.add(
            'DETECT_DRINK',
            action(
                'detect_drink',
                DetectDrinkAction,
                goal_cb=detect_goal,
                result_cb=detected,
                input_keys=['missed'],
                output_keys=['missed'],
                result_slots=['drink', 'size'],
            ),
            {'succeeded': 'PICK_DRINK'},
        )
        smach.StateMachine.add(
            'PICK_DRINK',
            action(
                'pick',
                PickAction,
                goal_cb=pick_goal,
                input_keys=['drink', 'size', 'picks'],
                output_keys=['picks'],
                result_slots=['grasp'],
            ),
            {'succeeded': 'MOVE_OUT'},
        )
        smach.StateMachine.add('MOVE_OUT', drive(*OUT_OF_THE_FRIDGE), {'succeeded': 'CLOSE_FRIDGE'})
        smach.StateMachine.add(
            'CLOSE_FRIDGE',
            action('close_door', CloseDoorAction, goal=CloseDoorGoal('left')),
            {'succeeded': 'MOVE_HOME'},
        )
        smach.StateMachine.add('MOVE_HOME', drive(*HOME), {'succeeded': 'HAND_OVER'})
        smach.StateMachine.add(
            'HAND_OVER', action('hand_over', HandOverAction, goal=HandOverGoal('right', palm()))
        )
    return sm


def action(name: str, spec: type, **options: Any) -> SimpleActionState:
    """An action state that does not wait for its server forever."""
    return SimpleActionState(
        name, spec, server_wait_timeout=rospy.Duration(SERVER_WAIT_S), **options
    )


def torso(height_m: float) -> SimpleActionState:
    """A state that lifts the torso."""
    return action(
        'torso_controller/position_joint_action',
        SingleJointPositionAction,
        goal=SingleJointPositionGoal(position=height_m),
    )


def drive(x_m: float, y_m: float, yaw: float) -> SimpleActionState:
    """A state that drives the base to a pose in odom_combined."""
    return action('move_base', MoveBaseAction, goal=MoveBaseGoal(pose_on_floor(x_m, y_m, yaw)))


def pose_on_floor(x_m: float, y_m: float, yaw: float) -> PoseStamped:
    """A pose in odom_combined."""
    heading = Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return PoseStamped(Header(frame_id=ODOM), Pose(Point(x_m, y_m, 0.0), heading))


def palm() -> PoseStamped:
    """Return the pose at which the person holds out a hand."""
    return PoseStamped(Header(frame_id=ODOM), Pose(Point(*PALM), Quaternion(0.0, 0.0, 0.0, 1.0)))


def find_reset() -> rospy.ServiceProxy:
    """The service that begins a trial.

    :raises SystemExit: where there is no world.
    """
    try:
        rospy.wait_for_service('world/reset', SERVER_WAIT_S)
    except rospy.ROSInterruptException:
        raise
    except rospy.ROSException as err:
        raise SystemExit(
            'drink_retrieval: no world here: {} does not come within {:.0f} s; what starts both: '
            'roslaunch smach_oracle drink_retrieval.launch'.format(
                rospy.resolve_name('world/reset'), SERVER_WAIT_S
            )
        ) from err
    return rospy.ServiceProxy('world/reset', ResetWorld)


def run_trials(sm: smach.StateMachine, trials: int, seed: int) -> int:
    """Run the machine once per trial.

    :returns: how many trials ended in success.
    :raises RuntimeError: where the world does not take a seed.
    """
    reset = find_reset()
    successes = 0
    for trial in range(trials):
        if rospy.is_shutdown():
            break
        answer = reset(ResetWorldRequest(seed=seed + trial))
        if not answer.ok:
            raise RuntimeError('world/reset: ' + answer.message)
        sm.userdata = smach.UserData()
        outcome = sm.execute()
        successes += outcome == 'succeeded'
        rospy.loginfo('trial %d of %d (seed %d): %s', trial + 1, trials, seed + trial, outcome)
    return successes


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description='Fetch a drink out of a refrigerator and hand it over.'
    )
    parser.add_argument('--trials', type=int, default=1, help='how many times (default: 1)')
    parser.add_argument(
        '--seed', type=int, default=1, help='of the first trial; the next has the next (default: 1)'
    )
    args = parser.parse_args(rospy.myargv(argv if argv is not None else sys.argv)[1:])
    if args.trials < 1 or args.seed < 0:
        parser.error('--trials must be 1 or more and --seed 0 or more')
    rospy.init_node('drink_retrieval')
    successes = run_trials(make_machine(), args.trials, args.seed)
    rospy.loginfo('%d of %d trials succeeded', successes, args.trials)
    return 0


if __name__ == '__main__':
    sys.exit(main())
