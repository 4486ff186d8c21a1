"""Copies of this checkout to build in, and the shells to look at what was built."""

import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LEFT_OUT = ('.git', '.venv*', 'build', '.build', '__pycache__', '*.pyc', '.*_cache')
RESULTS = (ROOT / 'trials', ROOT / 'doc/trials')  # a package of src/ may have that name too
# of each kind one, with the messages that it names
ONE_OF_EACH = ('UserdataItem.msg', 'SeenThing.msg', 'Recognise.srv', 'SharedAutonomy.action')
# what an oracle asks, and hands over
INSTALLED_ACTIONS = ('ExpertQuery.action', 'SharedAutonomy.action')
UPSTREAM_CMAKE = """cmake_minimum_required(VERSION 3.5)
project({0})
find_package(catkin REQUIRED)
catkin_python_setup()
catkin_package()
"""
UPSTREAM_XML = """<?xml version="1.0"?>
<package format="2">
  <name>{0}</name><version>2.5.2</version><description>A fake of the upstream package.</description>
  <maintainer email="nobody@example.org">nobody</maintainer><license>BSD</license>
  <buildtool_depend>catkin</buildtool_depend>
</package>
"""
UPSTREAM_SETUP = """from setuptools import setup
from catkin_pkg.python_setup import generate_distutils_setup
setup(**generate_distutils_setup(packages=['{0}'], package_dir={{'': 'src'}}))
"""


def copy_sources(target: Path) -> Path:
    """Copy the checkout, without what is built or downloaded, to `target`."""
    patterns = shutil.ignore_patterns(*LEFT_OUT)

    def left_out(folder, names):
        results = {each.name for each in RESULTS if str(each.parent) == folder}
        return set(patterns(folder, names)) | results.intersection(names)

    shutil.copytree(str(ROOT), str(target), ignore=left_out)
    return target


def leave_one_of_each(sources: Path) -> None:
    """Take away all messages but one of each kind.

    Each is made by a process of its own, and there are more than a hundred.
    """
    for kind in ('msg', 'srv', 'action'):
        for path in (sources / kind).iterdir():
            if path.name not in ONE_OF_EACH:
                path.unlink()


def leave_few_actions(sources: Path) -> None:
    """Take away most actions: each is seven messages, and two processes for each of these.

    `scripts/setup` has built all of them in this checkout, with the same CMakeLists.txt.
    """
    for path in (sources / 'action').iterdir():
        if path.name not in INSTALLED_ACTIONS:
            path.unlink()


def fake_upstream(source_space: Path, name: str) -> None:
    """Write a catkin package that provides the Python package `name`.

    It is empty, except that it says that it is upstream's.
    """
    python = source_space / name / 'src' / name
    python.mkdir(parents=True)
    (python / '__init__.py').write_text('upstream = True\n')
    for file, text in (
        ('CMakeLists.txt', UPSTREAM_CMAKE),
        ('package.xml', UPSTREAM_XML),
        ('setup.py', UPSTREAM_SETUP),
    ):
        (source_space / name / file).write_text(text.format(name))


def run(command: str, cwd: Path, setup: str = '', timeout_s: float = 300.0) -> str:
    """Run a bash command in a shell without any devel space but the one whose setup.bash is
    `setup`; return its output.

    Raises AssertionError with the output where the command fails.
    """
    own = (
        'CMAKE_PREFIX_PATH',
        'PYTHONPATH',
        'ROS_PACKAGE_PATH',
        'PKG_CONFIG_PATH',
        'LD_LIBRARY_PATH',
    )
    env = {name: value for name, value in os.environ.items() if name not in own}
    # Python is all that these tests look at: headers and Lisp for it would take most of the time
    env['ROS_LANG_DISABLE'] = 'gencpp:genlisp:geneus:gennodejs'
    script = 'set -e; {} {}'.format(
        'source "{}";'.format(setup) if setup else _ros_setup(), command
    )
    result = subprocess.run(
        ['bash', '-c', script],
        cwd=str(cwd),
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=timeout_s,
        check=False,
    )
    output = result.stdout.decode(errors='replace')
    assert result.returncode == 0, '{}\n{}'.format(command, output[-6000:])
    return output


def _ros_setup() -> str:
    noetic = '/opt/ros/noetic/setup.bash'
    return 'source {};'.format(noetic) if os.path.exists(noetic) else ''


PYTHON = '-DPYTHON_EXECUTABLE=/usr/bin/python3'
