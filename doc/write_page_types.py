#!/usr/bin/env python3
"""Write the shapes of what the console sends for the page's scripts, from the types in Python.

    python3 doc/write_page_types.py          # write js/server.d.ts
    python3 doc/write_page_types.py --check  # say whether it is up to date

The types stand in src/smach_oracle/expert/console/shapes/, and those of graphs in
src/smach_oracle/analysis/graphs/drawn_graph.py. A class loses its `View`, and a base whose name
begins with an underscore becomes a part of each class that has it.
"""

import ast
import sys
import textwrap
from pathlib import Path
from typing import Dict, Iterable, Iterator, List, NamedTuple, Tuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'src'))

from smach_oracle.expert.console.commands.commands import KINDS  # noqa: E402
from smach_oracle.expert.console.commands.driving import FRAMES, GRIPPER  # noqa: E402
from smach_oracle.expert.console.commands.marking import AT_GOAL, FRESH  # noqa: E402
from smach_oracle.expert.console.web.access import ROLES  # noqa: E402
from smach_oracle.oracle.decision.failure_rate import FailureClass  # noqa: E402
from smach_oracle.oracle.records.events import EventKind  # noqa: E402
from smach_oracle.oracle.settings.failure_rule import EndMeaning  # noqa: E402
from smach_oracle.trial_counter import TrialEnding  # noqa: E402

CONSOLE = ROOT / 'src/smach_oracle/expert/console'
SHAPES = CONSOLE / 'shapes'
SOURCES = [
    *(SHAPES / (name + '.py') for name in ('basics', 'page', 'questions', 'robots')),
    ROOT / 'src/smach_oracle/analysis/graphs/drawn_graph.py',
    *(SHAPES / (name + '.py') for name in ('trials', 'sensors', 'people', 'commands')),
]
TARGET = CONSOLE / 'static/js/server.d.ts'
WIDTH = 100
HEAD = """\
// What the server sends, and what the page does: every shape of JSON. Written by
// doc/write_page_types.py from the types in shapes/. test/unit/expert/console/test_console_types.py
// compares both with what the server does.
// Times are seconds since the epoch, lengths metres, unless something else is written beside them.

export as namespace server;

/** A reply, by the name of its command: `data` is there for those that hold more than words. */
export interface Reply<Name extends keyof Commands = keyof Commands> {
  re: number; // the command's number
  ok: boolean;
  message: string;
  data?: Name extends keyof ReplyData ? ReplyData[Name] : never;
}
export interface ReplyData { hello: HelloData; mark: Marked; take_wheel: WheelData }
"""
PLAIN = {
    'str': 'string',
    'int': 'number',
    'float': 'number',
    'bool': 'boolean',
    'None': 'null',
    'object': 'unknown',  # plain data of any kind
}


def words(values: Iterable[object]) -> str:
    """Return a closed set of values."""
    return ' | '.join(str(each) if isinstance(each, int) else quoted(str(each)) for each in values)


def quoted(text: str) -> str:
    """Return a text as a script has it."""
    return "'{}'".format(text)


# aliases of Python whose values are named by constants or enumerations
CLOSED = {
    'Role': words(ROLES),
    'DriveFrame': words(FRAMES),
    'AnswerKind': words(KINDS),
    'ImageFrame': words((AT_GOAL, FRESH)),
    'GripperWish': words(GRIPPER),
    'OutcomeMeaning': words(each.value for each in EndMeaning),
    'TrialEnd': words([each.value for each in TrialEnding] + ['']),
    'EventName': words(each.name.lower() for each in EventKind) + ' | `${number}`',
    'FailureClass': words(int(each) for each in FailureClass),
    'SomeSections': '{ [Name in keyof Sections]?: Sections[Name] | null }',
}


class Field(NamedTuple):
    """A field of a shape."""

    name: str
    type: str
    optional: bool
    above: List[str]  # comments
    beside: str  # a comment, '' for none


class Shape(NamedTuple):
    """A class of Python."""

    text: str  # what it is
    extends: List[str]
    fields: List[Field]


