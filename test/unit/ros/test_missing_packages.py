"""A command that lacks a package says which, and what installs it, in one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from smach_oracle import commands
from smach_oracle.analysis.reading import report_error
from smach_oracle.packages import lacking

SCRIPTS = Path(__file__).resolve().parents[3] / 'scripts'
COMMANDS = sorted(
    path.name for path in SCRIPTS.iterdir() if b'python3' in path.read_bytes().split(b'\n')[0]
)
WITH_BAGS = [
    'bag_statistics',
    'compare oracles',
    'compare same_trials',
    'compare what_if',
    'learn',
    'run_trials',
]
WITH_BODIES = [
    ('pr2_world', 'pybullet'),
    ('pr2_film', 'pybullet'),
    ('pr2_manipulation', 'ompl'),
    ('pr2_perception', 'scipy'),
    ('perception_interface', 'cv2'),
]


def run(folder, command, missing, *arguments):
    """Run a command, such as 'learn' or 'compare oracles', with packages hidden from it."""
    script, *subcommand = command.split()
    hide = 'import sys\nfor name in {!r}: sys.modules[name] = None\n'.format(missing)
    (folder / 'sitecustomize.py').write_text(hide)
    path = os.pathsep.join([str(folder), os.environ.get('PYTHONPATH', '')])
    return subprocess.run(
        [sys.executable, str(SCRIPTS / script), *subcommand, *arguments],
        timeout=60,
        cwd=str(folder),
        env=dict(os.environ, PYTHONPATH=path, ROS_MASTER_URI='http://localhost:1'),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
    )


@pytest.mark.parametrize(
    'command, package', WITH_BODIES + [(name, 'rosbags') for name in WITH_BAGS]
)
def test_the_missing_package_is_told_in_one_line(tmp_path, command, package):
    folders = {
        'compare same_trials': ['.', '.'],
        'run_trials': ['--output', 'out'],
        'pr2_film': ['robot.png'],
    }
    arguments = folders.get(command, ['.'] if command in WITH_BAGS else [])
    (tmp_path / 'x.bag').write_text('')
    told = run(tmp_path, command, [package], *arguments)
    installed_as = {'cv2': 'opencv-python-headless'}.get(package, package)
    (line,) = [
        each for each in told.stderr.splitlines() if not each.startswith('pybullet build time')
    ]
    assert line.startswith('{}: the Python package {} cannot be imported'.format(command, package))
    assert ' -m pip install {} '.format(installed_as) in line and 'scripts/setup' in line
    assert ('scripts/setup --simulation' in line) == (package == 'pybullet')
    assert told.returncode == 2


@pytest.mark.parametrize('command', WITH_BAGS)
def test_help_needs_no_package_that_reads_bags(tmp_path, command):
    told = run(tmp_path, command, ['rosbags', 'matplotlib', 'pybullet', 'ompl', 'cv2'], '--help')
    assert (told.returncode, told.stderr) == (0, '') and 'usage: ' + command in told.stdout


def test_without_ros_the_line_says_what_to_source(tmp_path):
    told = run(tmp_path, 'oracle_run', ['rospy'], 'task.py')
    (line,) = told.stderr.splitlines()
    assert (
        line.startswith('oracle_run: the ROS package rospy')
        and 'setup.bash' in line
        and told.returncode == 2
    )


def test_every_command_starts_in_the_one_way():
    for name in COMMANDS:
        assert 'from smach_oracle.commands import run' in (SCRIPTS / name).read_text(), name


@pytest.mark.parametrize(
    'name, words',
    [
        ('cv2.gapi', 'opencv-python-headless'),
        ('yaml', 'PyYAML'),
        ('rosbags.rosbag1', 'pip install rosbags'),
        ('message_filters', 'setup.bash'),
        ('sensor_msgs.msg', 'setup.bash'),
        ('smach_oracle.msg', 'setup.bash'),
        ('tf2_ros', 'setup.bash'),
    ],
)
def test_packages_have_the_names_that_install_them(name, words):
    assert words in lacking(ModuleNotFoundError('No module named {!r}'.format(name), name=name))


@pytest.mark.parametrize(
    'managed, in_venv, first',
    [
        (True, False, '-m venv --system-site-packages ~/ros_venv && . ~/ros_venv/bin/activate && '),
        (True, True, '-m pip install rosbags'),
        (False, False, '-m pip install rosbags'),
    ],
)
def test_where_pip_refuses_the_line_makes_a_venv_first(
    monkeypatch, tmp_path, managed, in_venv, first
):
    monkeypatch.setattr('sysconfig.get_path', lambda _name: str(tmp_path))
    if managed:
        (tmp_path / 'EXTERNALLY-MANAGED').touch()
    monkeypatch.setattr(sys, 'prefix', '/venv' if in_venv else sys.base_prefix)
    told = lacking(ModuleNotFoundError('no', name='rosbags'))
    assert first in told and told.endswith('pip install rosbags (in a checkout: scripts/setup)')


@pytest.mark.parametrize(
    'err',
    [
        ModuleNotFoundError('broken', name='smach_oracle.oracle.nothing'),
        ModuleNotFoundError('broken'),
        ModuleNotFoundError('broken', name='_curses'),
        ImportError('cannot import name', name='cv2'),
    ],
)
def test_what_no_package_would_cure_is_no_missing_package(err):
    assert lacking(err) == ''


def test_such_an_error_is_raised_where_a_command_starts_and_told_where_bags_are_read(
    monkeypatch, capsys
):
    def broken(name):
        raise ImportError('the C extension is broken')

    monkeypatch.setattr(commands, 'import_module', broken)
    with pytest.raises(ImportError, match='is broken'):
        commands.run('analysis.sweep')
    assert report_error('what_if', ImportError('the C extension is broken')) == 2
    assert capsys.readouterr().err == 'what_if: the C extension is broken\n'
