"""The message about a missing Python package, and how a command does without one."""

import os
import re
import sys
import sysconfig
from importlib import import_module
from typing import Any

# as doc/install.md says it
VENV = (
    '{} -m venv --system-site-packages ~/ros_venv && . ~/ros_venv/bin/activate && '
    'python3 -m pip install '
)
# module: package, where it has another name
_PACKAGES = {
    'cv2': 'opencv-python-headless',
    'yaml': 'PyYAML',
    'ruamel': 'ruamel.yaml',
    'backports': 'backports.zstd',
}
_OF_ROS = re.compile(r'(ros(?!bags)|smach|actionlib|genpy|tf2_|message_filters)\w*|\w+_(msgs|srvs)')
_PYTHON = frozenset(getattr(sys, 'stdlib_module_names', ()))  # known from 3.10 on
_BUILT = ('smach_oracle.msg', 'smach_oracle.srv')  # of our own, by catkin


def optional(name: str) -> Any:
    """The module of that name, or None where no such package is installed."""
    try:
        return import_module(name)
    except ModuleNotFoundError:
        return None


def lacking(err: ImportError) -> str:
    """Return which package an import lacks and how it is installed, in one line.

    It is '' where no package is missing: where an import fails for another reason, or in this
    package.
    """
    name = err.name or ''
    package = name.split('.')[0]
    ours = package == 'smach_oracle' and name not in _BUILT
    if (
        not isinstance(err, ModuleNotFoundError)
        or not package
        or ours
        or package.startswith('_')
        or package in _PYTHON
    ):
        return ''
    if _OF_ROS.fullmatch(package):
        return (
            'the ROS package {} cannot be imported ({}); build the workspace and source its '
            'setup.bash (in a '
            'checkout: scripts/setup && source scripts/ros_env)'.format(package, err)
        )
    return (
        'the Python package {} cannot be imported ({}); install it: {} (in a checkout: '
        'scripts/setup{})'.format(
            package,
            err,
            _how_to_install(_PACKAGES.get(package, package)),
            # where it has no wheel, scripts/setup alone does without it
            ' --simulation' if package == 'pybullet' else '',
        )
    )


def _how_to_install(package: str) -> str:
    """The command that installs a package of PyPI for this Python."""
    marker = os.path.join(sysconfig.get_path('stdlib'), 'EXTERNALLY-MANAGED')
    if sys.prefix == sys.base_prefix and os.path.exists(marker):
        # pip would refuse: Debian 12, Ubuntu 24.04
        return VENV.format(sys.executable) + package
    return '{} -m pip install {}'.format(sys.executable, package)
