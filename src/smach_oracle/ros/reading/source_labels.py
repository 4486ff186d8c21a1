"""Labels in the sources of a program: those of machines that it makes later.

A label of a machine that does not exist yet stands somewhere in the source, as a word or a text, or
as a text that is filled in: `'PICK'`, `Step.PICK`, `f'PICK_{side}'`, `'PICK_' + side`.
"""

import ast
import os
import re
import sys
from typing import Iterator, List, Set, Tuple

from smach_oracle.oracle.settings.names import matches

# no program's own machines
_OTHERS = ('smach', 'smach_ros', 'smach_common', 'smach_oracle', 'rospy')
# here a file that does not name SMACH has no labels
_INSTALLED = (
    '/opt/ros/',
    '/usr/lib/python',
    '/usr/local/lib/python',
    *(os.path.join(root, 'lib', 'python') for root in (sys.prefix, sys.base_prefix)),
)
_FILLED = re.compile(r'\{[^{}]*\}|%[-+ #0-9.]*[a-zA-Z]')
_ANY = '.*'


def is_in_sources(name: str) -> bool:
    """Whether the sources of this program mention a label, or each label of a path or pattern."""
    texts, forms = _texts_of_program()
    return all(part == '**' or _mentions(part, texts, forms) for part in name.strip('/').split('/'))


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
            if b'smach' not in source and path.startswith(_INSTALLED):
                continue
            texts.update(re.findall(r'\w+', source.decode('utf-8', 'replace')))
            tree = ast.parse(source)
        except (OSError, SyntaxError, ValueError):
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.update((node.value, *node.value.split()))
            waiting += _imported_files(node, path)
            form = _form(node)
            if re.search('[A-Za-z0-9]', form.replace(_ANY, '')) and not isinstance(
                node, ast.Constant
            ):
                forms.add(form)
    return texts, forms


def _loaded_files() -> Iterator[str]:
    for name, module in dict(sys.modules).items():
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
    places = [
        os.path.join(folder, *module.split('.'))
        for folder in folders
        for module in modules
        if module and module.split('.')[0] not in _OTHERS
    ]
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
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        text, verb = getattr(node.func.value, 'value', None), node.func.attr
        if verb == 'join' and isinstance(text, str):
            return re.escape(text).join(
                _form(part) for each in node.args for part in getattr(each, 'elts', [each])
            )
        template = text if verb == 'format' else None
    if not isinstance(template, str):
        return _ANY
    return _ANY.join(re.escape(part) for part in _FILLED.split(template))
