"""The same tests on upstream's SMACH: a checkout of ros/executive_smach, branch noetic-devel."""

import os
from pathlib import Path
from typing import Dict

# on both engines: the executive, what SMACH does, what attaches a machine to its node, and the kit
# with which users test theirs
UNIT_TESTS = ['oracle', 'ros', 'smach', 'smach_common', 'testing']
# rostests of wrapped machines, and of what smach_ros does; not smach_ros_action_faults, which tests
# what upstream has not: it looks into the links that states of ours share
ROSTESTS = [
    'console_browser',
    'expert_interface',
    'expert_own_script',
    'expert_paused',
    'fault_*',
    'interface_on_demand',
    'oracle_*',
    'pr2_pick_and_place',
    'record_topics',
    'second_robot',
    'smach_ros_action_state',
    'smach_ros_introspection*',
    'smach_ros_states',
    'smach_ros_wrapper',
    'still_running',
    'survive_*',
    'task_recoveries',
    'testing_bench',
]


class UpstreamError(ValueError):
    """A folder is no checkout of executive_smach; the text says what is missing."""


def environment(checkout: Path) -> Dict[str, str]:
    """Variables that put a checkout's smach and smach_ros before ours.

    :raises UpstreamError: where it has no such packages.
    """
    sources = [checkout / name / 'src' for name in ('smach', 'smach_ros')]
    for folder in sources:
        package = folder / folder.parent.name / '__init__.py'
        if not package.is_file():
            raise UpstreamError(
                '{} is missing: give a checkout of the repository '
                'ros/executive_smach, branch noetic-devel'.format(package)
            )
    return {
        'SMACH_UPSTREAM': str(sources[0]),
        'PYTHONPATH': os.pathsep.join(
            [str(folder) for folder in sources] + [os.environ.get('PYTHONPATH', '')]
        ),
        # upstream's modules look for the manifest of smach_ros
        'ROS_PACKAGE_PATH': os.pathsep.join(
            [str(checkout), os.environ.get('ROS_PACKAGE_PATH', '')]
        ),
    }
