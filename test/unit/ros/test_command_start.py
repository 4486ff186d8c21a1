"""What all commands have in common: the version, and an output that nobody reads any more."""

import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from catkin_pkg.changelog import get_changelog_from_path

from smach_oracle import __version__, commands

ROOT = Path(__file__).resolve().parents[3]
COMMANDS = sorted(
    path.name
    for path in (ROOT / 'scripts').iterdir()
    if b'python3' in path.read_bytes().split(b'\n')[0]
)
BAGS = 'test/data/v0_1/trials'


def run(line, **more):
    return subprocess.run(
        ['bash', '-c', line],
        cwd=str(ROOT),
        timeout=60,
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
        **more,
    )


def test_the_manifest_the_package_and_the_change_log_name_one_version():
    manifest = ElementTree.parse(str(ROOT / 'package.xml')).getroot()
    assert manifest.findtext('version') == __version__
    sections = re.findall(
        r'^(\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)\n-+$',
        (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8'),
        re.MULTILINE,
    )
    assert sections[0][0] == __version__
    assert sections == sorted(sections, reverse=True)


def test_setup_py_takes_the_version_of_the_manifest():
    told = run('/usr/bin/env python3 setup.py --version 2>/dev/null')
    assert told.stdout.split()[-1] == __version__


@pytest.mark.parametrize('command', COMMANDS)
def test_a_command_tells_the_version_without_ros(command):
    told = run(
        '{} -S scripts/{} --version'.format(sys.executable, command),
        env={'PYTHONPATH': str(ROOT / 'src'), 'PATH': os.environ['PATH']},
    )
    assert (told.stdout, told.stderr) == (
        '{} of smach_oracle {}\n'.format(command, __version__),
        '',
    )
    assert told.returncode == 0


@pytest.mark.parametrize(
    'line',
    [
        'bag_statistics ' + BAGS,
        'bag_statistics --help',
        'what_if ' + BAGS,
        'learn --help',
        'oracle_disk --keep-gb 1 ' + BAGS,
        'run_trials --plan --protocol all',
        'oracle_run --help',
    ],
)
@pytest.mark.parametrize('what_of_it', ['| true', '2>&1 | true'])
def test_a_command_whose_reader_has_gone_ends_without_a_word(line, what_of_it):
    # the reader has gone before anything is written
    told = run(
        '(sleep 0.3; exec {} scripts/{}) {}; echo "${{PIPESTATUS[0]}}"'.format(
            sys.executable, line, what_of_it
        )
    )
    assert told.stderr == ''
    assert told.stdout == '{}\n'.format(commands.NO_READER)


@pytest.mark.parametrize('line', ['compare_variants none.csv', 'draw_results none out'])
def test_a_file_that_is_not_there_is_named_in_plain_words(line):
    told = run('{} scripts/{}'.format(sys.executable, line))
    assert told.stderr.startswith('{}: {}: '.format(*line.split()[:2])), told.stderr
    assert 'Errno' not in told.stderr and told.returncode == 2


def test_catkins_own_tools_read_the_change_log():
    changes = get_changelog_from_path(str(ROOT))
    versions = [version for version, _, _ in changes.foreach_version()]
    assert versions[-1] == __version__ and changes.get_content_of_version(__version__)
