"""Which room may import which in src/smach_oracle, and how an import is read against the tables.

The layers within a room are contracts of import-linter, in pyproject.toml. A name within
smach_oracle stands without that word. One of smach_common has its own in front.
"""

import re
from pathlib import Path
from typing import Dict, Iterable, Iterator, List, Set, Tuple

from house import ROOT, imports, python_files, shown

PACKAGE = ROOT / 'src/smach_oracle'
COMMON = 'smach_common'  # what the rooms and the stand-ins share
MESSAGES = {'msg', 'srv'}  # built from ours by catkin
# room, or module of the top: the other rooms, packages and modules that it may import
ARROWS: Dict[str, Set[str]] = {
    'oracle': {'smach_common.foreign', 'forking', 'release', 'store'},
    'store': {'smach_common.foreign', 'forking'},  # no ROS, no SMACH
    'ros': {
        'oracle.asking',
        'oracle.container',
        'oracle.decision',
        'oracle.errors',
        'oracle.identity',
        'oracle.number_checks',
        'oracle.prospects',
        'oracle.records',
        'oracle.scope',
        'oracle.settings',
        'oracle.control',
        'oracle.operator_hand',
        'oracle.under_way',
        'oracle.OracleContainer',
        'oracle.oracle_of',
        'bag_format',
        'forking',
        'packages',
        'renamed_option',
        'smach_common',
        'store',
        'trial_counter',
    },
    'geometry': set(),
    'analysis': {
        'bag_format',
        'cluster',
        'oracle.decision',
        'oracle.errors',
        'oracle.records',
        'oracle.settings',
        'packages',
        'renamed_option',
        'trial_counter',
        'user_cache',
    },
    'interfaces': {
        'oracle.asking',
        'oracle.errors',
        'oracle.settings',
        'ros',
        'geometry',
        'smach_common',
    },
    'expert': {
        'oracle.asking',
        'oracle.errors',
        'oracle.records',
        'oracle.settings',
        'ros',
        'geometry',
        'analysis',
        'interfaces',
        'forking',
        'packages',
        'smach_common',
        'store',
        'trial_counter',
    },
    'pr2': {
        'oracle.errors',
        'oracle.number_checks',
        'oracle.settings',
        'ros',
        'geometry',
        'smach_common',
        'user_cache',
    },
    'simulation': {'oracle.errors', 'oracle.settings', 'ros', 'geometry', 'pr2'},
    'scripted_operator': {
        'oracle.errors',
        'oracle.settings',
        'ros',
        'geometry',
        'expert',
        'interfaces',
    },
    'experiment': {
        'oracle.decision',
        'oracle.errors',
        'oracle.records',
        'oracle.settings',
        'analysis',
        'cluster',
        'forking',
        'packages',
        'renamed_option',
    },
    'tasks': set(),
    'inspection_robot': set(),  # a robot as any ROS user writes it
    # the public face of the executive; ros is imported where a test asks for it
    'testing': {
        'oracle.OracleContainer',
        'oracle.asking',
        'oracle.errors',
        'oracle.identity',
        'oracle.oracle_of',
        'oracle.records',
        'oracle.scope',
        'oracle.settings',
        'oracle.unwrap',
        'ros',
    },
    '__init__': {'oracle.OracleContainer', 'release', 'ros.container'},
    # it starts modules of the rooms by their names
    'commands': {'documentation', 'packages', '__version__'},
    'bag_format': {'oracle.errors'},
    'trial_counter': {'oracle.records', 'oracle.settings'},
    'cluster': {'oracle.errors', 'packages', 'release'},
    'documentation': set(),
    'forking': set(),
    'packages': set(),
    'release': set(),
    'renamed_option': set(),
    'user_cache': set(),
}
ROOMS = sorted(path.parent.name for path in PACKAGE.glob('*/__init__.py'))
TOP = sorted(path.stem for path in PACKAGE.glob('*.py'))
# what the executive keeps to itself
INSIDE = {
    'oracle.execution',
    'oracle.checkpoint',
    'oracle.branches',
    'oracle.recovery',
    'oracle.machine',
}
# what runs where no ROS is installed
ROS_FREE = [
    'oracle',
    'store',
    'geometry',
    'analysis',
    'experiment',
    'pr2/model',
    'pr2/perception',
    'pr2/planning',
    'pr2/skills',
    'simulation/physics',
    'simulation/pictures',
    'simulation/scenes',
    'inspection_robot/world',
    'inspection_robot/robot',
    'bag_format',
    'commands',
    'forking',
    'packages',
    'renamed_option',
    'trial_counter',
    'user_cache',
]
WITH_SMACH = {'oracle', 'ros', 'tasks', 'testing'}
OF_ROS = re.compile(
    r'ros(?!bags)\w*|smach(?:_ros|_msgs)?|actionlib|genpy|tf|tf2_\w+|message_filters|'
    r'\w+_(?:msgs|srvs)'
)
ENGINE = re.compile('smach(?:_ros|_msgs)?')


def below(place: str, names: Iterable[str]) -> bool:
    """Whether a dotted name is one of the names, or within one of them."""
    return (place + '.').startswith(tuple(name + '.' for name in names))


def folder_of(place: str) -> Path:
    """The folder of a place, such as a room; that of a module lacks its suffix."""
    return (PACKAGE.parent if below(place.replace('/', '.'), [COMMON]) else PACKAGE) / place


def found(place: str) -> Iterator[Tuple[str, str]]:
    """What a module or the files of a folder import, as (FILE:LINE, dotted name)."""
    module = folder_of(place).with_suffix('.py')
    folder = str(folder_of(place).relative_to(ROOT))
    for each in [module] if module.is_file() else python_files(folder):
        for line, name in imports(each):
            yield '{}:{}'.format(shown(each), line), name


def ours(place: str) -> Iterator[Tuple[str, str]]:
    """What they import of ours, as (FILE:LINE, name); '' is the top of smach_oracle itself."""
    for where, name in found(place):
        if below(name, ['smach_oracle']):
            yield where, name[len('smach_oracle.') :]
        elif below(name, [COMMON]):
            yield where, name


def told(wrong: Iterable[Tuple[str, str]]) -> List[str]:
    """The wrong imports as messages show them."""
    return ['{} imports {}'.format(where, name or 'smach_oracle') for where, name in wrong]


def needs_ros(name: str) -> bool:
    """Whether a dotted name is a module of ROS, or a message of ours."""
    of_common = below(name, [COMMON]) and not below(name, [COMMON + '.foreign'])
    of_messages = below(name, ['smach_oracle.' + each for each in MESSAGES])
    return of_common or of_messages or bool(OF_ROS.fullmatch(name.split('.')[0]))


def needs_engine(name: str) -> bool:
    """Whether a dotted name is a module of SMACH."""
    return below(name, [COMMON + '.introspection']) or bool(ENGINE.fullmatch(name.split('.')[0]))
