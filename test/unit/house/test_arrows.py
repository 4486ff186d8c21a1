"""Who may import whom: the executive is free of ROS, the use cases are free of us, the analysis
runs anywhere.
"""

import ast
import collections
import functools
import re
import subprocess
import sys
from pathlib import Path
from typing import Dict, List, Set

import pytest
from arrows import (
    ARROWS,
    COMMON,
    INSIDE,
    MESSAGES,
    OF_ROS,
    PACKAGE,
    ROOMS,
    ROS_FREE,
    TOP,
    WITH_SMACH,
    below,
    folder_of,
    found,
    needs_engine,
    needs_ros,
    ours,
    told,
)
from house import ROOT, imports, nodes, python_files, shown
from layers import LAYERS

MAX_MODULES = 20  # in a package, its __init__ not counted
ROS = {
    'rospy',
    'actionlib',
    'rosbag',
    'rosgraph',
    'roslib',
    'genpy',
    'rospkg',
    'smach_ros',
    'smach_msgs',
}
STAND_INS = {'smach', 'smach_ros', 'smach_msgs', 'control_msgs'}
PINNED = {
    'cv2': 'opencv-python-headless',
    'ompl': 'ompl',
    'pybullet': 'pybullet',
    'rosbags': 'rosbags',
}
OPTIONAL = {'pandas'}  # a user asks for it by its own call
STDLIB = getattr(sys, 'stdlib_module_names', frozenset())

without_stdlib_names = pytest.mark.skipif(
    not STDLIB, reason='Python before 3.10 cannot list its own modules'
)


def imported_by(room: str) -> Set[str]:
    return {name for path in python_files('src/smach_oracle/' + room) for _, name in imports(path)}


@pytest.mark.parametrize('place', ROOMS + TOP)
def test_a_room_imports_only_what_it_may(place):
    own = {place} | (MESSAGES if place in ROOMS else set())
    wrong = [(where, name) for where, name in ours(place) if not below(name, ARROWS[place] | own)]
    assert not told(wrong)


def test_every_room_and_module_of_the_top_has_its_arrows():
    assert set(ROOMS) | set(TOP) == set(ARROWS)


@pytest.mark.parametrize('room', [room for room in ROOMS if room != 'oracle'])
def test_the_executive_keeps_its_inside_to_itself(room):
    assert not told((where, name) for where, name in ours(room) if below(name, INSIDE))


@pytest.mark.parametrize('folder', ROS_FREE)
def test_what_is_free_of_ros_imports_none(folder):
    # SMACH itself needs no ROS
    assert not told(
        (where, name)
        for where, name in found(folder)
        if needs_ros(name) and not (folder == 'oracle' and below(name, ['smach']))
    )


@pytest.mark.parametrize('room', [room for room in ROOMS if room not in WITH_SMACH])
def test_smach_is_known_where_machines_are_run_alone(room):
    # the console shows the machines that smach_msgs speak of
    assert not told(
        (where, name)
        for where, name in found(room)
        if needs_engine(name) and not (room == 'expert' and below(name, ['smach_msgs']))
    )


def test_every_room_that_has_packages_has_its_layers():
    there = {path.parent.parent for path in PACKAGE.glob('*/*/__init__.py')}
    packages = {'.'.join(path.relative_to(ROOT / 'src').parts) for path in there}
    # in analysis, the one package is drawing
    assert packages - set(LAYERS) == {'smach_oracle.analysis'}


def test_no_package_has_too_many_modules():
    counts = collections.Counter(
        path.parent for path in python_files('src') if path.name != '__init__.py'
    )
    assert not {str(folder): count for folder, count in counts.items() if count > MAX_MODULES}


@pytest.mark.parametrize(
    'room',
    [
        'oracle',
        'ros',
        'tasks',
        'expert',
        'geometry',
        'interfaces',
        'pr2',
        'inspection_robot/robot',
        'scripted_operator',
    ],
)
def test_neither_executive_nor_task_nor_subsystem_nor_expert_asks_for_the_truth_or_its_causes(room):
    for path in python_files('src/smach_oracle/' + room):
        found = re.findall(
            r'\b(?:Reveal|RevealedBody|Judge|TrialCause)\b|world/(?:reveal|judge|cause)|truth_file',
            path.read_text(encoding='utf-8'),
        )
        assert not found, '{} speaks of {}'.format(shown(path), found)


def modules_of(room: str) -> Dict[str, Path]:
    """The modules of a room by dotted name; a package goes by its own."""
    named = {
        path.relative_to(ROOT / 'src').with_suffix('').parts: path
        for path in python_files(shown(folder_of(room)))
    }
    return {
        '.'.join(parts[:-1] if parts[-1] == '__init__' else parts): path
        for parts, path in named.items()
    }


def module_of(name: str, modules: Dict[str, Path]) -> str:
    """The longest part of a dotted name that is a module, '' where none is."""
    while name and name not in modules:
        name = name.rpartition('.')[0]
    return name


