#!/usr/bin/env python3
"""Pick an object from a table and place it elsewhere, again and again (the paper's VI-B).

A plain SMACH script over actions. It stops a trial at the first action that fails.
"""
import argparse
import sys
from typing import Any, List, Optional

import rospy
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header

import smach
from smach_oracle.msg import (
    BuildCollisionMapAction,
    DetectTabletopAction,
    DetectTabletopGoal,
    MoveArmsAsideAction,
    PickAction,
    PickGoal,
    PlaceAction,
    PlaceGoal,
    PointHeadAction,
    PointHeadGoal,
)
from smach_oracle.srv import ResetWorld, ResetWorldRequest
from smach_ros import SimpleActionState

SERVER_WAIT_S = 20.0
BASE = 'base_link'


def make_machine() -> smach.StateMachine:
    """The state machine of Fig. 5 in the paper, without its oracle."""
    sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'],
                            input_keys=['place_pose'])
    with sm:
        smach.StateMachine.add('MOVE_ARMS_ASIDE', action('move_arms_aside', MoveArmsAsideAction),
                               {'succeeded': 'POINT_HEAD'})
        smach.StateMachine.add('POINT_HEAD', action('point_head', PointHeadAction,
                                                    goal=head_goal()),
                               {'succeeded': 'DETECT_TABLETOP'})
        smach.StateMachine.add(
            'DETECT_TABLETOP',
            action('detect_tabletop', DetectTabletopAction, goal=DetectTabletopGoal(0.02),
                   result_slots=['table', 'objects', 'sizes']),
            {'succeeded': 'BUILD_COLLISION_MAP'})
        smach.StateMachine.add(
            'BUILD_COLLISION_MAP',
            action('build_collision_map', BuildCollisionMapAction,
                   goal_slots=['table', 'objects', 'sizes'], result_slots=['map_id']),
            {'succeeded': 'PICK'})
        smach.StateMachine.add(
            'PICK',
            action('pick', PickAction, goal_cb=pick_goal, input_keys=['objects', 'sizes', 'map_id'],
                   result_slots=['grasp']), {'succeeded': 'PLACE'})
        smach.StateMachine.add('PLACE', action('place', PlaceAction, goal_cb=place_goal,
                                               input_keys=['place_pose', 'grasp', 'map_id']))
    return sm


def action(name: str, spec: type, **options: Any) -> SimpleActionState:
    """An action state that does not wait for its server for ever."""
    return SimpleActionState(name, spec, server_wait_timeout=rospy.Duration(SERVER_WAIT_S),
                             **options)


def head_goal() -> PointHeadGoal:
    """Look at the middle of the table (m, in the robot's base frame)."""
    return PointHeadGoal(PointStamped(Header(frame_id=BASE), Point(0.65, 0.0, 0.75)))


def pick_goal(userdata: smach.UserData, goal: PickGoal) -> PickGoal:
    """Pick the nearest object with the right arm."""
    return PickGoal('right', userdata.objects[0], userdata.sizes[0], userdata.map_id)


def place_goal(userdata: smach.UserData, goal: PlaceGoal) -> PlaceGoal:
    """Place what the right arm holds."""
    return PlaceGoal('right', userdata.place_pose, userdata.grasp, userdata.map_id)


def place_pose() -> PoseStamped:
    """Where the object shall stand (m, in the robot's base frame)."""
    return PoseStamped(Header(frame_id=BASE),
                       Pose(Point(0.6, -0.35, 0.8), Quaternion(0.0, 0.0, 0.0, 1.0)))


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
            'pick_and_place: no world here: {} does not come within {:.0f} s; what starts both: '
            'roslaunch smach_oracle pick_and_place.launch'.format(rospy.resolve_name('world/reset'),
                                                                  SERVER_WAIT_S)) from err
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
        sm.userdata.place_pose = place_pose()
        outcome = sm.execute()
        successes += outcome == 'succeeded'
        rospy.loginfo('trial %d of %d (seed %d): %s', trial + 1, trials, seed + trial, outcome)
    return successes


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description='Pick an object from a table and place it elsewhere.')
    parser.add_argument('--trials', type=int, default=1, help='how many times (default: 1)')
    parser.add_argument('--seed', type=int, default=1,
                        help='of the first trial; the next has the next (default: 1)')
    args = parser.parse_args(rospy.myargv(argv if argv is not None else sys.argv)[1:])
    if args.trials < 1 or args.seed < 0:
        parser.error('--trials must be 1 or more and --seed 0 or more')
    rospy.init_node('pick_and_place')
    successes = run_trials(make_machine(), args.trials, args.seed)
    rospy.loginfo('%d of %d trials succeeded', successes, args.trials)
    return 0


if __name__ == '__main__':
    sys.exit(main())
