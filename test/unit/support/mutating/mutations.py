"""The small faults that are put in: each changes one expression or statement of a module."""

import ast
from typing import Callable, Dict, Iterable, Iterator, List, NamedTuple, Tuple, Type, Union

Part = Union[ast.expr, ast.stmt]
Change = Tuple[Part, str]  # a part of a module, and the text in its place

# what an operator becomes: more than one where each is a fault that people make
COMPARED = {
    ast.Lt: ('<=', '>='),
    ast.LtE: ('<', '>'),
    ast.Gt: ('>=', '<='),
    ast.GtE: ('>', '<'),
    ast.Eq: ('!=',),
    ast.NotEq: ('==',),
    ast.Is: ('is not',),
    ast.IsNot: ('is',),
    ast.In: ('not in',),
    ast.NotIn: ('in',),
}
CALCULATED = {
    ast.Add: '-',
    ast.Sub: '+',
    ast.Mult: '/',
    ast.Div: '*',
    ast.BitOr: '&',
    ast.BitAnd: '|',
    ast.FloorDiv: '*',
    ast.Mod: '*',
}
# parts that need no parentheses in front of an operator or behind it
ATOMS = (ast.Name, ast.Attribute, ast.Call, ast.Constant, ast.Subscript)


class Mutant(NamedTuple):
    """One change of a module. Columns count bytes from 0, as `ast` does. Lines count from 1."""

    module: str  # path below the folder that is mutated
    place: str  # class and function around it, '' at the margin
    line: int
    column: int
    last_line: int
    last_column: int
    number: int  # of the changes that begin there
    code: str  # the line on which it begins
    statement: Tuple[int, int]  # first and last line of the statement around it, without its block
    text: str  # in its place
    before: str  # the change, in one line each
    after: str

    @property
    def name(self) -> str:
        """The name that `--only` takes: module, line, column and number."""
        return '{}:{}:{}:{}'.format(self.module, self.line, self.column, self.number)

    def applied(self, source: str) -> str:
        """Return the module with the change in it."""
        text = source.encode()
        starts = _starts_of(text)
        return (
            text[: starts[self.line - 1] + self.column]
            + self.text.encode()
            + text[starts[self.last_line - 1] + self.last_column :]
        ).decode()

    def shown(self) -> str:
        """Return the change, to be read."""
        return '    {}\n    - {}\n    + {}'.format(self.place, self.before, self.after)


class Source:
    """The text of a module, and its tree."""

    def __init__(self, source: str) -> None:
        self.tree = ast.parse(source)
        self._text = source.encode()
        self._starts = _starts_of(self._text)

    def text(self, node: Part) -> str:
        """Return the text of a part, much faster than `ast.get_source_segment`."""
        last, column = _end_of(node)
        return self._text[
            self._starts[node.lineno - 1] + node.col_offset : self._starts[last - 1] + column
        ].decode()

    def operand(self, node: ast.expr) -> str:
        """Return the text of a part, in parentheses where an operator next to it needs them."""
        return self.text(node) if isinstance(node, ATOMS) else '({})'.format(self.text(node))

    def joined(self, operator: ast.boolop, values: Iterable[ast.expr]) -> str:
        """Return values joined by `and` or `or`."""
        word = ' and ' if isinstance(operator, ast.And) else ' or '
        return '({})'.format(word.join(map(self.operand, values)))


def _starts_of(text: bytes) -> List[int]:
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    return starts


def _end_of(node: Part) -> Tuple[int, int]:
    return node.end_lineno or node.lineno, node.end_col_offset or node.col_offset


def mutants_of(text: str, module: str) -> List[Mutant]:
    """Return every mutant of a module."""
    source, lines = Source(text), text.splitlines()
    found: List[Mutant] = []
    seen: List[Tuple[int, int]] = []
    for node, place, statement in _parts(source.tree, '', (1, 1)):
        for part, new in _changes_of(node, source):
            where = (part.lineno, part.col_offset)
            found.append(
                Mutant(
                    module,
                    place,
                    *where,
                    *_end_of(part),
                    seen.count(where),
                    lines[part.lineno - 1].strip(),
                    statement,
                    new,
                    ' '.join(source.text(part).split()),
                    ' '.join(new.split()),
                )
            )
            seen.append(where)
    return found


def _parts(
    node: ast.AST, place: str, statement: Tuple[int, int]
) -> Iterator[Tuple[ast.AST, str, Tuple[int, int]]]:
    """Yield each part with the place and the lines of the statement around it.

    Annotations, protocols and f-strings, whose parts have no true place in Python 3.8, are left
    out.
    """
    if isinstance(node, ast.stmt):
        statement = _lines_of(node)
    yield node, place, statement
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        place = '.'.join(filter(None, (place, node.name)))
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not (
                name in ('annotation', 'returns')
                or isinstance(child, ast.JoinedStr)
                or _is_protocol(child)
            ):
                yield from _parts(child, place, statement)


