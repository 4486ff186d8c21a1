"""The kit needs smach and Python alone, as long as no test asks for ROS."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
TRIAL = """
import sys
sys.path.insert(0, sys.argv[1])
from bench_machines import fetch_machine
from smach_oracle.testing import Bench, expert, fail, goto, soak
with Bench(fetch_machine(), [fail('PICK', visit=1)], expert=expert(goto('DETECT')),
           settings={'max_recoveries': 0}) as bench:
    bench.run().assert_recovered('PICK')
soak(fetch_machine, trials=2).assert_all_recovered()
ros = {'rospy', 'rosbag', 'rosgraph', 'actionlib', 'genpy', 'smach_ros', 'smach_msgs'}
print('ROS:', sorted(ros & set(sys.modules)))
"""


def test_no_module_of_ros_is_imported():
    path = [os.environ.get('SMACH_UPSTREAM'), os.environ.get('PYTHONPATH'), str(ROOT / 'src')]
    said = subprocess.run(
        [sys.executable, '-c', TRIAL, str(Path(__file__).parent)],
        env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, path))),
        stdout=subprocess.PIPE,
        timeout=60,
        check=True,
    ).stdout.decode()
    assert 'ROS: []' in said