@functools.lru_cache(maxsize=None)
def for_types_alone(path: Path) -> Set[int]:
    """The lines under `if TYPE_CHECKING`, which are not run."""
    return {
        inner.lineno
        for node in nodes(path)
        if isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == 'TYPE_CHECKING'
        for inner in node.body
    }


def circle_in(graph: Dict[str, Set[str]]) -> List[str]:
    """The nodes of a graph that lie on a circle or lead to one, sorted."""
    left = {node: set(targets) for node, targets in graph.items()}
    while True:
        leaves = {node for node, targets in left.items() if not targets & set(left)}
        if not leaves:
            return sorted(left)
        left = {node: targets for node, targets in left.items() if node not in leaves}


@pytest.mark.parametrize('room', [COMMON, *ROOMS])
def test_no_modules_of_a_room_import_each_other_in_a_circle(room):
    modules = modules_of(room)
    graph = {
        name: {
            module_of(target, modules)
            for line, target in imports(path)
            if line not in for_types_alone(path)
        }
        - {'', name}
        for name, path in modules.items()
    }
    assert not circle_in(graph)


def test_a_circle_of_imports_is_noticed():
    assert circle_in({'a': {'b'}, 'b': {'c'}, 'c': {'b'}, 'd': set()}) == ['a', 'b', 'c']


@without_stdlib_names
def test_the_executive_needs_smach_and_python_alone():
    outside = {name.split('.')[0] for name in imported_by('oracle')} - STDLIB
    # of smach_common its look at foreign objects alone: see ARROWS
    assert outside <= {'smach', 'smach_common', 'smach_oracle'}
    assert not {
        name
        for name in imported_by('oracle')
        if name.startswith(('smach_oracle.msg', 'smach_oracle.srv'))
    }


@without_stdlib_names
def test_the_engine_needs_python_alone():
    assert {
        name.split('.')[0] for path in python_files('src/smach') for _, name in imports(path)
    } - STDLIB <= {'smach'}


@pytest.mark.parametrize('package', ['smach', 'smach_ros', COMMON])
def test_the_stand_ins_and_what_they_build_on_know_nothing_of_the_oracle(package):
    allowed = {'smach': set(), 'smach_ros': {'smach', COMMON}, COMMON: {'smach'}}[package]
    for path in python_files('src/' + package):
        own = {name.split('.')[0] for _, name in imports(path)} & {*STAND_INS, COMMON}
        assert own <= allowed | {package, 'smach_msgs'}, shown(path)
        # nor by a name in a text, as import_module takes it
        assert 'smach_oracle.' not in path.read_text(encoding='utf-8'), shown(path)
        assert not [name for _, name in imports(path) if below(name, ['smach_oracle'])]


def test_the_use_cases_are_scripts_as_any_smach_user_writes_them():
    of_ours = {name for name in imported_by('tasks') if name.startswith('smach_oracle')}
    messages = ['smach_oracle.' + each for each in MESSAGES]
    assert all(below(name, messages) for name in of_ours), of_ours


def test_the_analysis_runs_where_neither_ros_nor_smach_is_installed():
    modules = [
        '.'.join(path.relative_to(ROOT / 'src').with_suffix('').parts).replace('.__init__', '')
        for path in python_files('src/smach_oracle/analysis')
    ]
    program = (
        'import sys\nsys.path.insert(0, {!r})\n'
        'for name in {!r}: sys.modules[name] = None\nimport {}\n'
    ).format(str(ROOT / 'src'), sorted(ROS | {'smach'}), ', '.join(modules))
    result = subprocess.run(
        [sys.executable, '-c', program],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=60,
        check=False,
    )
    assert result.returncode == 0, result.stdout.decode()


def test_every_ros_package_that_is_imported_is_a_declared_dependency():
    manifest = (ROOT / 'package.xml').read_text(encoding='utf-8')
    used = {
        name.split('.')[0]
        for path in python_files('src', 'scripts', 'test')
        for _, name in imports(path)
    }
    # rospkg comes with roslib, and is not a ROS package itself
    packages = {name for name in used if OF_ROS.fullmatch(name)} - {'rospkg'}
    assert packages == {name for name in packages if 'depend>{}<'.format(name) in manifest}


@without_stdlib_names
def test_everything_that_is_imported_is_set_up_on_debian():
    lists = [ROOT / name for name in ('debian-packages.txt', 'requirements.txt')]
    there = {
        re.split('[=<]', line.split()[0])[0]
        for path in lists
        for line in path.read_text(encoding='utf-8').splitlines()
        if line and not line.startswith('#')
    }
    used = {name.split('.')[0] for path in python_files('src') for _, name in imports(path)}
    missing = {
        name
        for name in used - STDLIB - STAND_INS - OPTIONAL - {COMMON, 'smach_oracle'}
        if PINNED.get(name, 'python3-' + name.replace('_', '-')) not in there
    }
    assert not missing
