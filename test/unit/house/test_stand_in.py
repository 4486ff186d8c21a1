"""Upstream's smach is used where it is, ours where it is not: what CMake's search takes for
upstream's.
"""
import os
import subprocess
import sys

import pytest
from house import ROOT

MARKER = '.smach_oracle_stand_in'


def find(*folders, python_path=(), name='smach'):
    env = dict(os.environ, PYTHONPATH=os.pathsep.join(map(str, python_path)))
    # -S: whatever this system has installed must not matter here
    command = [sys.executable, '-S',
               str(ROOT / 'cmake/find_upstream.py'), name] + [str(folder) for folder in folders]
    return subprocess.run(command, env=env, stdout=subprocess.PIPE, check=True,
                          timeout=30).stdout.decode().strip()


@pytest.fixture
def make_package(tmp_path):
    def make(place, name='smach', ours=False):
        folder = tmp_path / place / name
        folder.mkdir(parents=True)
        (folder / '__init__.py').write_text('')
        if ours:
            (folder / MARKER).write_text('')
        return folder.parent
    return make


def test_upstream_on_the_python_path_is_found(make_package):
    upstream = make_package('noetic')
    assert find(python_path=[upstream]) == str(upstream / 'smach')


def test_upstream_in_a_workspace_below_this_one_is_found(make_package):
    upstream = make_package('underlay')
    assert find(upstream) == str(upstream / 'smach')


def test_nothing_is_found_where_there_is_nothing(tmp_path):
    assert find(tmp_path) == ''


def test_what_an_earlier_build_staged_is_not_taken_for_upstream(make_package):
    assert find(python_path=[make_package('devel', ours=True)]) == ''


def test_upstream_behind_our_own_copy_is_found(make_package):
    ours, upstream = make_package('devel', ours=True), make_package('noetic')
    assert find(python_path=[ours, upstream]) == str(upstream / 'smach')


def test_our_sources_are_not_taken_for_upstream():
    assert find(python_path=[ROOT / 'src']) == ''


def test_a_folder_that_happens_to_have_the_name_is_no_package(tmp_path):
    (tmp_path / 'smach').mkdir()
    assert find(python_path=[tmp_path]) == ''


def test_each_package_is_looked_for_on_its_own(make_package):
    upstream = make_package('noetic')
    assert find(python_path=[upstream], name='smach_ros') == ''


def test_upstream_is_not_run_to_be_found(make_package):
    upstream = make_package('noetic')
    (upstream / 'smach' / '__init__.py').write_text('raise RuntimeError("imported")')
    assert find(python_path=[upstream]) == str(upstream / 'smach')
