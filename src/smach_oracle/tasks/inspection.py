#!/usr/bin/env python3
"""Drive to three panels and read their gauges, again and again.

A plain SMACH script over an action and services, for a wheeled robot with a camera. It stops a tour
at the first thing that fails.
"""

import argparse
import math
import re
import sys
import time
from typing import Any, Dict, List, Optional

import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger, TriggerResponse

import smach
from smach_ros import ServiceState, SimpleActionState

SERVER_WAIT_S = 20.0
OUTCOMES = ['succeeded', 'aborted', 'preempted']
# where to stand, in the map (m, rad), and the number of the panel that is to be read from there
PLACES: List[Dict[str, Any]] = [
    {'name': 'pump', 'panel': 1, 'x': 1.8, 'y': 5.5, 'yaw': math.pi / 2},
    {'name': 'boiler', 'panel': 2, 'x': 5.0, 'y': 1.5, 'yaw': -math.pi / 2},
    {'name': 'tank', 'panel': 3, 'x': 8.5, 'y': 4.8, 'yaw': 0.0},
]
READING = re.compile(r'panel (\d+): ([\d.]+) bar')


class Report(smach.State):
    """Tell a reading to whoever keeps the books."""

    def __init__(self) -> None:
        smach.State.__init__(
            self,
            outcomes=['succeeded'],
            input_keys=['place', 'reading', 'readings'],
            output_keys=['readings'],
        )
        self.publisher = rospy.Publisher('inspection/report', String, queue_size=10)

    def execute(self, userdata: smach.UserData) -> str:
        """Publish it, and put it on the list."""
        self.publisher.publish(
            'panel {}: {:.2f} bar'.format(userdata.place['panel'], userdata.reading)
        )
        userdata.readings = userdata.readings + [(userdata.place['name'], userdata.reading)]
        rospy.loginfo('%s: %.2f bar', userdata.place['name'], userdata.reading)
        return 'succeeded'


def make_machine() -> smach.StateMachine:
    """LOCALISE, DRIVE, INSPECT, REPORT, at each place."""
    at_place = smach.StateMachine(
        outcomes=OUTCOMES, input_keys=['place', 'readings'], output_keys=['readings']
    )
    with at_place:
        smach.StateMachine.add(
            'LOCALISE',
            ServiceState('localise', Trigger, response_cb=localised, outcomes=OUTCOMES),
            {'succeeded': 'DRIVE'},
        )
        smach.StateMachine.add(
            'DRIVE',
            SimpleActionState(
                'move_base',
                MoveBaseAction,
                goal_cb=drive_goal,
                input_keys=['place'],
                server_wait_timeout=rospy.Duration(SERVER_WAIT_S),
            ),
            {'succeeded': 'INSPECT'},
        )
        smach.StateMachine.add(
            'INSPECT',
            ServiceState(
                'inspect',
                Trigger,
                response_cb=inspected,
                outcomes=OUTCOMES,
                input_keys=['place'],
                output_keys=['reading'],
            ),
            {'succeeded': 'REPORT'},
        )
        smach.StateMachine.add('REPORT', Report())
    tour = smach.Iterator(
        outcomes=OUTCOMES,
        input_keys=['readings'],
        output_keys=['readings'],
        it=PLACES,
        it_label='place',
        exhausted_outcome='succeeded',
    )
    with tour:
        smach.Iterator.set_contained_state('AT_PLACE', at_place, loop_outcomes=['succeeded'])
    sm = smach.StateMachine(outcomes=OUTCOMES)
    sm.userdata.readings = []
    with sm:
        smach.StateMachine.add('TOUR', tour)
    return sm


def drive_goal(userdata: smach.UserData, goal: MoveBaseGoal) -> MoveBaseGoal:
    """Return the goal with which the robot drives to a place, to stand there."""
    place = userdata.place
    turn = Quaternion(0.0, 0.0, math.sin(0.5 * place['yaw']), math.cos(0.5 * place['yaw']))
    return MoveBaseGoal(
        PoseStamped(Header(frame_id='map'), Pose(Point(place['x'], place['y'], 0.0), turn))
    )


def localised(userdata: smach.UserData, response: TriggerResponse) -> str:
    """Whether the robot knows where it is."""
    return 'succeeded' if response.success else 'aborted'


def inspected(userdata: smach.UserData, response: TriggerResponse) -> str:
    """Take the reading, if it is that of the panel at this place."""
    found = READING.fullmatch(response.message) if response.success else None
    if found is None or int(found.group(1)) != userdata.place['panel']:
        rospy.logwarn('%s: %s', userdata.place['name'], response.message)
        return 'aborted'
    userdata.reading = float(found.group(2))
    return 'succeeded'


def wait_for_robot() -> None:
    """Wait until the robot's services are there.

    :raises SystemExit: where they do not come.
    """
    for name in ('new_trial', 'end_trial', 'localise', 'inspect'):
        try:
            rospy.wait_for_service(name, SERVER_WAIT_S)
        except rospy.ROSInterruptException:
            raise
        except rospy.ROSException as err:
            raise SystemExit(
                'inspection: no world here: {} does not come within {:.0f} s; what starts both: '
                'roslaunch smach_oracle inspection.launch'.format(
                    rospy.resolve_name(name), SERVER_WAIT_S
                )
            ) from err


def run_trials(sm: smach.StateMachine, trials: int) -> int:
    """Run the machine once per trial.

    :returns: how many trials ended in success.
    """
    begin, end = (rospy.ServiceProxy(name, Trigger) for name in ('new_trial', 'end_trial'))
    successes = 0
    for trial in range(trials):
        if rospy.is_shutdown():
            break
        begun, told = time.monotonic(), begin()
        sm.userdata.readings = []
        outcome = sm.execute()
        if rospy.is_shutdown():
            break
        end()
        successes += outcome == 'succeeded'
        rospy.loginfo(
            'trial %d of %d (%s): %s after %.0f s: %s',
            trial + 1,
            trials,
            told.message,
            outcome,
            time.monotonic() - begun,
            ', '.join('{} {:.2f} bar'.format(*each) for each in sm.userdata.readings),
        )
    return successes


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description='Drive to three panels and read their gauges.')
    parser.add_argument('--trials', type=int, default=1, help='how many tours (default: 1)')
    args = parser.parse_args(rospy.myargv(argv if argv is not None else sys.argv)[1:])
    if args.trials < 1:
        parser.error('--trials must be 1 or more')
    rospy.init_node('inspection')
    wait_for_robot()
    successes = run_trials(make_machine(), args.trials)
    rospy.loginfo('%d of %d trials succeeded', successes, args.trials)
    return 0


if __name__ == '__main__':
    sys.exit(main())
