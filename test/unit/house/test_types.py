"""Types that say something: few are `Any`, and nothing is ignored without a reason that mypy
names.
"""

import ast
import re

from house import parse, python_files, shown

PACKAGE = python_files('src/smach_oracle', 'src/smach_common')
MOST_ANY = 0.02  # share of annotations that are exactly Any
MOST_IGNORES = 8


def annotations(tree):
    """Every annotation of a file: parameters, results, variables."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            arguments = node.args
            every = arguments.args + arguments.kwonlyargs + arguments.posonlyargs
            every += [each for each in (arguments.vararg, arguments.kwarg) if each]
            yield from (each.annotation for each in every)
            yield node.returns
        elif isinstance(node, ast.AnnAssign):
            yield node.annotation


def test_few_annotations_are_any():
    found = [
        annotation
        for path in PACKAGE
        for annotation in annotations(parse(path))
        if annotation is not None
    ]
    bare = [each for each in found if isinstance(each, ast.Name) and each.id == 'Any']
    assert len(bare) / len(found) < MOST_ANY, '{} of {} are Any'.format(len(bare), len(found))


def test_every_ignored_error_of_types_is_named():
    lines = [
        '{}:{} {}'.format(shown(path), number, line.strip())
        for path in PACKAGE
        for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), 1)
        if 'type: ignore' in line
    ]
    assert len(lines) <= MOST_IGNORES
    assert not [line for line in lines if not re.search(r'type: ignore\[[a-z-]+', line)]
