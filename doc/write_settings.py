#!/usr/bin/env python3
"""Write the settings to launch/oracle.yaml and to the table of doc/settings.md.

    python3 doc/write_settings.py          # write both
    python3 doc/write_settings.py --check  # say which of them is not up to date

Defaults, texts and groups stand in src/smach_oracle/oracle/settings/settings.py. Their order, the
sections and the examples of the file stand in doc/oracle_yaml.in.
"""

import re
import sys
import textwrap
from pathlib import Path
from typing import Any, Dict, Iterable, NamedTuple, Sequence

import yaml

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'src'))

from smach_oracle.oracle.decision.ways import Prices  # noqa: E402
from smach_oracle.oracle.settings.checks import Budget, settings_of  # noqa: E402
from smach_oracle.oracle.settings.settings import GROUPS, Settings, StateSettings  # noqa: E402

TEMPLATE = ROOT / 'doc/oracle_yaml.in'
FILE = ROOT / 'launch/oracle.yaml'
PAGE = ROOT / 'doc/settings.md'
HEAD = r'{}\| {} \|\n\|(?:---\|)+\n'
# a key in the template, in a group or in none, and the first line of an example of it
KEY = re.compile(r'^# ([\w.]+):\n(?=(#   +\w)?)', re.MULTILINE)
LINK = re.compile(r'\[([^]]*)]\((\w*)(\.md)?(?:#[\w-]+)?\)')
WIDTH, TEXT_AT = 100, 30  # columns of the file
GROUP = object()


class Row(NamedTuple):
    """What both files say of a setting."""

    default: Any  # as a file gives it. Of a group GROUP
    text: str  # Markdown
    star: str  # of one that a single state can have as well


def rows() -> Dict[str, Row]:
    """Return every setting and every group by its dotted key."""
    found = {
        GROUPS.key_of(name): Row(plain(name, getattr(usual, name)), facts['text'], star)
        for usual, star in ((Settings(), ''), (StateSettings(), ' *'))
        for name, facts in settings_of(type(usual)).items()
    }
    found.update({group: Row(GROUP, text, '') for group, text in GROUPS.texts.items()})
    return found


def plain(key: str, value: Any) -> Any:
    """Return a default as a file gives it."""
    if isinstance(value, Prices):
        return value._asdict()
    if isinstance(value, tuple):
        return value[0] if value[-1:] == ('',) else list(value)  # 'stop', which names nothing
    if value is None:
        return 0 if key == 'time_limit_s' else None
    return {} if value == Budget() else value


def without_markdown(text: str) -> str:
    """Return a text for the file: links name their page."""

    def named(link: 're.Match[str]') -> str:
        label, page, suffix = link.groups()
        place = 'doc/{}.md'.format(page)
        if suffix is None:  # a heading of doc/settings.md
            return label
        return place if label == page + suffix else '{} ({})'.format(label, place)

    return LINK.sub(named, text).replace('`', '')


def in_file(key: str, row: Row, has_example: bool) -> str:
    """Return the lines of a setting in the file: key and default, and the text beside them."""
    group, _, inner = key.rpartition('.')
    line = '# {}{}:'.format('  ' if group else '', inner)
    if row.default is not GROUP and not has_example:
        default = yaml.safe_dump(row.default, default_flow_style=True, width=WIDTH)
        line += ' ' + default.split('\n')[0]
    text = row.star[1:] + ' ' * bool(row.star) + without_markdown(row.text)
    told = textwrap.wrap(text, WIDTH - TEXT_AT - 2, break_on_hyphens=False)
    first = [line] if len(line) >= TEXT_AT else []
    begun = ['#' if first else line] + ['#'] * (len(told) - 1)
    beside = ['{:<{}}# {}'.format(start, TEXT_AT, each) for start, each in zip(begun, told)]
    return '\n'.join(first + beside) + '\n'


def in_table(key: str, row: Row) -> str:
    """Return the row of a setting in the page."""
    default = row.default
    if default is GROUP:
        default = '[group](#{})'.format(key)
    elif default in ('', [], {}):
        default = 'none'
    elif isinstance(default, dict):
        default = '`{}`'.format(
            yaml.safe_dump(default, default_flow_style=True, width=WIDTH).strip()
        )
    elif isinstance(default, list):
        default = ', '.join(default)
    elif default is None or isinstance(default, bool):
        default = yaml.safe_dump(default).split('\n')[0]
    elif isinstance(default, float):
        default = '{:g}'.format(default)
    return '| `{}`{} | {} | {} |\n'.format(key.rpartition('.')[2], row.star, default, row.text)


def table(page: str, before: str, head: str, lines: Iterable[str]) -> str:
    """Return a page with the rows of a table replaced. `before`: what stands above its head."""
    place = re.compile('({}).*?\n(?=\n)'.format(HEAD.format(before, head)), re.DOTALL)
    found, count = place.subn(lambda old: old.group(1) + ''.join(lines), page)
    assert count == 1, (before, count)
    return found


def page_with(page: str, keys: Sequence[str]) -> str:
    """Return the page with its tables. `keys`: those of the file, in order."""
    known, head = rows(), r'key \| default \| what'
    top = [in_table(key, known[key]) for key in keys if '.' not in key]
    page = table(page, '## Every setting\n\n[^|#]*', head, top)
    for group in GROUPS.texts:
        inner = [key for key in keys if key.startswith(group + '.')]
        assert len(inner) == len(GROUPS.members(group)), group
        lines = [in_table(key, known[key]) for key in inner]
        page = table(page, '### {}\n\n[^|#]*'.format(group), head, lines)
    # of states alone, and so no key of the file
    of_states = [in_table(key, known[key]._replace(star='')) for key in known if key not in keys]
    page = table(page, '### states\n\n[^|#]*', head, of_states)
    older = ['| `{}` | `{}` |\n'.format(*each) for each in GROUPS.older_keys().items()]
    return table(page, '## Older names\n\n[^|#]*', r'older \| now', older)


def texts() -> Dict[Path, str]:
    """Return what both files should hold."""
    known = rows()
    template = TEMPLATE.read_text(encoding='utf-8')
    keys = [found.group(1) for found in KEY.finditer(template)]
    return {
        FILE: KEY.sub(
            lambda found: in_file(found.group(1), known[found.group(1)], bool(found.group(2))),
            template,
        ),
        PAGE: page_with(PAGE.read_text(encoding='utf-8'), keys),
    }


def main() -> int:
    """Write, or compare with --check."""
    old = [path for path, text in texts().items() if path.read_text(encoding='utf-8') != text]
    for path in old:
        if '--check' in sys.argv[1:]:
            print('{} is not up to date: run doc/write_settings.py'.format(path.relative_to(ROOT)))
        else:
            path.write_text(texts()[path], encoding='utf-8')
    return 1 if old and '--check' in sys.argv[1:] else 0


if __name__ == '__main__':
    sys.exit(main())
