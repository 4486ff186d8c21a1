"""doc/inside/executive_inside.md: its tests and functions are there, and so are the writers."""

import ast
import re
from typing import Dict, Iterator, List, Set

import pytest
from house import ROOT, nodes, parse

EXECUTIVE = ROOT / 'src/smach_oracle/oracle'
TESTS = ROOT / 'test/unit/oracle'
PAGE = (ROOT / 'doc/inside/executive_inside.md').read_text(encoding='utf-8')
CITED = sorted(set(re.findall(r'`([\w/]+\.py)::(\w+)`', PAGE)))
FUNCTIONS = sorted(set(re.findall(r'`(\w+)\.(\w+)` \|', PAGE)))  # a module's


def rows_of(first: str) -> List[List[str]]:
    """The rows of the table whose first column has this heading."""
    found = re.search(r'^\| {} \|.*\n\|[-|]+\n((?:\|.*\n)+)'.format(first), PAGE, re.MULTILINE)
    assert found is not None
    return [
        [cell.strip() for cell in line.strip('|').split('|')]
        for line in found.group(1).splitlines()
    ]


WRITTEN = {row[0]: set(re.findall('`([^`]+)`', row[1])) for row in rows_of('written')}
INVARIANTS = [
    row
    for heading in (
        'of a container',
        'of a trial',
        'of a failure',
        'of a question',
        'of a jump',
        'of a stop',
    )
    for row in rows_of(heading)
]


def targets(node: ast.AST) -> Iterator[ast.AST]:
    """What a statement assigns to or deletes."""
    if isinstance(node, (ast.Assign, ast.Delete)):
        yield from node.targets
    elif isinstance(node, (ast.AugAssign, ast.AnnAssign)):
        yield node.target


def written(node: ast.AST) -> Iterator[str]:
    """The names of the attributes that a node assigns to, and of the function that it calls."""
    if isinstance(node, ast.Call):
        yield '{}()'.format(getattr(node.func, 'attr', getattr(node.func, 'id', '')))
    for target in targets(node):
        for each in ast.walk(target):
            if isinstance(each, ast.Attribute) and isinstance(each.ctx, (ast.Store, ast.Del)):
                yield each.attr


def writers() -> Dict[str, Set[str]]:
    """The modules of the executive by what they write."""
    found: Dict[str, Set[str]] = {}
    for path in sorted(EXECUTIVE.rglob('*.py')):
        for node in nodes(path):
            for name in written(node):
                found.setdefault(name, set()).add(str(path.relative_to(EXECUTIVE)))
    return found


WRITERS = writers()


@pytest.mark.parametrize('row', sorted(WRITTEN))
def test_no_module_writes_but_those_of_the_page(row):
    names = re.findall('`([^`]+)`', row)
    assert names and set().union(*(WRITERS.get(name, set()) for name in names)) == WRITTEN[row]


@pytest.mark.parametrize('name, test', CITED)
def test_a_test_that_the_page_names_is_there(name, test):
    assert re.search(
        r'^def {}\('.format(test), (TESTS / name).read_text(encoding='utf-8'), re.MULTILINE
    )


def test_each_invariant_names_a_test_that_sees_it_broken():
    assert len(INVARIANTS) > 25
    assert [row[0] for row in INVARIANTS if not re.search('`[^`]+::[^`]+`', row[1])] == []


def test_the_functions_of_the_page_are_there():
    functions = {
        (path.stem, function.name)
        for path in EXECUTIVE.rglob('*.py')
        for function in parse(path).body
        if isinstance(function, ast.FunctionDef)
    }
    assert len(FUNCTIONS) > 5 and [name for name in FUNCTIONS if name not in functions] == []


def test_no_module_but_its_own_writes_a_field_of_a_tree_node():
    own = EXECUTIVE / 'machine/tree_node.py'
    node = next(each for each in parse(own).body if getattr(each, 'name', '') == 'TreeNode')
    fields = {
        each.attr
        for each in ast.walk(node)
        if isinstance(each, ast.Attribute)
        and isinstance(each.ctx, ast.Store)
        and getattr(each.value, 'id', '') == 'self'
    }
    assert {'records', 'in_force', 'tree'} < fields and len(fields) <= 12
    others = {'self', 'wrapper', 'container', 'twin'}  # objects of other classes
    found = [
        (path.name, each.lineno, each.attr)
        for path in sorted(EXECUTIVE.rglob('*.py'))
        for each in nodes(path)
        if path != own
        and isinstance(each, ast.Attribute)
        and isinstance(each.ctx, (ast.Store, ast.Del))
        and each.attr in fields
        and getattr(each.value, 'id', '') not in others
    ]
    assert found == []


def test_the_meta_state_runs_the_phases_of_the_page_in_its_order():
    (listed,) = (
        [name.id for name in each.value.elts]
        for each in parse(EXECUTIVE / 'recovery/phases.py').body
        if isinstance(each, ast.AnnAssign) and each.target.id == 'PHASES'
    )
    assert listed == [row[1].strip('`').partition('.')[2] for row in rows_of('phase')]