def _lines_of(statement: ast.stmt) -> Tuple[int, int]:
    """Return the first and the last line of a statement, without the block below it."""
    block = getattr(statement, 'body', None)
    last = block[0].lineno - 1 if block else _end_of(statement)[0]
    return statement.lineno, max(statement.lineno, last)


def _is_protocol(node: ast.AST) -> bool:
    return isinstance(node, ast.ClassDef) and any(
        'Protocol' in ast.dump(base) for base in node.bases
    )


# -- the changes, by kind of part


def _changes_of(node: ast.AST, source: Source) -> Iterator[Change]:
    for kind, changes in CHANGES.items():
        if isinstance(node, kind):
            yield from changes(node, source)


def _other_comparison(node: ast.Compare, source: Source) -> Iterator[Change]:
    if len(node.ops) == 1:
        for operator in COMPARED[type(node.ops[0])]:
            yield (
                node,
                '{} {} {}'.format(
                    source.operand(node.left), operator, source.operand(node.comparators[0])
                ),
            )


def _other_logic(node: ast.BoolOp, source: Source) -> Iterator[Change]:
    yield node, source.joined(ast.And() if isinstance(node.op, ast.Or) else ast.Or(), node.values)
    for left_out in range(len(node.values)):
        yield node, source.joined(node.op, node.values[:left_out] + node.values[left_out + 1 :])


def _without_not(node: ast.UnaryOp, source: Source) -> Iterator[Change]:
    if isinstance(node.op, ast.Not):
        yield node, '({})'.format(source.text(node.operand))


def _other_sum(node: ast.BinOp, source: Source) -> Iterator[Change]:
    texts = any(
        isinstance(each, ast.Constant) and isinstance(each.value, str)
        for each in (node.left, node.right)
    )
    if type(node.op) in CALCULATED and not texts:
        yield (
            node,
            '({} {} {})'.format(
                source.operand(node.left), CALCULATED[type(node.op)], source.operand(node.right)
            ),
        )


def _turned_condition(node: Union[ast.If, ast.While], source: Source) -> Iterator[Change]:
    yield from _turned(node.test, source)


def _turned_filter(node: ast.comprehension, source: Source) -> Iterator[Change]:
    for condition in node.ifs:
        yield from _turned(condition, source)


def _turned(test: ast.expr, source: Source) -> Iterator[Change]:
    """Yield the opposite, unless another change is the same."""
    if not isinstance(test, ast.Compare) and not (
        isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not)
    ):
        yield test, '(not ({}))'.format(source.text(test))


def _one_branch(node: ast.IfExp, source: Source) -> Iterator[Change]:
    yield node, '({})'.format(source.text(node.body))
    yield node, '({})'.format(source.text(node.orelse))


def _other_constant(node: ast.Constant, source: Source) -> Iterator[Change]:
    if isinstance(node.value, bool):
        yield node, str(not node.value)
    elif isinstance(node.value, (int, float)):
        yield node, '({} + 1)'.format(source.text(node))


def _nothing_returned(node: ast.Return, source: Source) -> Iterator[Change]:
    nothing = isinstance(node.value, ast.Constant) and node.value.value in (None, False)
    if node.value is not None and not nothing:
        yield node.value, 'None'


def _no_call(node: ast.Expr, source: Source) -> Iterator[Change]:
    if isinstance(node.value, ast.Call):
        yield node, 'pass'


def _no_error(node: ast.Raise, source: Source) -> Iterator[Change]:
    if 'NotImplementedError' not in source.text(node):
        yield node, 'pass'


def _not_written(node: ast.Assign, source: Source) -> Iterator[Change]:
    if any(isinstance(target, ast.Attribute) for target in node.targets):
        yield node, 'pass'


def _not_counted(node: ast.AugAssign, source: Source) -> Iterator[Change]:
    yield node, 'pass'


def _goes_on(node: ast.Break, source: Source) -> Iterator[Change]:
    yield node, 'continue'


def _falls_through(node: ast.Continue, source: Source) -> Iterator[Change]:
    yield node, 'pass'


CHANGES: Dict[Type[ast.AST], Callable[..., Iterator[Change]]] = {
    ast.Compare: _other_comparison,
    ast.BoolOp: _other_logic,
    ast.UnaryOp: _without_not,
    ast.BinOp: _other_sum,
    ast.If: _turned_condition,
    ast.While: _turned_condition,
    ast.comprehension: _turned_filter,
    ast.IfExp: _one_branch,
    ast.Constant: _other_constant,
    ast.Return: _nothing_returned,
    ast.Expr: _no_call,
    ast.Raise: _no_error,
    ast.Assign: _not_written,
    ast.AugAssign: _not_counted,
    ast.Break: _goes_on,
    ast.Continue: _falls_through,
}
