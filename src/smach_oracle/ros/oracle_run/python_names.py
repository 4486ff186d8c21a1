"""A check that `python:module:attribute` can be right. It runs nothing of the script's.

A name is refused only where it cannot be there: a module that changes `sys.path`, or that makes
names in other ways than by saying them, is believed until the name is used.
"""

import ast
import os
import sys
from importlib.machinery import ModuleSpec, PathFinder
from typing import Iterator, List, Optional, Sequence, Set

from ..loaded_settings import missing_attribute, split_python_name

_CHANGES_PATH = ('sys.path', 'load_manifest', 'addsitedir', 'import_module', 'exec')
_EXTENDS_PATH = ('__path__', 'extend_path', 'declare_namespace', 'exec')
_MAKES_NAMES = ('exec', 'globals', 'setattr', 'vars', 'locals', '__getattr__', '__dict__')


def check_python_name(script: str, name: str) -> None:
    """Check a name that is used while a script runs.

    :raises ValueError: where the form is wrong, or the module says no such attribute.
    :raises ImportError: where there is no such module.
    """
    module, attributes = split_python_name(name)
    attribute = attributes.split('.')[0]
    if module == '__main__':
        source: Optional[str] = script
    else:
        source = _source_of(script, module, attribute)
    names = _names_in(source) if source else None
    if names is not None and attribute not in names and not names.intersection(_MAKES_NAMES):
        raise ValueError(missing_attribute(module, attribute, names))


def _source_of(script: str, module: str, attribute: str) -> Optional[str]:
    """The file of a module, or None where it has none, or cannot be told to lack the attribute.

    :raises ImportError: where there is no such module.
    """
    if module in sys.modules or module.split('.')[0] in sys.builtin_module_names:
        return None
    path: Optional[Sequence[str]] = [os.path.dirname(os.path.realpath(script))] + sys.path[1:]
    found: Optional[ModuleSpec] = None
    parts = module.split('.')
    for number in range(len(parts)):
        parent, found = found, _find('.'.join(parts[: number + 1]), path)
        if found is None:
            if _changes_path(script) or parent is not None and _extends_path(parent):
                return None
            raise ImportError('No module named {!r}'.format('.'.join(parts[: number + 1])))
        path = found.submodule_search_locations
    if found is None or (path is not None and _find(module + '.' + attribute, path) is not None):
        return None  # a module in a package
    return found.origin if (found.origin or '').endswith('.py') else None


def _find(module: str, path: Optional[Sequence[str]]) -> Optional[ModuleSpec]:
    if path is None:
        return None
    found = PathFinder.find_spec(module, list(path))
    if found is None and '.' not in module:
        found = _found_otherwise(module)
    return found


def _found_otherwise(module: str) -> Optional[ModuleSpec]:
    """Ask other finders, such as those of packages that are installed for development."""
    for finder in sys.meta_path:
        if finder is not PathFinder and hasattr(finder, 'find_spec'):
            found = finder.find_spec(module, None)
            if found is not None:
                return found
    return None


def _extends_path(package: ModuleSpec) -> bool:
    """Whether a package may look for its modules elsewhere, as those of a catkin devel space do."""
    names = _names_in(package.origin or '')
    return names is None or bool(names.intersection(_EXTENDS_PATH))


def _changes_path(script: str) -> bool:
    names = _names_in(script)
    return names is None or bool(names.intersection(_CHANGES_PATH))


def _names_in(source: str) -> Optional[Set[str]]:
    """All names that a file says anywhere, or None where it imports some without saying them."""
    try:
        with open(source, 'rb') as stream:
            tree = ast.parse(stream.read())
    except (OSError, SyntaxError, ValueError):
        return None  # Python tells when it runs
    names: Set[str] = set()
    for node in ast.walk(tree):
        said: List[str] = list(_said(node))
        if '*' in said:
            return None
        names.update(said)
    return names


def _said(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Name):
        yield node.id
    elif isinstance(node, ast.Attribute):
        is_of_sys = isinstance(node.value, ast.Name) and node.value.id == 'sys'
        yield 'sys.path' if is_of_sys and node.attr == 'path' else node.attr
    elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
        yield node.name
    elif isinstance(node, ast.alias):
        yield node.asname or node.name.split('.')[0]
