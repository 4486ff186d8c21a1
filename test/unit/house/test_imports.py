"""What tests, examples and benchmarks import from the package is there."""

import ast
from importlib import import_module
from importlib.util import find_spec

import pytest
from house import ROOT

FOLDERS = ('test', 'examples', 'benchmarks', 'doc')
FILES = sorted(
    path.relative_to(ROOT) for folder in FOLDERS for path in (ROOT / folder).rglob('*.py')
)


def is_there(module, name):
    return hasattr(import_module(module), name) or bool(find_spec(module + '.' + name))


@pytest.mark.parametrize('file', FILES, ids=str)
def test_each_imported_name_is_there(file):
    """A rostest, which runs in a process of its own, would tell it late."""
    found = [
        (node.module, each.name)
        for node in ast.walk(ast.parse((ROOT / file).read_text(encoding='utf-8')))
        if isinstance(node, ast.ImportFrom) and (node.module or '').startswith('smach_oracle')
        for each in node.names
    ]
    assert [pair for pair in found if not is_there(*pair)] == []
