"""The unit tests under another Python than the one that ROS runs on here.

It has a venv of its own with the lists for Python 3.8, and sees the system's packages behind those:
rospy and its kin are plain Python. What is compiled for the system's Python alone it lacks.
"""

import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path
from typing import Dict, List

LISTS = ['requirements-noetic.txt', 'requirements-noetic-dev.txt']
SYSTEM_PACKAGES = '/usr/lib/python3/dist-packages'
# what no such venv can have: not published for Python 3.8, or compiled for the system's Python.
# Test files that import one of these are left out, and counted.
COMPILED = ['ompl', 'example_robot_data', 'cmeel', 'tf2_py']
MAY_LACK = 'SMACH_ORACLE_MAY_LACK'  # read by test/unit/conftest.py


class InterpreterError(ValueError):
    """A Python that the tests cannot run under; the text says why."""


def _run(command: List[str]) -> str:
    try:
        done = subprocess.run(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            check=False,
            timeout=900,
            env=_plain(),
        )
    except OSError as err:
        raise InterpreterError('{}: {}'.format(command[0], err.strerror)) from err
    text = done.stdout.decode(errors='replace').strip()
    if done.returncode:
        raise InterpreterError(
            '{} ended with {}:\n{}'.format(' '.join(command), done.returncode, text[-2000:])
        )
    return text


def _plain() -> Dict[str, str]:
    return {name: value for name, value in os.environ.items() if not name.startswith('PYTHON')}


def make_venv(root: Path, python: Path) -> Path:
    """The venv's interpreter; the venv is made where it is not there yet.

    :param root: of the checkout.
    :param python: the interpreter that it is made with.
    :raises InterpreterError: where `python` is no Python from 3.8 on, or packages cannot be had.
    """
    told = _run([str(python), '-c', 'import sys; print(*sys.version_info[:3], sep=".")'])
    if tuple(map(int, told.split('.'))) < (3, 8):
        raise InterpreterError('{} is Python {}; allowed: 3.8 or later'.format(python, told))
    venv = root / ('.venv-' + told)
    lists = [root / name for name in LISTS]
    key = sha256(b''.join(each.read_bytes() for each in lists)).hexdigest()
    stamp = venv / 'installed'
    if not stamp.is_file() or stamp.read_text() != key:
        print('Making {} with {}'.format(venv.name, ', '.join(LISTS)))
        sys.stdout.flush()
        _run([str(python), '-m', 'venv', '--clear', str(venv)])
        own = str(venv / 'bin' / 'python')
        _run(
            [own, '-m', 'pip', 'install', '--disable-pip-version-check', '-q']
            + [word for each in lists for word in ('-r', str(each))]
        )
        behind = _run([own, '-c', 'import sysconfig; print(sysconfig.get_path("purelib"))'])
        (Path(behind) / 'zz_system.pth').write_text(SYSTEM_PACKAGES + '\n')
        stamp.write_text(key)
    return venv / 'bin' / 'python'


def environment(python: Path) -> Dict[str, str]:
    """Variables for the tests under the venv's `python`."""
    path = os.pathsep.join([str(python.parent), os.environ['PATH']])
    return {MAY_LACK: ' '.join(COMPILED), 'PATH': path}