class Module:
    """A module of types, read as text, since Python forgets its comments and its bases."""

    def __init__(self, path: Path, known: Dict[str, Shape]) -> None:
        """`known`: the classes of the modules before it. This one's are added."""
        self._lines = path.read_text('utf-8').splitlines()
        self._known = known
        self._begun = False  # whether something is above
        self.tree = ast.parse('\n'.join(self._lines))

    def text(self) -> Iterator[str]:
        """Give each declaration, in order."""
        for node in self.tree.body:
            if isinstance(node, ast.ClassDef):
                shape = self._shape(node)
                yield from self._declared(node.name, shape)
            elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                yield from self._assigned(node, node.targets[0].id)

    def _assigned(self, node: ast.Assign, name: str) -> Iterator[str]:
        value = node.value
        if isinstance(value, ast.Call):
            if isinstance(value.func, ast.Name) and value.func.id == 'TypedDict':
                shape = Shape(' '.join(self._above(node.lineno)), [], list(self._items(value)))
                yield from self._declared(name, shape)
            return
        self._begun = True
        beside = self._beside(node.lineno)
        for line in self._above(node.lineno):
            yield '// ' + line
        if any(isinstance(each, ast.Name) and each.id == 'Value' for each in ast.walk(value)):
            yield 'export interface {}<Value> {{ [name: string]: Value | undefined }}{}'.format(
                name, beside
            )
        else:
            yield from wrapped(
                'export type {} = '.format(name), CLOSED.get(name) or self._type(value), ';', beside
            )

    def _items(self, call: ast.Call) -> Iterator[Field]:
        names = call.args[1]
        assert isinstance(names, ast.Dict)
        for key, value in zip(names.keys, names.values):
            assert isinstance(key, ast.Constant)
            line = key.lineno
            yield Field(key.value, self._type(value), False, self._above(line), self._beside(line))

    def _shape(self, node: ast.ClassDef) -> Shape:
        extends: List[str] = []
        fields: List[Field] = []
        for base in (each.id for each in node.bases if isinstance(each, ast.Name)):
            if base.startswith('_'):
                extends += self._known[base].extends
                fields += self._known[base].fields
            elif base != 'TypedDict':
                extends.append(named(base))
        partial = any(keyword.arg == 'total' for keyword in node.keywords)
        for each in node.body:
            if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name):
                line = each.lineno
                kind = self._type(each.annotation)
                found = (each.target.id, kind, partial, self._above(line), self._beside(line))
                fields.append(Field(*found))
        return Shape(' '.join((ast.get_docstring(node) or '').split()), extends, fields)

    def _declared(self, name: str, shape: Shape) -> Iterator[str]:
        self._known[name] = shape
        if name.startswith('_'):
            return
        extends = ' extends {}'.format(', '.join(shape.extends)) if shape.extends else ''
        if self._begun:
            yield ''
        self._begun = True
        yield from commented(shape.text)
        yield 'export interface {}{} {{'.format(named(name), extends)
        for field in shape.fields:
            for line in field.above:
                yield '  // ' + line
            key = '{}{}: '.format(keyed(field.name), '?' if field.optional else '')
            yield from wrapped('  ' + key, field.type, ';', field.beside)
        yield '}'

    def _type(self, node: ast.expr) -> str:
        if isinstance(node, ast.Constant):
            return 'null' if node.value is None else repr(node.value)
        if isinstance(node, ast.Name):
            return PLAIN.get(node.id) or named(node.id)
        assert isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name)
        inner = node.slice
        if type(inner).__name__ == 'Index':  # of Python 3.8
            inner = inner.value
        parts = list(inner.elts) if isinstance(inner, ast.Tuple) else [inner]
        kind = node.value.id
        if kind == 'Literal':
            return ' | '.join(literal(each) for each in parts)
        types = [self._type(each) for each in parts]
        if kind == 'Optional':
            return types[0] + ' | null'
        if kind == 'Union':
            return ' | '.join(types)
        if kind == 'List':
            return '({})[]'.format(types[0]) if ' | ' in types[0] else types[0] + '[]'
        if kind == 'Tuple':
            return '[{}]'.format(', '.join(types))
        if kind == 'Dict':
            return '{{ [name: string]: {} | undefined }}'.format(types[1])
        return '{}<{}>'.format(kind, types[0])

    def _above(self, line: int) -> List[str]:
        """Return the comments in lines of their own above a line of the file."""
        found: List[str] = []
        for each in reversed(self._lines[: line - 1]):
            if not each.strip().startswith('# '):
                break
            found.insert(0, script_words(each.strip()[2:]))
        return found

    def _beside(self, line: int) -> str:
        """Return the comment behind a line of the file."""
        _, mark, text = self._lines[line - 1].partition('  # ')
        return ' // ' + script_words(text) if mark else ''


def literal(node: ast.expr) -> str:
    """Return a value of a Literal."""
    assert isinstance(node, ast.Constant)
    if isinstance(node.value, bool):
        return str(node.value).lower()
    return quoted(node.value)


def keyed(name: str) -> str:
    """Return a key of an interface. Capital words stand for whatever a key ends with."""
    first, *more = name.split()
    return '[name: `{} ${{string}}`]'.format(first) if more else name


def named(name: str) -> str:
    """Return the name that a class of Python has in scripts."""
    return name[:-4] if name.endswith('View') else name


def script_words(text: str) -> str:
    """Return a comment in the words of scripts."""
    return text.replace('None', 'null').replace('SectionsView', 'Sections')


def commented(text: str) -> Iterator[str]:
    """Give the lines of a comment that says what an interface is."""
    lines = textwrap.wrap(script_words(text), WIDTH - 7)
    if len(lines) == 1:
        yield '/** {} */'.format(lines[0])
    elif lines:
        yield '/** ' + lines[0]
        yield from (' * ' + line for line in lines[1:])
        yield ' */'


def wrapped(begin: str, kind: str, end: str, beside: str) -> Iterator[str]:
    """Give a declaration in lines that are short enough."""
    indent = begin[: len(begin) - len(begin.lstrip())]
    if len(begin + kind + end) > WIDTH:
        whole = (begin + kind + end).replace(' | ', ' |\xa0')  # a line begins with a bar
        lines = textwrap.wrap(whole, WIDTH, subsequent_indent=indent + '  ')
        yield from (line.replace('\xa0', ' ') for line in lines)
    elif len(begin + kind + end + beside) > WIDTH:
        yield indent + beside.strip()
        yield begin + kind + end
    else:
        yield begin + kind + end + beside


def text() -> str:
    """Return the whole file."""
    known: Dict[str, Shape] = {}
    lines: List[str] = [HEAD]
    for path in SOURCES:
        lines += ['// --- ' + path.stem.replace('_', ' '), '', *Module(path, known).text(), '']
    return '\n'.join(lines).rstrip() + '\n'


def main(arguments: Tuple[str, ...]) -> int:
    """Write the file, or compare it with what it should be."""
    if '--check' not in arguments:
        TARGET.write_text(text(), 'utf-8')
    elif TARGET.read_text('utf-8') != text():
        print('{} is not up to date: run doc/write_page_types.py'.format(TARGET.name))
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main(tuple(sys.argv[1:])))
