"""Rules for every file: Python 3.8, a few hundred lines, no shortcut that hides an error.

ruff holds further ones: test_ruff.py.
"""

import ast
import collections
import re

from house import ROOT, nodes, python_files, shown, tracked_text

EVERYTHING = python_files()
PRODUCT = python_files('src', 'scripts', 'benchmarks')
MAX_LINES = 500  # of ours: the formatter gives long calls and lists a line for each part


def found(paths, is_wrong):
    """Every node of `paths` that `is_wrong` says yes to, as FILE:LINE."""
    return [
        '{}:{}'.format(shown(path), node.lineno)
        for path in paths
        for node in nodes(path)
        if hasattr(node, 'lineno') and is_wrong(node)
    ]


def test_every_file_is_short():
    lengths = {
        shown(path): len(path.read_text(encoding='utf-8').splitlines()) for path in EVERYTHING
    }
    assert not {name: length for name, length in lengths.items() if length > MAX_LINES}


def test_no_except_catches_everything_unnamed():
    assert not found(
        EVERYTHING, lambda node: isinstance(node, ast.ExceptHandler) and node.type is None
    )


def test_there_is_one_restricted_unpickler_and_it_decides_what_it_admits():
    classes = [
        (path, node)
        for path in PRODUCT
        for node in nodes(path)
        if isinstance(node, ast.ClassDef)
        and any('Unpickler' in ast.dump(base) for base in node.bases)
    ]
    assert [shown(path) for path, _ in classes] == [
        'src/smach_common/introspection/plain_pickle.py'
    ]
    assert 'find_class' in {
        node.name for node in classes[0][1].body if isinstance(node, ast.FunctionDef)
    }


def test_no_argument_has_a_mutable_default():
    def has_one(node):
        if not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            return False
        defaults = node.args.defaults + [default for default in node.args.kw_defaults if default]
        return any(isinstance(default, (ast.List, ast.Dict, ast.Set)) for default in defaults)

    assert not found(EVERYTHING, has_one)


def test_no_two_unit_test_files_have_one_name():
    # pytest collects all of test/unit in one go, without packages
    names = collections.Counter(path.name for path in (ROOT / 'test/unit').rglob('test_*.py'))
    assert not [name for name, count in names.items() if count > 1]


def test_commands_are_executable_and_short():
    for path in python_files('scripts'):
        assert path.stat().st_mode & 0o111, shown(path)
        assert path.read_text().startswith('#!/usr/bin/env python3\n'), shown(path)
        assert len(path.read_text().splitlines()) <= 20, shown(path)


def test_no_file_names_a_place_on_somebodys_machine():
    somewhere = re.compile(r'(?<![\w.$}/-])/(home|root|work|Users|tmp/w)/')
    wrong = [
        '{}:{}'.format(shown(path), number)
        for path in tracked_text()
        for number, line in enumerate(
            path.read_text(encoding='utf-8', errors='replace').splitlines(), 1
        )
        if somewhere.search(line) and path.name != 'test_files.py'
    ]
    assert not wrong
