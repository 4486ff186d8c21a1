"""Upstream's smach is used where it is, ours where it is not: which stand-ins go on the paths."""

import os
import shlex
import subprocess
import sys

import pytest
from house import ROOT

MARKER = '.smach_oracle_stand_in'
NAMES = ['control_msgs', 'smach', 'smach_msgs', 'smach_ros']
PATHS = ROOT / 'cmake/stand_in_paths.py'


@pytest.fixture
def prefix(tmp_path):
    """Where a workspace has its stand-ins."""
    folder = tmp_path / 'devel/share/smach_oracle/stand_ins'
    folder.mkdir(parents=True)
    (folder / 'paths.py').write_text(PATHS.read_text())
    return folder


@pytest.fixture
def make_package(tmp_path):
    def make(place, *names, marked=False):
        for name in names or NAMES:
            folder = tmp_path / place / name
            folder.mkdir(parents=True)
            (folder / '__init__.py').write_text('')
            if marked:
                (folder / MARKER).write_text('')
        return str(tmp_path / place)

    return make


def exports(prefix, python_path=(), package_path=()):
    """PYTHONPATH and ROS_PACKAGE_PATH, as lists, that the hook sets."""
    env = dict(
        os.environ,
        PYTHONPATH=os.pathsep.join(python_path),
        ROS_PACKAGE_PATH=os.pathsep.join(package_path),
    )
    # -S: whatever this system has installed must not matter here
    told = subprocess.run(
        [sys.executable, '-S', str(prefix / 'paths.py')],
        env=env,
        check=True,
        stdout=subprocess.PIPE,
        timeout=30,
    ).stdout.decode()
    words = [shlex.split(line)[1].split('=') for line in told.splitlines()]
    assert [name for name, _ in words] == ['PYTHONPATH', 'ROS_PACKAGE_PATH']
    return [[entry for entry in value.split(os.pathsep) if entry] for _, value in words]


def test_where_nothing_of_upstreams_is_there_all_four_come_last(prefix):
    python, packages = exports(prefix, ['/one'], ['/two'])
    assert python == ['/one'] + [str(prefix / name / 'python') for name in NAMES]
    assert packages == ['/two'] + [str(prefix / name / 'share') for name in NAMES]


def test_upstream_on_the_python_path_keeps_ours_off(prefix, make_package):
    upstream = make_package('noetic')
    assert exports(prefix, [upstream], ['/two']) == [[upstream], ['/two']]


def test_each_package_is_looked_for_on_its_own(prefix, make_package):
    upstream = make_package('noetic', 'smach', 'smach_msgs')
    python, packages = exports(prefix, [upstream])
    assert python[1:] == [str(prefix / name / 'python') for name in ('control_msgs', 'smach_ros')]
    assert packages == [str(prefix / name / 'share') for name in ('control_msgs', 'smach_ros')]


def test_once_more_changes_nothing(prefix):
    python, packages = exports(prefix, ['/one'], ['/two'])
    assert exports(prefix, python, packages) == [python, packages]


def test_ours_go_off_the_paths_when_upstream_has_come(prefix, make_package):
    python, packages = exports(prefix)
    upstream = make_package('noetic')
    assert exports(prefix, python + [upstream], packages) == [[upstream], []]


def test_those_of_another_workspace_give_way_to_ours(prefix, tmp_path):
    other = tmp_path / 'underlay/share/smach_oracle/stand_ins/smach/python'
    (other / 'smach').mkdir(parents=True)
    (other / 'smach/__init__.py').write_text('')
    (other / 'smach' / MARKER).write_text('')
    python, _ = exports(prefix, [str(other)])
    assert python == [str(prefix / name / 'python') for name in NAMES]


def test_a_marked_copy_is_not_taken_for_upstream(prefix, make_package):
    copy = make_package('copied', marked=True)
    assert len(exports(prefix, [copy])[0]) == 1 + len(NAMES)


def test_our_sources_are_not_taken_for_upstream(prefix):
    assert len(exports(prefix, [str(ROOT / 'src')])[0]) == 1 + len(NAMES)


def test_a_folder_that_happens_to_have_the_name_is_no_package(prefix, tmp_path):
    (tmp_path / 'checkout/smach').mkdir(parents=True)
    assert str(prefix / 'smach/python') in exports(prefix, [str(tmp_path / 'checkout')])[0]


def test_upstream_is_not_run_to_be_found(prefix, make_package, tmp_path):
    upstream = make_package('noetic', 'smach')
    (tmp_path / 'noetic/smach/__init__.py').write_text('raise RuntimeError("imported")')
    assert str(prefix / 'smach/python') not in exports(prefix, [upstream])[0]


def test_a_path_with_a_quote_and_a_space_in_it_is_kept(prefix):
    assert exports(prefix, ["/it's a folder"])[0][0] == "/it's a folder"
