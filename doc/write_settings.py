#!/usr/bin/env python3
"""Write the settings to launch/oracle.yaml and to the table of doc/settings.md.

    python3 doc/write_settings.py          # write both
    python3 doc/write_settings.py --check  # say which of them is not up to date

Defaults and texts stand in src/smach_oracle/oracle/settings/settings.py. Their order, the sections
and the examples of the file stand in doc/oracle_yaml.in.
"""

import re
import sys
import textwrap
from pathlib import Path
from typing import Any, Dict, NamedTuple

import yaml

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'src'))

from smach_oracle.oracle.decision.ways import Prices  # noqa: E402
from smach_oracle.oracle.settings.checks import Budget, settings_of  # noqa: E402
from smach_oracle.oracle.settings.settings import Settings, StateSettings  # noqa: E402

TEMPLATE = ROOT / 'doc/oracle_yaml.in'
FILE = ROOT / 'launch/oracle.yaml'
PAGE = ROOT / 'doc/settings.md'
TABLE = re.compile(r'(?<=\| key \| default \| what \|\n\|---\|---\|---\|\n).*?\n(?=\n)', re.DOTALL)
# a key in the template, and the first line of an example of it
KEY = re.compile(r'^# (\w+):\n(?=(#   \w)?)', re.MULTILINE)
LINK = re.compile(r'\[([^]]*)]\((\w*)(\.md)?(?:#[\w-]+)?\)')
WIDTH, TEXT_AT = 100, 30  # columns of the file


class Row(NamedTuple):
    """What both files say of a setting."""

    default: Any  # as a file gives it
    text: str  # Markdown
    star: str  # of one that a single state can have as well


def rows() -> Dict[str, Row]:
    """Return every setting by its key."""
    return {
        key: Row(plain(key, getattr(usual, key)), facts['text'], star)
        for usual, star in ((Settings(), ''), (StateSettings(), ' *'))
        for key, facts in settings_of(type(usual)).items()
    }


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
    default = yaml.safe_dump(row.default, default_flow_style=True, width=WIDTH).split('\n')[0]
    line = '# {}:'.format(key) if has_example else '# {}: {}'.format(key, default)
    text = row.star[1:] + ' ' * bool(row.star) + without_markdown(row.text)
    told = textwrap.wrap(text, WIDTH - TEXT_AT - 2, break_on_hyphens=False)
    first = [line] if len(line) >= TEXT_AT else []
    begun = ['#' if first else line] + ['#'] * (len(told) - 1)
    beside = ['{:<{}}# {}'.format(start, TEXT_AT, each) for start, each in zip(begun, told)]
    return '\n'.join(first + beside) + '\n'


def in_table(key: str, row: Row) -> str:
    """Return the row of a setting in the page."""
    default = row.default
    if default in ('', [], {}):
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
    return '| `{}`{} | {} | {} |\n'.format(key, row.star, default, row.text)


def texts() -> Dict[Path, str]:
    """Return what both files should hold."""
    known = rows()
    template = TEMPLATE.read_text(encoding='utf-8')
    keys = [found.group(1) for found in KEY.finditer(template)]
    # one that is in `states` alone is no key of the file
    table = [in_table(key, known.pop(key)) for key in keys]
    table += [in_table(key, row._replace(star='')) for key, row in known.items()]
    known = rows()
    return {
        FILE: KEY.sub(
            lambda found: in_file(found.group(1), known[found.group(1)], bool(found.group(2))),
            template,
        ),
        PAGE: TABLE.sub(lambda _: ''.join(table), PAGE.read_text(encoding='utf-8')),
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
