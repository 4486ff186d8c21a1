"""Print what puts our stand-ins on the paths, for each package of upstream's that is absent.

`eval "$(python3 paths.py)"`, as the hook 50.stand_ins.sh does. Each stand-in has a prefix of its
own beside this file: NAME/python and NAME/share. They come last in PYTHONPATH and ROS_PACKAGE_PATH.
Where Python finds a package of that name elsewhere, on PYTHONPATH or among the system's packages,
its stand-in stays off the paths: it would come before the system's.

A copy with the marker is a stand-in, ours or that of another workspace, and does not count. A
folder without `__init__.py` (a checkout that happens to be named `smach`) is no package either.
Nothing is imported: the real smach_ros would pull in rospy.
"""

import importlib.util
import os
import re
import shlex
import sys

NAMES = ('control_msgs', 'smach', 'smach_msgs', 'smach_ros')
MARKER = '.smach_oracle_stand_in'
OF_STAND_INS = re.compile(
    r'/smach_oracle/stand_ins/(?:{})/(?:python|share)/?$'.format('|'.join(NAMES))
)


def find_upstream(name: str) -> str:
    """Return the folder that holds the upstream package `name`, or an empty string."""
    whole = list(sys.path)
    # sys.path[0] is the folder of this file
    sys.path[:] = [
        folder
        for folder in whole[1:]
        if folder and not os.path.exists(os.path.join(folder, name, MARKER))
    ]
    try:
        spec = importlib.util.find_spec(name)
    finally:
        sys.path[:] = whole
    if spec is None or spec.origin is None or not os.path.isfile(spec.origin):
        return ''
    return os.path.dirname(spec.origin)


def exports(folder: str) -> str:
    """Lines for a shell: both paths without any stand-ins, then with those that are needed."""
    absent = [name for name in NAMES if not find_upstream(name)]
    lines = []
    for variable, kind in (('PYTHONPATH', 'python'), ('ROS_PACKAGE_PATH', 'share')):
        entries = [
            entry
            for entry in os.environ.get(variable, '').split(os.pathsep)
            if entry and not OF_STAND_INS.search(entry)
        ]
        entries += [os.path.join(folder, name, kind) for name in absent]
        lines.append('export {}={}'.format(variable, shlex.quote(os.pathsep.join(entries))))
    return '\n'.join(lines)


if __name__ == '__main__':
    print(exports(os.path.dirname(os.path.abspath(__file__))))
