"""The stand-ins work where smach_oracle cannot be imported."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip('rospy')
import smach_msgs

SRC = Path(__file__).resolve().parents[3] / 'src'
PROGRAM = """
import importlib, pkgutil, sys
import smach, smach_ros, smach_common
for package in (smach, smach_ros, smach_common):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + '.'):
        importlib.import_module(module.name)
try:
    import smach_oracle
    print('smach_oracle is on the path')
except ImportError:
    pass
from actionlib.msg import TestAction
machine = smach.StateMachine(outcomes=['aborted'])
with machine:
    smach.StateMachine.add('ACT', smach_ros.SimpleActionState('act', TestAction),
        {'succeeded': 'COUNT', 'preempted': 'aborted'})
    smach.StateMachine.add('COUNT', smach.CBState(lambda userdata: 'done', outcomes=['done']),
        {'done': 'aborted'})
machine.set_initial_state(['COUNT'])
server = smach_ros.IntrospectionServer('shown', machine, '/SM_ROOT')
client = smach_ros.IntrospectionClient()
print(machine.execute(), [name for name in sys.modules if name.startswith('smach_oracle')])
"""


def test_smach_ros_runs_a_machine_without_the_package_of_the_oracle(tmp_path):
    for name in ('smach', 'smach_ros', 'smach_common'):
        (tmp_path / name).symlink_to(SRC / name)
    (tmp_path / 'smach_msgs').symlink_to(list(smach_msgs.__path__)[0])
    others = [
        folder
        for folder in os.environ.get('PYTHONPATH', '').split(os.pathsep)
        if folder and not (Path(folder) / 'smach_oracle').exists()
    ]
    ended = subprocess.run(
        [sys.executable, '-c', PROGRAM],
        env=dict(os.environ, PYTHONPATH=os.pathsep.join([str(tmp_path), *others])),
        cwd=str(tmp_path),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr.decode()
    assert ended.stdout.decode().strip() == 'aborted []'
