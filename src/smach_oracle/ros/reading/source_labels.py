"""Labels in the sources of a program: those of machines that it makes later.

A label of a machine that does not exist yet stands somewhere in the source, whole or as a text that
is filled in: `'PICK'`, `f'PICK_{side}'`, `'PICK_%d' % number`, `'PICK_' + side`.
"""
import ast
import os
import re
import sys
from typing import Iterator, List, Set, Tuple

from smach_oracle.oracle.settings.patterns import matches

_OTHERS = ('smach', 'smach_ros', 'smach_oracle', 'rospy')  # no program's own machines
_FILLED = re.compile(r'\{[^{}]*\}|%[-+ #0-9.]*[a-zA-Z]')
_ANY = '.*'


def is_in_sources(name: str) -> bool:
    """Whether the sources of this program mention a label, or each label of a path or pattern."""
    texts, forms = _texts_of_program()
    return all(part == '**' or _mentions(part, texts, forms)
               for part in name.strip('/').split('/'))


def _mentions(label: str, texts: Set[str], forms: Set[str]) -> bool:
    if '*' in label:
        return any(matches(label, text) for text in texts | forms)
    return label in texts or any(re.fullmatch(form, label, re.DOTALL) for form in forms)


def _texts_of_program() -> Tuple[Set[str], Set[str]]:
    """Return the texts in all sources, and the regular expressions of those that are filled in."""
    texts: Set[str] = set()
    forms: Set[str] = set()
    waiting, read = list(_loaded_files()), set()
    while waiting:
        path = os.path.realpath(waiting.pop())
        if path in read:
            continue
        read.add(path)
        try:
            with open(path, 'rb') as stream:
                source = stream.read()
            tree = ast.parse(source) if b'smach' in source else None
        except (OSError, SyntaxError, ValueError):
            continue
        for node in ast.walk(tree) if tree is not None else ():
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.add(node.value)
            waiting += _imported_files(node, path)
            form = _form(node)
            if re.search('[A-Za-z0-9]', form.replace(_ANY, '')) and _ANY in form:
                forms.add(form)
    return texts, forms


def _loaded_files() -> Iterator[str]:
    for name, module in list(sys.modules.items()):
        path = getattr(module, '__file__', None)
        if name.split('.')[0] not in _OTHERS and isinstance(path, str) and path:
            yield path


def _imported_files(node: ast.AST, path: str) -> List[str]:
    """Return where the modules may be that an import statement names."""
    if isinstance(node, ast.Import):
        modules, folders = [alias.name for alias in node.names], sys.path
    elif isinstance(node, ast.ImportFrom):
        stem = (node.module or '') + '.'
        modules = [node.module or ''] + [(stem + alias.name).strip('.') for alias in node.names]
        above = path
        for _ in range(node.level):
            above = os.path.dirname(above)
        folders = [above] if node.level else sys.path
    else:
        return []
    places = [os.path.join(folder, *module.split('.')) for folder in folders for module in modules
              if module and module.split('.')[0] not in _OTHERS]
    found = [place + ending for place in places for ending in ('.py', '/__init__.py')]
    return [each for each in found if os.path.isfile(each)]


def _form(node: ast.AST) -> str:
    """Return the regular expression of the texts that an expression may give."""
    if isinstance(node, ast.Constant):
        return re.escape(node.value) if isinstance(node.value, str) else _ANY
    if isinstance(node, ast.JoinedStr):
        return ''.join(_form(part) for part in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _form(node.left) + _form(node.right)
    template: object = None
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod):
        template = getattr(node.left, 'value', None)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and (
            node.func.attr == 'format'):
        template = getattr(node.func.value, 'value', None)
    if not isinstance(template, str):
        return _ANY
    return _ANY.join(re.escape(part) for part in _FILLED.split(template))
