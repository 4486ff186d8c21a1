#!/usr/bin/env python3
"""What one execution of a SimpleActionState takes whose goal succeeds at once: from `execute` until
its outcome, with the server in another process, over loopback on a real master.

    benchmarks/goal_round_trip.py [--goals N] [--check]

The unit is one message of an empty topic to that process and its answer, right before each goal.
--check fails where the median goal takes more than the limit.
"""

import argparse
import os
import statistics
import sys
import threading
import time

LIMIT = 5.0  # messages there and back
GO, BACK, WORK = '/round_trip/go', '/round_trip/back', '/round_trip/work'
WARM = 5

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))


def main():
    options = parse()
    if options.role == 'server':
        return serve()
    from answer_latency import Processes

    with Processes() as processes:
        processes.start_master()
        processes.start([sys.executable, __file__, '--role', 'server'])
        return report(*measure(options.goals), options)


def parse():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--goals', type=int, default=300)
    parser.add_argument(
        '--check', action='store_true', help='fail above {:g} messages'.format(LIMIT)
    )
    parser.add_argument('--role', default='client', help=argparse.SUPPRESS)
    return parser.parse_args()


def serve():
    """Answer each empty message with one, and each goal with a success."""
    import actionlib
    import rospy
    from actionlib.msg import TestAction, TestResult
    from std_msgs.msg import Empty

    rospy.init_node('round_trip_server', log_level=rospy.WARN)

    def succeed(handle):
        handle.set_accepted()
        handle.set_succeeded(TestResult(1))

    back = rospy.Publisher(BACK, Empty, queue_size=1, tcp_nodelay=True)
    actionlib.ActionServer(WORK, TestAction, succeed, auto_start=False).start()
    rospy.Subscriber(GO, Empty, back.publish, tcp_nodelay=True)
    rospy.spin()


def measure(goals):
    """Return what goals took, and the messages right before them, in seconds."""
    import rospy
    from actionlib.msg import TestAction, TestGoal
    from std_msgs.msg import Empty

    import smach
    from smach_ros import SimpleActionState

    rospy.init_node('round_trip_client', disable_signals=True, log_level=rospy.WARN)
    answered = threading.Event()
    rospy.Subscriber(BACK, Empty, lambda _: answered.set(), tcp_nodelay=True)
    go = rospy.Publisher(GO, Empty, queue_size=1, tcp_nodelay=True)
    until_s = time.monotonic() + 60.0
    while not answered.wait(0.1) and time.monotonic() < until_s:
        go.publish(Empty())  # what comes before the connections is lost
    state = SimpleActionState(WORK, TestAction, goal=TestGoal(100))
    taken, messages = [], []
    for number in range(goals + WARM):
        answered.clear()
        sent_s = time.monotonic()
        go.publish(Empty())
        if not answered.wait(10.0):
            raise RuntimeError('message {} was not answered'.format(number))
        begun_s = time.monotonic()
        outcome = state.execute(smach.UserData())
        ended_s = time.monotonic()
        if outcome != 'succeeded':
            raise RuntimeError('goal {} ended with {}'.format(number, outcome))
        messages.append(begun_s - sent_s)
        taken.append(ended_s - begun_s)
    return taken[WARM:], messages[WARM:]


def report(taken, messages, options):
    goal_s, message_s = statistics.median(taken), statistics.median(messages)
    print('medians of {}'.format(len(taken)))
    print('a message there and back  {:.3f} ms'.format(1e3 * message_s))
    print('a goal until its outcome  {:.3f} ms'.format(1e3 * goal_s))
    ratio = goal_s / message_s
    print('a goal takes {:.1f} messages (limit {:g})'.format(ratio, LIMIT))
    return int(options.check and ratio > LIMIT)


if __name__ == '__main__':
    sys.exit(main())
