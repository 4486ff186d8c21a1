"""Who may import whom in src/smach_oracle: the tables, and how an import is read against them."""

import re
from typing import Dict, FrozenSet, Iterable, Iterator, List, Set, Tuple, Union

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
Layer = Union[str, Set[str]]
# the packages and modules of a room that has packages, from the top down. Each may import those
# below it alone: names in one set do not know each other.
LAYERS: Dict[str, List[Layer]] = {
    'oracle': [
        'prospects',
        'operator_hand',
        'container',
        'question',
        'execution',
        'checkpoint',
        'branches',
        'recovery',
        'places',
        'machine',
        'control',
        'asking',
        'records',
        'settings',
        'decision',
        'number_checks',
        'background',
        'waiting',
        'identity',
        'errors',
    ],
    'ros': [
        'oracle_run',
        'container',
        'attachment',
        {'recorder', 'expert', 'publishers', 'health', 'hand', 'waiting', 'diagnostics'},
        {'recording', 'interfaces', 'goal_link', 'disk', 'loaded_settings', 'stored'},
        'senders',
        {
            'event_messages',
            'userdata_codec',
            'images',
            'connections',
            'shutdown',
            'parameters',
            'command_line',
            'service_calls',
            'introspection',
            'main_thread',
            'machine_names',
            'goal_tracking',
        },
        {'sendable_text', 'strict_json', 'master_watch', 'reading', 'signals', 'log'},
    ],
    'expert': [
        {'console', 'terminal', 'scripted_expert'},
        'front_end',
        'claims',
        {'followed_server', 'interface_outputs', 'rules', 'wording', 'interface_goal'},
        {'robot_topics', 'stop_calls', 'repeating'},
    ],
    'expert/console': [
        'server',
        'page_socket',
        {'answering', 'robots'},
        'trials',
        'sensors',
        {'graphs', 'feeds', 'commands', 'web'},
    ],
    'interfaces': [{'perception', 'manipulation'}, {'interface_goal', 'priority'}],
    'store': [
        'state_command',
        {'stopped_trial', 'store_writer'},
        'thinning',
        'retention',
        'store_file',
        'opening',
        'accepting',
        'holding',
        'tables',
        'soundness',
        'renaming',
        'rows',
        'codecs',
        {'object_parts', 'errors', 'names'},
    ],
    'pr2': [
        'nodes',
        {'skills', 'ros_robot', 'checks'},
        {'planning', 'pose_teller', 'ros_senses', 'ros_time'},
        {'perception', 'fingers'},
        {'model', 'robot', 'kitchen'},
        'work_costs',
    ],
    'testing': [
        {'script_run', 'soak'},
        {'bench', 'recorded', 'soak_report'},
        'observed_trial',
        {'injection', 'node_side', 'trial_text', 'script'},
        {'faults', 'places'},
        'errors',
    ],
    'simulation': [{'rehearsal', 'node'}, 'pictures', 'physics', 'scenes'],
    'inspection_robot': [{'nodes', 'checks'}, {'world', 'robot'}, {'rays', 'site'}],
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


def members(layers: Iterable[Layer]) -> FrozenSet[str]:
    """All names of some layers."""
    return frozenset(
        name for layer in layers for name in ({layer} if isinstance(layer, str) else layer)
    )
