"""The index of the documentation: where each command's code is, and which pages there are."""

import re

from house import ROOT

from smach_oracle.analysis.compare_command.dispatch import SUBCOMMANDS

INDEX = (ROOT / 'doc/index.md').read_text(encoding='utf-8')


def test_it_says_of_every_command_where_its_code_is():
    told = dict(re.findall(r'^\| `(\w+)` \| `([\w/]+)\.py` \|$', INDEX, re.MULTILINE))
    scripts = {path.name: path.read_text() for path in (ROOT / 'scripts').iterdir()}
    modules = {
        name: re.search(r"^ +run\('([\w.]+)'\)", text, re.MULTILINE)
        for name, text in scripts.items()
    }
    assert told == {
        name: found.group(1).replace('.', '/') for name, found in modules.items() if found
    }
    assert len(told) > 15


def test_it_says_of_every_subcommand_of_compare_where_its_code_is():
    told = dict(
        re.findall(r'^\| `compare (\w+)` \| `analysis/([\w/]+)\.py` \|$', INDEX, re.MULTILINE)
    )
    assert told == {name: each.module.replace('.', '/') for name, each in SUBCOMMANDS.items()}
