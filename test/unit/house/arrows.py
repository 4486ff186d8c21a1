"""Which room may import which in src/smach_oracle, and how an import is read against the tables.

The layers within a room are contracts of import-linter, in pyproject.toml.
"""

import re
from typing import Dict, Iterable, Iterator, List, Set, Tuple

from house import ROOT, imports, python_files, shown

PACKAGE = ROOT / 'src/smach_oracle'
MESSAGES = {'msg', 'srv'}  # built from ours by catkin
# room, or module of the top: the other rooms, packages and modules that it may import
ARROWS: Dict[str, Set[str]] = {
    'oracle': {'foreign', 'forking', 'store'},
    'store': {'foreign', 'forking'},  # no ROS, no SMACH
    'ros': {
        'oracle.asking',
        'oracle.background',
        'oracle.container',
        'oracle.decision',
        'oracle.errors',
        'oracle.identity',
        'oracle.number_checks',
        'oracle.prospects',
        'oracle.records',
        'oracle.settings',
        'oracle.operator_hand',
        'oracle.OracleContainer',
        'oracle.oracle_of',
        'oracle.waiting',
        'foreign',
        'forking',
        'packages',
        'store',
    },
    'geometry': set(),
    'analysis': {
        'oracle.decision',
        'oracle.errors',
        'oracle.records',
        'oracle.settings',
        'packages',
    },
    'interfaces': {'oracle.asking', 'oracle.errors', 'oracle.settings', 'ros', 'geometry'},
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
        'store',
    },
    'pr2': {'oracle.errors', 'oracle.number_checks', 'oracle.settings', 'ros', 'geometry'},
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
        'forking',
        'packages',
    },
    'tasks': set(),
    'inspection_robot': set(),  # a robot as any ROS user writes it
    # the public face of the executive; ros is imported where a test asks for it
    'testing': {
        'oracle.OracleContainer',
        'oracle.asking',
        'oracle.background',
        'oracle.errors',
        'oracle.identity',
        'oracle.oracle_of',
        'oracle.records',
        'oracle.settings',
        'oracle.unwrap',
        'ros',
    },
    '__init__': {'oracle.OracleContainer', 'ros.container'},
    # it starts modules of the rooms by their names
    'commands': {'documentation', 'packages', '__version__'},
    'documentation': set(),
    'foreign': set(),
    'forking': set(),
    'packages': set(),
}
ROOMS = sorted(path.parent.name for path in PACKAGE.glob('*/__init__.py'))
TOP = sorted(path.stem for path in PACKAGE.glob('*.py'))
# what the executive keeps to itself
INSIDE = {
    'oracle.execution',
    'oracle.checkpoint',
    'oracle.branches',
    'oracle.recovery',
    'oracle.places',
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
    'commands',
    'foreign',
    'forking',
    'packages',
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


def found(folder: str) -> Iterator[Tuple[str, str]]:
    """What a module or the files of a folder import, as (FILE:LINE, dotted name)."""
    module = PACKAGE / (folder + '.py')
    for each in [module] if module.is_file() else python_files('src/smach_oracle/' + folder):
        for line, name in imports(each):
            yield '{}:{}'.format(shown(each), line), name


def ours(folder: str) -> Iterator[Tuple[str, str]]:
    """What they import of smach_oracle, as (FILE:LINE, name within it); '' is the top itself."""
    for where, name in found(folder):
        if below(name, ['smach_oracle']):
            yield where, name[len('smach_oracle.') :]


def told(wrong: Iterable[Tuple[str, str]]) -> List[str]:
    """The wrong imports as messages show them."""
    return ['{} imports {}'.format(where, name or 'smach_oracle') for where, name in wrong]


def needs_ros(name: str) -> bool:
    """Whether a dotted name is a module of ROS, or a message of ours."""
    return bool(OF_ROS.fullmatch(name.split('.')[0])) or below(
        name, ['smach_oracle.' + each for each in MESSAGES]
    )


def needs_engine(name: str) -> bool:
    """Whether a dotted name is a module of SMACH."""
    return bool(ENGINE.fullmatch(name.split('.')[0]))
