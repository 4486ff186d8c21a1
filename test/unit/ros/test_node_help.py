"""Nodes that are set by parameters say so, with no master to ask."""
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[3] / 'scripts'


def run(node: str, *arguments: str) -> 'subprocess.CompletedProcess[str]':
    return subprocess.run([sys.executable, str(SCRIPTS / node), *arguments], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True, timeout=60)


@pytest.mark.parametrize('node', ['expert_query_server', 'scripted_expert'])
def test_help_tells_the_parameters_and_a_wrong_argument_is_named(node: str) -> None:
    told = run(node, '--help', '__name:=other')
    assert told.returncode == 0
    assert 'Parameters: ~' in told.stdout
    refused = run(node, '--nonsense')
    assert refused.returncode == 2
    assert '--nonsense' in refused.stderr
