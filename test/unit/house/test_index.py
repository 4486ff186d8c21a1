"""The indexes of the documentation: which commands there are, and where the code of each is."""

import re

from house import ROOT

from smach_oracle.analysis.compare_command.dispatch import SUBCOMMANDS
from smach_oracle.documentation import PAGES

INDEX = (ROOT / 'doc/inside/index.md').read_text(encoding='utf-8')


def test_it_says_of_every_command_where_its_code_is():
    told = dict(re.findall(r'^\| `(\w+)` \| `([\w/]+)\.py` \|$', INDEX, re.MULTILINE))
    scripts = {path.name: path.read_text() for path in (ROOT / 'scripts').iterdir()}
    modules = {
        name: re.search(r"^ +run\('([\w.]+)'[,)]", text, re.MULTILINE)
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


def test_each_command_stands_once_on_the_page_of_users_or_of_the_experiment():
    listed = [
        name
        for page in ('commands', 'experiment')
        for name in re.findall(
            r'^\| `(\w+)` \|', (ROOT / 'doc' / (page + '.md')).read_text('utf-8'), re.MULTILINE
        )
    ]
    renamed = {'compare_oracles', 'compare_variants', 'draw_results', 'same_trials', 'what_if'}
    assert sorted(listed) == sorted({name.split()[0] for name in PAGES} - renamed)
