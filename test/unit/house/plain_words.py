"""What a rule can see of doc/inside/style.md: long or inverted sentences, semicolons, terms.

``python3 test/unit/house/plain_words.py [FILE]...`` prints what it and proselint find in files.
Without names it reads all files.
"""

import ast
import io
import itertools
import re
import sys
import tokenize
from pathlib import Path
from typing import Iterator, List, NamedTuple

from few_phrases import may_have, quick_lint
from house import ROOT, is_python, shown, tracked_text

MOST_WORDS = 35
STYLE = 'doc/inside/style.md'
PAGES = ('.md', '.rst')
INTERFACES = ('.msg', '.srv', '.action')


class Fault(NamedTuple):
    """A place where a reader stops."""

    line: int
    rule: str
    text: str


class Prose(NamedTuple):
    """A piece of text for people, and where it begins; `page` is a paragraph of a page."""

    line: int
    text: str
    page: bool = False
    table: bool = False


SENTENCE = re.compile(r'(?<=[.?!:])\s+(?=[A-Z`*"(])')
INVERTED = re.compile(
    r'(?:\* +|\d+\. +)?\**'
    r'(?:What|Who|Whoever|Whom|Whose|Of (?:an?|the|what|such|more|less|each|its|which|two|those)) '
    r'(?![^.?]*\?)'
)
NONE = re.compile(r'\b(?:is|are|was|were) none\b')
NOT_A = re.compile(r'(?<!there )(?<!There ){}(?! of)'.format(NONE.pattern))
CODE = re.compile(r'``.*?``|`[^`]*`|"[^"]*"|(?<=\]\()[^)]*(?=\))', re.DOTALL)

GOES_ON_ON = re.compile(r'\bgoes on on\b')  # no word is there twice: it goes on, on something


def terms() -> List[str]:
    """The phrases in code font in the last column of the table of terms."""
    rows = re.findall(r'^\|.*\|(.*)\|$', (ROOT / STYLE).read_text(encoding='utf-8'), re.MULTILINE)
    return [phrase for row in rows for phrase in re.findall('`([^`]+)`', row)]


PHRASES = terms()
TERMS = [
    re.compile(r'(?<!there )\b{}\b(?! as\b)'.format(re.escape(phrase)), re.IGNORECASE)
    for phrase in PHRASES
]


def quotations_out(text: str) -> str:
    """`text` without code, quotations and targets of links, each as one word.

    Neighbours are different words: to proselint the same word twice is a fault.
    """
    words = itertools.cycle('XY')
    return CODE.sub(lambda _: next(words), text)


def page_prose(text: str) -> Iterator[Prose]:
    """The paragraphs, points of lists and table rows of a page, without its code blocks."""
    begun, kept, code = 0, [], False
    for number, line in enumerate(text.splitlines() + [''], 1):
        code ^= line.lstrip().startswith('```')
        table = line.startswith('|')
        ends = code or not line.strip() or table or re.match(r'[#`<]|\s*([*-]|\d+\.) ', line)
        if kept and ends:
            yield Prose(begun, ' '.join(kept), page=True)
            kept = []
        if table:
            yield Prose(number, line, page=True, table=True)
        elif line.strip() and not code and not re.match('[#<]|```', line.lstrip()):
            begun = begun if kept else number
            kept.append(line.strip())


def python_prose(text: str) -> Iterator[Prose]:
    """Docstrings, comments, and strings of at least four words."""
    yield from strings_prose(text)
    yield from comments_prose(text)


def strings_prose(text: str) -> Iterator[Prose]:
    """Docstrings, and other strings of at least four words."""
    for node in ast.walk(ast.parse(text)):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and len(node.value.split()) >= 4
        ):
            yield Prose(node.lineno, node.value)


def comments_prose(text: str) -> Iterator[Prose]:
    """The comments of a Python file."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield Prose(token.start[0], token.string)


def interface_prose(text: str) -> Iterator[Prose]:
    """The comments of a message, a service or an action; those that go on are one."""
    begun, kept = 0, []
    for number, line in enumerate(text.splitlines() + [''], 1):
        alone = line.strip().startswith('#')
        if kept and not alone:
            yield Prose(begun, ' '.join(kept))
            kept = []
        if '#' in line:
            begun = begun if kept else number
            kept.append(line.split('#', 1)[1].strip())
    if kept:
        yield Prose(begun, ' '.join(kept))


def prose_of(path: Path) -> List[Prose]:
    """The text for people in a file, none for a kind of file that is not looked at."""
    text = path.read_text(encoding='utf-8')
    if path.suffix in PAGES:
        return list(page_prose(text))
    if path.suffix in INTERFACES:
        return list(interface_prose(text))
    if not is_python(path):
        return []
    # what finds comments takes most of the time; few files have what a rule looks for in one
    of_interest = any(may_have(text, phrase) for phrase in PHRASES) or NONE.search(text)
    return list(python_prose(text) if of_interest else strings_prose(text))


def faults(piece: Prose) -> Iterator[Fault]:
    """What the rules find in one piece."""
    text = quotations_out(piece.text)
    for pattern in TERMS + [NOT_A]:
        for match in pattern.finditer(text):
            yield Fault(piece.line, 'term', match.group())
    if not piece.page or piece.table:
        return
    if '; ' in text:
        yield Fault(piece.line, 'semicolon', text[max(0, text.index('; ') - 40) :][:60])
    for sentence in SENTENCE.split(text):
        if INVERTED.match(sentence):
            yield Fault(piece.line, 'inverted', sentence[:60])
        if len(sentence.split()) > MOST_WORDS:
            yield Fault(
                piece.line, 'long', '{} words: {}'.format(len(sentence.split()), sentence[:60])
            )


def faults_of(path: Path) -> List[Fault]:
    """What the rules find in one file."""
    return [fault for piece in prose_of(path) for fault in faults(piece)]


def proselint_faults(path: Path) -> Iterator[Fault]:
    """What proselint finds in a page: its words, for typography is the browser's matter."""
    text = re.sub(
        r'^```.*?^```',
        lambda block: re.sub(r'[^\n]', '', block.group()),
        path.read_text(encoding='utf-8'),
        flags=re.MULTILINE | re.DOTALL,
    )
    for found in quick_lint()(GOES_ON_ON.sub('goes on upon', quotations_out(text))):
        if not found[0].startswith('typography'):
            yield Fault(found[2] + 1, found[0], found[1])


def is_checked(path: Path) -> bool:
    """Whether the rules hold for a file."""
    name = shown(path)
    kind = path.suffix in PAGES + INTERFACES or is_python(path)
    quotes_them = name == STYLE or name.endswith('plain_words.py')
    return kind and not quotes_them


def checked_files() -> List[Path]:
    """The files for which the rules hold today."""
    return [path for path in tracked_text() if is_checked(path)]


def main() -> int:
    paths = [Path(name).resolve() for name in sys.argv[1:]] or checked_files()
    count = 0
    for path in paths:
        found = faults_of(path)
        if path.suffix in PAGES:
            found += proselint_faults(path)
        for fault in found:
            name = shown(path) if ROOT in path.parents else path
            print('{}:{}: {}: {}'.format(name, *fault))
        count += len(found)
    print('{} faults in {} files; the rules: {}'.format(count, len(paths), STYLE))
    return 1 if count else 0


if __name__ == '__main__':
    sys.exit(main())
