#!/usr/bin/env python3
"""Pick an object from a table and place it elsewhere, again and again (the paper's VI-B).

A plain SMACH script over actions. It stops a trial at the first action that fails. Whoever has a
state executed again, in the same trial, has it done otherwise: the head looks from elsewhere after
a look that saw too little, the object is known again by its colour and size, and the hand takes it
otherwise. An object that could not be placed is taken from above. No transition leads to
STEP_ASIDE: it is for those who recover, where light falls into the camera or the object is out of
reach.
"""

import argparse
import sys
from typing import Any, List, Optional, Sequence

import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from std_msgs.msg import ColorRGBA, Header

import smach
from smach_oracle.msg import (
    BuildCollisionMapAction,
    DetectTabletopAction,
    DetectTabletopGoal,
    DetectTabletopResult,
    MoveArmsAsideAction,
    PickAction,
    PickGoal,
    PickResult,
    PlaceAction,
    PlaceGoal,
    PointHeadAction,
    PointHeadGoal,
)
from smach_oracle.srv import ResetWorld, ResetWorldRequest
from smach_ros import SimpleActionState

SERVER_WAIT_S = 20.0
ODOM = 'odom_combined'  # its origin is where the robot stands at the table
MIN_HEIGHT = 0.02  # m above the table
# m in ODOM, what the head is pointed at: the middle of the table, then beyond and before it. Each
# shows all places at which the nearest object can stand
VIEWS = ((0.65, 0.0, 0.801), (0.85, 0.0, 0.801), (0.50, 0.0, 0.801))
# m in ODOM: further left the light falls elsewhere, and the right arm reaches what stands on the
# left as well as the goal
ASIDE = Point(0.0, 0.3, 0.0)
REACH_LEFT = 0.25  # m to the left of the robot's middle, which the right arm reaches with ease
PLACE_TOLERANCE = 0.045  # m, of the area on which the object may stand


# what the script remembers in the course of one trial, in the userdata: so it survives a crash
MEMORY = {'input_keys': ['memory'], 'output_keys': ['memory']}
SEEN = ('table', 'objects', 'sizes')  # of a DetectTabletopResult, in the userdata
FROM_ABOVE = 2  # the attempt at which the hand comes from above, and reaches between things


def begin(userdata: smach.UserData, initial_states: Sequence[str] = ()) -> None:
    """Remember nothing yet, at the beginning of a trial. One that goes on has its memory."""
    if 'memory' not in userdata:
        userdata.memory = {
            'missed': 0,  # looks that did not show the object
            'look_at': None,  # PointStamped, where the last one said there is more to see
            'picks': 0,
            # what the object looked like when it was first seen, a 0: not seen yet
            'colour': ColorRGBA(),
            'size': Vector3(),
        }


def head_goal(userdata: smach.UserData, goal: PointHeadGoal) -> PointHeadGoal:
    """Look at the table. From another head pose after each look that showed too little."""
    view = VIEWS[userdata.memory['missed'] % len(VIEWS)]
    return PointHeadGoal(
        userdata.memory['look_at'] or PointStamped(Header(frame_id=ODOM), Point(*view))
    )


def detect_goal(userdata: smach.UserData, goal: DetectTabletopGoal) -> DetectTabletopGoal:
    """Find the object that is nearest to where the trial began, and from then on that one."""
    return DetectTabletopGoal(
        MIN_HEIGHT,
        userdata.memory['colour'],
        userdata.memory['size'],
        PointStamped(header=Header(frame_id=ODOM)),
    )


def detected(userdata: smach.UserData, status: int, result: DetectTabletopResult) -> None:
    """Keep where things stand and what the object looks like, or that it was not seen.

    A look that failed tells nothing: what was seen before it counts on.
    """
    memory = userdata.memory
    if status != GoalStatus.SUCCEEDED:
        known = result is not None and result.look_at.header.frame_id
        userdata.memory = dict(
            memory, missed=memory['missed'] + 1, look_at=result.look_at if known else None
        )
        return
    for key in SEEN:
        setattr(userdata, key, getattr(result, key))
    if not memory['colour'].a:
        userdata.memory = dict(memory, colour=result.colours[0], size=result.sizes[0])


def pick_goal(userdata: smach.UserData, goal: PickGoal) -> PickGoal:
    """Pick the object with the right arm."""
    picks = userdata.memory['picks']
    userdata.memory = dict(userdata.memory, picks=picks + 1)
    return PickGoal(
        'right', userdata.objects[0], userdata.sizes[0], userdata.map_id, min(picks, 255)
    )


