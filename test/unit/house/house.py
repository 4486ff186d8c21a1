"""The source tree, for the tests that hold the house rules."""

import ast
import atexit
import functools
import gc
import re
import subprocess
from pathlib import Path
from typing import Iterator, List, Tuple

atexit.register(gc.unfreeze)  # what `parse` takes from the collector
ROOT = Path(__file__).resolve().parents[3]
SOURCES = ('src', 'scripts', 'test', 'benchmarks', 'examples', 'cmake')
# the commands that catkin also puts into bin/, which is on the PATH
ON_PATH = (
    re.findall(
        r'^foreach\(command([\s\w]+)\)\n  catkin_install_python\(PROGRAMS scripts/\$\{command\} '
        r'DESTINATION \$\{CATKIN_GLOBAL_BIN_DESTINATION\}\)',
        (ROOT / 'CMakeLists.txt').read_text(encoding='utf-8'),
        re.MULTILINE,
    )[0]
).split()


def is_python(path: Path) -> bool:
    """Whether `path` is Python by its suffix or, in scripts/, by its first line."""
    if path.suffix == '.py':
        return True
    return (
        not path.suffix and path.is_file() and b'python' in path.read_bytes()[:40].split(b'\n')[0]
    )


def python_files(*folders: str) -> List[Path]:
    """Every Python file of the checkout, or of the folders given."""
    found = [
        path
        for folder in folders or SOURCES
        for path in sorted((ROOT / folder).rglob('*'))
        if is_python(path)
    ]
    assert found, 'no Python files in {}'.format(folders)
    return found


def tracked_text() -> List[Path]:
    """Every text file of the checkout that git knows."""
    listed = subprocess.run(
        ['git', 'ls-files', '-z'], cwd=str(ROOT), stdout=subprocess.PIPE, check=False
    ).stdout
    names = [name for name in listed.decode().split('\0') if name]
    # an unpacked archive has no git; its sources have the same rule
    paths = [ROOT / name for name in names] or [
        path for folder in SOURCES for path in (ROOT / folder).rglob('*')
    ]
    return [
        path
        for path in paths
        if path.is_file() and path.suffix not in ('.png', '.svg', '.bag', '.pyc')
    ]


def shown(path: Path) -> str:
    """`path` as test ids and messages name it."""
    return str(path.relative_to(ROOT))


@functools.lru_cache(maxsize=None)
def parse(path: Path) -> ast.Module:
    """The syntax tree of `path`, as Python 3.8 reads it; read once, so not to be changed."""
    tree = ast.parse(path.read_text(encoding='utf-8'), shown(path), feature_version=(3, 8))
    gc.freeze()  # the trees stay, and so does most of what is there: no collection looks at it
    return tree


@functools.lru_cache(maxsize=None)
def nodes(path: Path) -> Tuple[ast.AST, ...]:
    """All nodes of the syntax tree of `path`, in the order of ast.walk."""
    return tuple(ast.walk(parse(path)))


@functools.lru_cache(maxsize=None)
def imports(path: Path) -> Tuple[Tuple[int, str], ...]:
    """Every module that `path` imports, anywhere in it, as (line, dotted name); relative names are
    made absolute.

    ``from a import b`` gives ``a.b``: only that tells ``from smach_oracle import ros`` from an
    import of the top.
    """
    return tuple(_imports(path))


def _imports(path: Path) -> Iterator[Tuple[int, str]]:
    parts = path.relative_to(ROOT).with_suffix('').parts[1:]
    for node in nodes(path):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = '.'.join(parts[: len(parts) - node.level]) if node.level else ''
            module = '.'.join(filter(None, [base, node.module]))
            for alias in node.names:
                yield node.lineno, '{}.{}'.format(module, alias.name)
