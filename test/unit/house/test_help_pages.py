"""--help of each command says which page has more. That page is there, and names the command."""

import subprocess
import sys
from pathlib import Path

import pytest
from house import ROOT

from smach_oracle.analysis.compare_command.dispatch import SUBCOMMANDS
from smach_oracle.documentation import PAGES, page_of

CODE = 'lib/python3/dist-packages/smach_oracle/documentation.py'
SCRIPT = "import sys\nprint('the help of the script')\nsys.exit(0)\n"


def printed(*words):
    return subprocess.run(
        [sys.executable, *words], stdout=subprocess.PIPE, timeout=60, check=True
    ).stdout.decode()


def test_every_command_has_a_page():
    commands = {
        path.name
        for path in (ROOT / 'scripts').iterdir()
        if path.read_text().startswith('#!/usr/bin/env python3')
    }
    assert set(PAGES) == commands | {'compare ' + name for name in SUBCOMMANDS}


@pytest.mark.parametrize('command', sorted(PAGES))
def test_the_page_names_the_command(command):
    assert command in (ROOT / 'doc' / (PAGES[command] + '.md')).read_text(encoding='utf-8')


def test_the_help_ends_with_the_version_and_a_page_that_is_there():
    lines = printed(str(ROOT / 'scripts/oracle_state'), '--help').splitlines()
    assert any(line.split()[:1] == ['--version'] for line in lines)
    more, path = lines[-1].split()
    assert more == 'More:' and Path(path).is_file() and Path(path).stem == 'survive'


def test_the_help_of_a_subcommand_ends_with_its_own_page():
    path = printed(str(ROOT / 'scripts/compare'), 'figures', '--help').splitlines()[-1].split()[1]
    assert Path(path).stem == PAGES['compare figures'] != PAGES['compare']


def test_a_script_under_oracle_run_has_its_own_help(tmp_path):
    (tmp_path / 'task.py').write_text(SCRIPT)
    shown = printed(str(ROOT / 'scripts/oracle_run'), str(tmp_path / 'task.py'), '--help')
    assert shown == 'the help of the script\n'


def test_the_site_is_preferred_where_it_is_installed(tmp_path):
    code, doc = tmp_path / CODE, tmp_path / 'share/smach_oracle/doc'
    assert page_of('what_if', code) is None
    (doc / 'html').mkdir(parents=True)
    for name in ('index.md', 'comparing.md'):
        (doc / name).write_text('')
    assert page_of('what_if', code) == doc / 'comparing.md'
    (doc / 'html/comparing.html').write_text('')
    assert page_of('what_if', code) == doc / 'html/comparing.html'
    assert page_of('my_command', code) is None
