"""Who may import whom: the executive is free of ROS, the use cases are free of us, the analysis runs anywhere."""
import re
import subprocess
import sys
from typing import Set

import pytest
from house import ROOT, imports, python_files, shown

ROOMS = ('oracle', 'ros', 'expert', 'simulation', 'tasks', 'analysis', 'geometry')
INTERFACES = {'msg', 'srv'}
# room: the other rooms that it may import
ARROWS = {
    'oracle': set(),
    'ros': {'oracle'},
    'expert': {'oracle', 'ros', 'geometry', 'analysis'},
    'simulation': {'oracle', 'ros', 'analysis', 'geometry', 'expert'},
    'geometry': set(),
    'tasks': set(),
    'analysis': {'oracle'},
}
ROS = {'rospy', 'actionlib', 'rosbag', 'rosgraph', 'roslib', 'genpy', 'rospkg', 'smach_ros', 'smach_msgs'}
ROS_PACKAGES = ROS - {'rospkg'} | {'smach', 'actionlib_msgs', 'control_msgs', 'geometry_msgs', 'move_base_msgs',
                                   'rosgraph_msgs', 'roslaunch', 'rosservice', 'rostest', 'sensor_msgs', 'std_msgs',
                                   'std_srvs', 'tf2_msgs', 'tf2_ros', 'trajectory_msgs', 'visualization_msgs'}
STAND_INS = {'smach', 'smach_ros', 'smach_msgs', 'control_msgs'}
PINNED = {'cv2': 'opencv-python-headless', 'ompl': 'ompl', 'pybullet': 'pybullet', 'rosbags': 'rosbags'}
STDLIB = getattr(sys, 'stdlib_module_names', frozenset())

without_stdlib_names = pytest.mark.skipif(not STDLIB, reason='Python before 3.10 cannot list its own modules')


def imported_by(room: str) -> Set[str]:
    return {name for path in python_files('src/smach_oracle/' + room) for _, name in imports(path)}


@pytest.mark.parametrize('room', ROOMS)
def test_a_room_imports_only_the_rooms_that_it_may(room):
    wrong = []
    for path in python_files('src/smach_oracle/' + room):
        for line, name in imports(path):
            parts = name.split('.')
            if parts[0] == 'smach_oracle' and parts[1] not in ARROWS[room] | INTERFACES | {room}:
                wrong.append('{}:{} imports {}'.format(shown(path), line, name))
    assert not wrong


def test_no_subsystem_of_the_robot_can_read_the_truth_of_the_world():
    for path in python_files('src/smach_oracle/simulation/robot'):
        wrong = [name for _, name in imports(path)
                 if name.startswith('smach_oracle.simulation.') and name.split('.')[2] != 'robot']
        assert not wrong, '{} imports {}'.format(shown(path), wrong)


@pytest.mark.parametrize('room', ['oracle', 'ros', 'tasks', 'expert', 'geometry', 'simulation/robot'])
def test_neither_executive_nor_task_nor_subsystem_asks_for_the_truth_or_its_causes(room):
    for path in python_files('src/smach_oracle/' + room):
        found = re.findall(r'\b(?:Reveal|RevealedBody|Judge|TrialCause)\b|world/(?:reveal|judge|cause)|truth_file',
                           path.read_text(encoding='utf-8'))
        assert not found, '{} speaks of {}'.format(shown(path), found)


def test_every_room_is_known_here():
    folders = {path.parent.name for path in (ROOT / 'src/smach_oracle').glob('*/__init__.py')}
    assert folders == set(ROOMS)


@without_stdlib_names
def test_the_executive_needs_smach_and_python_alone():
    outside = {name.split('.')[0] for name in imported_by('oracle')} - STDLIB
    assert outside <= {'smach', 'smach_oracle'}
    assert not {name for name in imported_by('oracle') if name.startswith(('smach_oracle.msg', 'smach_oracle.srv'))}


@without_stdlib_names
def test_the_engine_needs_python_alone():
    assert {name.split('.')[0] for path in python_files('src/smach') for _, name in imports(path)} - STDLIB <= {'smach'}


def test_the_engine_knows_nothing_of_the_oracle():
    for package in ('smach', 'smach_ros'):
        for path in python_files('src/' + package):
            assert not [name for _, name in imports(path) if name.startswith('smach_oracle')], shown(path)


def test_the_analysis_names_neither_ros_nor_smach():
    assert not {name.split('.')[0] for name in imported_by('analysis')} & (ROS | {'smach'})


def test_the_use_cases_are_scripts_as_any_smach_user_writes_them():
    of_ours = {name for name in imported_by('tasks') if name.startswith('smach_oracle')}
    assert all(name.split('.')[1] in INTERFACES for name in of_ours), of_ours


def test_the_analysis_runs_where_neither_ros_nor_smach_is_installed():
    modules = ['.'.join(path.relative_to(ROOT / 'src').with_suffix('').parts).replace('.__init__', '')
               for path in python_files('src/smach_oracle/analysis')]
    program = 'import sys\nsys.path.insert(0, {!r})\nfor name in {!r}: sys.modules[name] = None\nimport {}\n'.format(
        str(ROOT / 'src'), sorted(ROS | {'smach'}), ', '.join(modules))
    result = subprocess.run([sys.executable, '-c', program], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                            timeout=60, check=False)
    assert result.returncode == 0, result.stdout.decode()


def test_every_ros_package_that_is_imported_is_a_declared_dependency():
    manifest = (ROOT / 'package.xml').read_text(encoding='utf-8')
    used = {name.split('.')[0] for path in python_files('src', 'scripts', 'test') for _, name in imports(path)}
    # rospkg comes with roslib, and is no ROS package itself
    declared = {name for name in used & ROS_PACKAGES if 'depend>{}<'.format(name) in manifest}
    assert used & ROS_PACKAGES == declared


@without_stdlib_names
def test_everything_that_is_imported_is_set_up_on_debian():
    lists = [ROOT / name for name in ('debian-packages.txt', 'requirements.txt')]
    there = {re.split('[=<]', line.split()[0])[0] for path in lists
             for line in path.read_text(encoding='utf-8').splitlines() if line and not line.startswith('#')}
    used = {name.split('.')[0] for path in python_files('src') for _, name in imports(path)}
    missing = {name for name in used - STDLIB - STAND_INS - {'smach_oracle'}
               if PINNED.get(name, 'python3-' + name.replace('_', '-')) not in there}
    assert not missing