def picked(userdata: smach.UserData, status: int, result: PickResult) -> None:
    """Hold the object from above next time: it is picked again where it could not be placed so."""
    if status == GoalStatus.SUCCEEDED:
        picks = max(userdata.memory['picks'], FROM_ABOVE)
        userdata.memory = dict(userdata.memory, picks=picks)


def object_in_reach(userdata: smach.UserData) -> bool:
    """Whether the right arm reaches the detected object from where the robot stood then."""
    return bool(userdata.objects[0].pose.position.y < REACH_LEFT)


def make_machine() -> smach.StateMachine:
    """The state machine of Fig. 5 in the paper, and a step aside, without its oracle."""
    sm = smach.StateMachine(
        outcomes=['succeeded', 'aborted', 'preempted'], input_keys=['place_pose']
    )
    sm.register_start_cb(begin)
    with sm:
        smach.StateMachine.add(
            'MOVE_ARMS_ASIDE',
            action('move_arms_aside', MoveArmsAsideAction),
            {'succeeded': 'POINT_HEAD'},
        )
        smach.StateMachine.add('STEP_ASIDE', drive(ASIDE), {'succeeded': 'POINT_HEAD'})
        smach.StateMachine.add(
            'POINT_HEAD',
            action('point_head', PointHeadAction, goal_cb=head_goal, **MEMORY),
            {'succeeded': 'DETECT_TABLETOP'},
        )
        smach.StateMachine.add(
            'DETECT_TABLETOP',
            action(
                'detect_tabletop',
                DetectTabletopAction,
                goal_cb=detect_goal,
                result_cb=detected,
                input_keys=['memory'],
                output_keys=['memory', *SEEN],
            ),
            {'succeeded': 'BUILD_COLLISION_MAP'},
        )
        smach.StateMachine.add(
            'BUILD_COLLISION_MAP',
            action(
                'build_collision_map',
                BuildCollisionMapAction,
                goal_slots=['table', 'objects', 'sizes'],
                result_slots=['map_id'],
            ),
            {'succeeded': 'PICK'},
        )
        smach.StateMachine.add(
            'PICK',
            action(
                'pick',
                PickAction,
                goal_cb=pick_goal,
                result_cb=picked,
                output_keys=['memory'],
                input_keys=['objects', 'sizes', 'map_id', 'memory'],
                result_slots=['grasp'],
            ),
            {'succeeded': 'PLACE'},
        )
        smach.StateMachine.add(
            'PLACE',
            action(
                'place',
                PlaceAction,
                goal_cb=place_goal,
                input_keys=['place_pose', 'grasp', 'map_id'],
            ),
        )
    return sm


def action(name: str, spec: type, **options: Any) -> SimpleActionState:
    """An action state that does not wait for its server forever."""
    return SimpleActionState(
        name, spec, server_wait_timeout=rospy.Duration(SERVER_WAIT_S), **options
    )


def drive(place: Point) -> SimpleActionState:
    """A state that drives the base to a place in ODOM, without a turn."""
    target = PoseStamped(Header(frame_id=ODOM), Pose(place, Quaternion(0.0, 0.0, 0.0, 1.0)))
    return action('move_base', MoveBaseAction, goal=MoveBaseGoal(target))


def place_goal(userdata: smach.UserData, goal: PlaceGoal) -> PlaceGoal:
    """Place what the right arm holds, at a free spot near enough."""
    return PlaceGoal('right', userdata.place_pose, userdata.grasp, userdata.map_id, PLACE_TOLERANCE)


def place_pose() -> PoseStamped:
    """Return the pose at which the object should stand, m, in ODOM."""
    return PoseStamped(
        Header(frame_id=ODOM), Pose(Point(0.6, -0.35, 0.851), Quaternion(0.0, 0.0, 0.0, 1.0))
    )


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
            'roslaunch smach_oracle pick_and_place.launch'.format(
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
        sm.userdata.place_pose = place_pose()
        outcome = sm.execute()
        successes += outcome == 'succeeded'
        rospy.loginfo('trial %d of %d (seed %d): %s', trial + 1, trials, seed + trial, outcome)
    return successes


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description='Pick an object from a table and place it elsewhere.'
    )
    parser.add_argument('--trials', type=int, default=1, help='how many times (default: 1)')
    parser.add_argument(
        '--seed', type=int, default=1, help='of the first trial; the next has the next (default: 1)'
    )
    args = parser.parse_args(rospy.myargv(argv if argv is not None else sys.argv)[1:])
    if args.trials < 1 or args.seed < 0:
        parser.error('--trials must be 1 or more and --seed 0 or more')
    rospy.init_node('pick_and_place')
    successes = run_trials(make_machine(), args.trials, args.seed)
    rospy.loginfo('%d of %d trials succeeded', successes, args.trials)
    return 0


if __name__ == '__main__':
    sys.exit(main())
