"""Nodes that are set by parameters say so, with no master to ask, and without packages that not
every robot has.
"""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import List

import pytest

ROOT = Path(__file__).resolve().parents[3]
TWICE = """
import runpy, sys
_, hidden, path = sys.argv
if hidden:
    sys.modules[hidden] = None
for arguments in (['--help', '__name:=other'], ['--nonsense']):
    sys.argv = [path] + arguments
    try:
        runpy.run_path(path, run_name='__main__')
    except SystemExit as end:
        print('ended with', end.code)
"""


def set_by_parameters() -> List[str]:
    """Every node whose command line is `parameters_only`."""
    found = []
    for script in sorted((ROOT / 'scripts').iterdir()):
        module = re.search(r"^    run\('(\S+)'\)$", script.read_text(encoding='utf-8'), re.M)
        if module is None:
            continue
        source = ROOT / 'src/smach_oracle' / (module.group(1).replace('.', '/') + '.py')
        if re.search(r'^    parameters_only\(', source.read_text(encoding='utf-8'), re.M):
            found.append(script.name)
    return found


def run(node: str, hidden: str = '') -> 'subprocess.CompletedProcess[str]':
    """A node asked for help, then called wrongly, where a module `hidden` is not installed."""
    return subprocess.run(
        [sys.executable, '-c', TWICE, hidden, str(ROOT / 'scripts' / node)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
        timeout=60,
        env=dict(os.environ, ROS_MASTER_URI='http://localhost:1'),
    )


def test_the_nodes_are_found():
    assert len(set_by_parameters()) >= 9


@pytest.mark.parametrize('node', set_by_parameters())
def test_help_tells_the_parameters_and_a_wrong_argument_is_named(node: str) -> None:
    told = run(node)
    assert re.findall('ended with .*', told.stdout) == ['ended with 0', 'ended with 2'], told.stderr
    assert 'Parameters: ~' in told.stdout.replace('\n', ' ')
    assert '--nonsense' in told.stderr


@pytest.mark.parametrize(
    'node', ['manipulation_interface', 'expert_console', 'perception_interface']
)
def test_where_there_is_no_pybullet_the_nodes_for_any_robot_still_begin(node: str) -> None:
    told = run(node, hidden='pybullet')
    assert 'ended with 0' in told.stdout, told.stderr
