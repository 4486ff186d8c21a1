#!/usr/bin/env python3
"""The rate of a driven hand's targets, and how soon it stands: the simulated PR2 at real time, own
master.

    benchmarks/teleoperation.py [--seconds N] [--stops N] [--check]

Commands come 40 times a second, as a page sends them. Prints the rate of the joint targets as a
share of the rate that is set, and the world's time from the release, and from the last command of a
link that is lost, until all joints stand. --check fails below 30 targets a second of the world's
time, or where the median stop takes more than 100 ms.
"""

import argparse
import os
import signal
import statistics
import subprocess
import sys
import time

COMMANDS_HZ, LEAST_HZ = 40.0, 30.0
LONGEST_STOP_S = 0.1
STANDS = 2e-4  # rad between two joint states, 1/60 s apart
FIXTURES = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'test', 'rostest')

sys.path.insert(0, FIXTURES)


class Measured:
    """A person who drives, and what the robot tells meanwhile."""

    def __init__(self):
        import rospy
        from sensor_msgs.msg import JointState
        from teleoperation_fixtures import Person
        from trajectory_msgs.msg import JointTrajectory

        self._now = lambda: rospy.Time.now().to_sec()
        self.person = Person('manipulation_interface')
        self.joints, self.targets = [], []
        rospy.Subscriber(
            'joint_states', JointState, self.joints.append, queue_size=200, tcp_nodelay=True
        )
        rospy.Subscriber(
            'r_arm_controller/command',
            JointTrajectory,
            lambda _: self.targets.append(self._now()),
            queue_size=200,
            tcp_nodelay=True,
        )
        self.person.start()
        self.person.active()
        self._up = 1

    def drive(self, seconds):
        """Up and down in turns; when the last command was sent (s of the world's time)."""
        self._up = -self._up
        self.person.hold(seconds, COMMANDS_HZ, linear=(0.0, 0.0, 0.08 * self._up))
        return self._now()

    def rate_hz(self, seconds):
        """Targets a second of the world's time while the hand is driven."""
        begun, begun_s = len(self.targets), self._now()
        ended_s = begun_s
        while ended_s - begun_s < seconds:
            ended_s = self.drive(1.0)
        return (len(self.targets) - begun) / (ended_s - begun_s)

    def stop_s(self, release):
        """The world's time until all joints stand."""
        self.drive(0.5)
        if release:
            self.person.send(held=False)
        told_s = self._now()
        time.sleep(0.6)
        told = [each for each in self.joints if each.header.stamp.to_sec() > told_s - 0.2]
        return max(
            [
                after.header.stamp.to_sec() - told_s
                for before, after in zip(told, told[1:])
                if max(abs(a - b) for a, b in zip(after.position, before.position)) > STANDS
            ],
            default=0.0,
        )


def measure(options):
    """Rates and stops, printed; whether they are within the limits."""
    import rospy

    rospy.init_node('benchmark', disable_signals=True)
    measured = Measured()
    asked = rospy.get_param('manipulation_interface/rate_hz')
    measured.drive(1.0)
    rate_hz = measured.rate_hz(options.seconds)
    print(
        "{:.1f} joint targets a second of the world's time, {:.2f} of the "
        '{:.0f} that are set'.format(rate_hz, rate_hz / asked, asked)
    )
    good = rate_hz >= LEAST_HZ
    for what, release in (('released', True), ('link lost', False)):
        stops = [measured.stop_s(release) for _ in range(options.stops)]
        print(
            '{}: stands after {:.0f} ms in the median, {:.0f} to {:.0f} ms'.format(
                what, *(1e3 * each for each in (statistics.median(stops), min(stops), max(stops)))
            )
        )
        good = good and statistics.median(stops) <= LONGEST_STOP_S
    rospy.signal_shutdown('measured')
    return good


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        '--seconds', type=float, default=3.0, help='to drive for the rate (default: %(default)s)'
    )
    parser.add_argument('--stops', type=int, default=5, help='of each kind (default: %(default)s)')
    parser.add_argument('--check', action='store_true', help='fail outside of the limits')
    options = parser.parse_args()
    from own_master import wait_for_master

    from smach_oracle.experiment.launching import free_port

    port = free_port()
    os.environ['ROS_MASTER_URI'] = 'http://localhost:{}'.format(port)
    robot = subprocess.Popen(
        ['roslaunch', '-p', str(port), os.path.join(FIXTURES, 'console_drive_pr2.test')],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for_master(os.environ['ROS_MASTER_URI'])
        good = measure(options)
    finally:
        robot.send_signal(signal.SIGINT)
        robot.wait(30)
    return 1 if options.check and not good else 0


if __name__ == '__main__':
    sys.exit(main())
