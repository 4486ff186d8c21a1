#!/usr/bin/env python3
"""The share of programs that hang after a signal around their first execute: bare, wrapped as a
library, and under oracle_run, in one run.

    benchmarks/signals.py [--signals N] [--seed S]

Each process gets one SIGINT or SIGTERM, at an instant drawn from the seed within a second of its
first execute, on a master of its own. A process that has not ended 20 s later counts as hung. A bag
counts as whole where rosbag reads it to its end. The exit status is 1 where a bag is not whole, or
oracle_run hangs. The bare script may hang as well: in rospy's own clean-up.
"""

import argparse
import collections
import os
import signal
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'rostest'))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        '--signals', type=int, default=40, help='to processes of each kind (default: %(default)s)'
    )
    parser.add_argument(
        '--seed', type=int, default=1, help='of the instants (default: %(default)s)'
    )
    options = parser.parse_args()
    from own_master import wait_for_master
    from signalled_programs import KINDS, signal_many

    from smach_oracle.experiment.launching import free_port

    port = free_port()
    os.environ['ROS_MASTER_URI'] = 'http://localhost:{}'.format(port)
    master = subprocess.Popen(
        ['rosmaster', '--core', '-p', str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for_master(os.environ['ROS_MASTER_URI'])
        endings = signal_many(options.signals, options.seed)
    finally:
        master.send_signal(signal.SIGINT)
        master.wait(10)
    hung = collections.Counter(ending.kind for ending in endings if ending.code is None)
    broken = [text for ending in endings for text in ending.broken_bags]
    for kind in KINDS:
        print('{:10s} {:3d} of {} hung'.format(kind, hung[kind], options.signals))
    print('bags that are not whole: {}'.format(len(broken)))
    for text in broken:
        print('  ' + text)
    return int(bool(broken or hung['oracle_run']))


if __name__ == '__main__':
    sys.exit(main())
