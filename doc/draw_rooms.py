#!/usr/bin/env python3
"""Draw the rooms of smach_oracle from their imports: doc/images/rooms.dot and rooms.svg.

    python3 doc/draw_rooms.py          # write both; needs graphviz
    python3 doc/draw_rooms.py --print  # print the graph alone

An arrow means "imports". One that follows from two others is left out.
"""

import ast
import subprocess
import sys
from pathlib import Path
from typing import Dict, Iterator, List, Set

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / 'src' / 'smach_oracle'
PICTURE = ROOT / 'doc' / 'images' / 'rooms'
ENGINE = ('smach', 'smach_ros')  # upstream's, or our stand-ins
COMMON = 'smach_common'  # what the rooms and the stand-ins share
Graph = Dict[str, Set[str]]


def rooms() -> List[str]:
    """Return the names of the rooms: the packages of smach_oracle."""
    return sorted(path.parent.name for path in SOURCES.glob('*/__init__.py'))


def modules(path: Path) -> Iterator[str]:
    """Yield the modules that a file imports, as dotted names; relative names are made absolute."""
    package = path.relative_to(ROOT / 'src').with_suffix('').parts
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name
        elif isinstance(node, ast.ImportFrom):
            base = '.'.join(package[: len(package) - node.level]) if node.level else ''
            module = '.'.join(filter(None, [base, node.module]))
            for alias in node.names:
                yield '{}.{}'.format(module, alias.name)


def imports(names: List[str]) -> Graph:
    """Return which rooms each room imports, the engine and what is shared among them."""
    graph: Graph = {}
    for room in names:
        found = [
            name.split('.') for path in (SOURCES / room).rglob('*.py') for name in modules(path)
        ]
        inside = {parts[1] for parts in found if parts[0] == 'smach_oracle'} & set(names)
        graph[room] = (inside | {parts[0] for parts in found} & {*ENGINE, COMMON}) - {room}
    return graph


def reached(graph: Graph, start: str) -> Set[str]:
    """Return all that can be reached from a node."""
    found: Set[str] = set()
    waiting = list(graph.get(start, ()))
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting.extend(graph.get(node, ()))
    return found


def reduced(graph: Graph) -> Graph:
    """Return the graph without the arrows that follow from others."""
    return {
        node: {
            target
            for target in targets
            if not any(target in reached(graph, other) for other in targets - {target})
        }
        for node, targets in graph.items()
    }


def dot() -> str:
    """Return the graph in dot's language."""
    names = rooms()
    lines = ['digraph rooms {', '  rankdir=TB; node [shape=box, fontname="DejaVu Sans"];']
    for room in names:
        packages = sorted(path.parent.name for path in (SOURCES / room).glob('*/__init__.py'))
        below = ''.join(
            '\\n{}'.format(', '.join(packages[at : at + 3])) for at in range(0, len(packages), 3)
        )
        lines.append('  {} [label="{}{}"];'.format(room, room, below))
    lines += ['  {};'.format(COMMON), *('  {} [style=dashed];'.format(name) for name in ENGINE)]
    for room, targets in sorted(reduced(imports(names)).items()):
        lines += ['  {} -> {};'.format(room, target) for target in sorted(targets)]
    return '\n'.join(lines + ['}']) + '\n'


def main() -> int:
    """Draw, or print with --print."""
    text = dot()
    if '--print' in sys.argv[1:]:
        sys.stdout.write(text)
        return 0
    PICTURE.with_suffix('.dot').write_text(text, encoding='utf-8')
    subprocess.run(
        ['dot', '-Tsvg', '-o', str(PICTURE.with_suffix('.svg')), str(PICTURE.with_suffix('.dot'))],
        check=True,
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
