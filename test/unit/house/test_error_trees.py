"""The trees of errors in two docstrings are those of the classes."""

import ast
import re

import pytest
from house import ROOT, parse, python_files

PACKAGE = ROOT / 'src/smach_oracle'
OWN = PACKAGE / 'oracle/errors.py'
# those of a program, which no user's code calls
OF_PROGRAMS = PACKAGE / 'expert/console'
LINE = re.compile(
    r'^ {4}([| ]*)\+-- (\w+)(?: \(also an? (\w+)\))?(: .+?(?: \(([\w.]+)\))?)?$', re.MULTILINE
)
ROOTS = re.compile(r'^ {4}(\w+)$', re.MULTILINE)


def drawn(path):
    """The classes of a docstring's tree, as {name: (its bases, its module)}."""
    found, around = {}, {}
    for line in ast.get_docstring(parse(path), clean=False).splitlines():
        root, branch = ROOTS.match(line), LINE.match(line)
        if root:
            around = {-1: root.group(1)}
        elif branch:
            at, name, also, text, module = branch.groups()
            base = around[max(depth for depth in around if depth < len(at))]
            around = {depth: each for depth, each in around.items() if depth < len(at)}
            around[len(at)] = name
            if text:  # else it is drawn elsewhere, and stands for those below it
                found[name] = [base] + [also] * bool(also), module
    return found


def classes():
    """The public error classes of the package, as {name: (their bases, their file)}."""
    found = {
        node.name: ([getattr(base, 'id', '') for base in node.bases], path)
        for path in python_files('src/smach_oracle')
        if OF_PROGRAMS not in path.parents
        for node in parse(path).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith('_')
    }
    errors = {name for name, (_, path) in found.items() if path.name == 'errors.py'}
    while True:
        more = {name for name, (bases, _) in found.items() if errors & set(bases)} - errors
        if not more:
            return {name: found[name] for name in sorted(errors)}
        errors |= more


ERRORS = classes()
REST = drawn(PACKAGE / '__init__.py')


def test_the_classes_are_found():
    assert {'OracleError', 'Held', 'ScriptError', 'BagReadError'} <= set(ERRORS)


def test_the_errors_of_the_executive_are_drawn_where_they_stand():
    own = {name: bases for name, (bases, path) in ERRORS.items() if path == OWN}
    assert own.pop('OracleError') == ['Exception']
    assert {name: bases for name, (bases, _) in drawn(OWN).items()} == own


def test_the_other_errors_are_drawn_in_the_docstring_of_the_package():
    others = {name: bases for name, (bases, path) in ERRORS.items() if path != OWN}
    assert {name: bases for name, (bases, _) in REST.items()} == others


@pytest.mark.parametrize('name', sorted(REST))
def test_the_tree_says_where_to_import_a_class_from(name):
    path = PACKAGE / (REST[name][1].replace('.', '/') + '.py')
    assert path == ERRORS[name][1]
