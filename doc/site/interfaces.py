"""Pages of the reference from the files in msg/, srv/ and action/: their comments are the text."""

from pathlib import Path
from typing import List, NamedTuple, Tuple

KINDS = (
    ('Messages', 'msg', ()),
    ('Services', 'srv', ('Request', 'Response')),
    ('Actions', 'action', ('Goal', 'Result', 'Feedback')),
)


class Part(NamedTuple):
    """A message, or one side of a service or an action."""

    about: str
    fields: List[Tuple[str, str, str]]  # type, name, comment


def read_part(text: str) -> Part:
    """Read fields with their comments.

    A comment behind a field goes on in the indented lines below it. A comment at the left edge is
    about the field below it, or, above the first field, about the whole.
    """
    about: List[str] = []
    above: List[str] = []
    fields: List[Tuple[str, str, str]] = []
    for line in text.splitlines():
        code, _, comment = line.partition('#')
        comment = comment.strip()
        if code.strip():
            kind, name = code.split(None, 1)
            fields.append((kind, name.strip(), ' '.join(above + [comment]).strip()))
            above = []
        elif comment and line[0] != '#' and fields:
            fields[-1] = fields[-1][:2] + ('{} {}'.format(fields[-1][2], comment).strip(),)
        elif comment and fields:
            above.append(comment)
        elif comment:
            about.append(comment)
    return Part(' '.join(about + above), fields)


def _cell(text: str) -> str:
    """Text for a cell of a table: it shows as it is written."""
    for character in '\\|*_<>[]`$':
        text = text.replace(character, '\\' + character)
    return text


def _table(part: Part) -> List[str]:
    if not part.fields:
        return ['No fields.', '']
    rows = [
        '| `{}` | `{}` | {} |'.format(kind, name, _cell(comment))
        for kind, name, comment in part.fields
    ]
    return ['| type | name | meaning |', '|---|---|---|', *rows, '']


def _section(path: Path, sides: Tuple[str, ...]) -> List[str]:
    lines = ['## {}'.format(path.stem), '']
    for number, text in enumerate(path.read_text(encoding='utf-8').split('\n---')):
        part = read_part(text)
        lines += [_cell(part.about), '']
        lines += ['**{}**'.format(sides[number]), ''] if sides else []
        lines += _table(part)
    return lines


def interface_pages(root: Path) -> List[Tuple[str, str]]:
    """(name, Markdown) of the three pages."""
    pages = []
    for title, folder, sides in KINDS:
        lines = [
            '# {}'.format(title),
            '',
            'From the comments in `{0}/`. `ros{0} show -r` prints them too.'.format(folder)
            if folder != 'action'
            else 'From the comments in `action/`.',
            '',
        ]
        for path in sorted((root / folder).glob('*.' + folder)):
            lines += _section(path, sides)
        pages.append((title.lower() + '.md', '\n'.join(lines)))
    return pages
