"""The index of the documentation: where each command's code is, and which pages there are."""

import re

from house import ROOT

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
