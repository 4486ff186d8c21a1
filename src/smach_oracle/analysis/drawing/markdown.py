"""Tables in Markdown."""

from typing import List, Sequence


def table(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a table. Each line has as many cells as there are heads."""
    rows = [heads, ['---'] * len(heads), *lines]
    return '\n'.join('| {} |'.format(' | '.join(row)) for row in rows) + '\n'


def titled(
    title: str, heads: Sequence[str], lines: Sequence[Sequence[str]], below: Sequence[str] = ()
) -> str:
    """Return a table under a title, with paragraphs below it."""
    parts: List[str] = ['**{}**\n'.format(title), table(heads, lines)]
    return '\n'.join(parts + ['{}\n'.format(each) for each in below])
